//! One law for every kernel: the weight is `rho'(r) / r`, near zero and far away.

use crate::refine::kernels::{Kernel, Rho, WithRho};
use crate::simd::lanes::{LANES, Lanes, Portable};

/// From the radians of a tilt to the pixels of a wide search.
const SCALES2: [f64; 6] = [7e-4, 0.25, 1.0, 16.0, 400.0, 2500.0];

/// Every kernel at every scale, with the square of the scale.
fn kernels() -> impl Iterator<Item = (Kernel, f64)> {
    Kernel::EXAMPLES.iter().flat_map(|at| SCALES2.map(|scale2| (at(scale2), scale2)))
}

/// From 0.0001 to 10,000 pixels.
fn residuals() -> impl Iterator<Item = f64> {
    (-40..=40).map(|k| 10_f64.powf(f64::from(k) * 0.1))
}

#[test]
fn weight_is_slope_over_residual() {
    for (kernel, scale2) in kernels() {
        for r in residuals() {
            let rho = |r: f64| kernel.evaluate(r * r).0;
            let step = 1e-5 * r;
            let slope = (rho(r + step) - rho(r - step)) / (2.0 * step);
            let weight = kernel.evaluate(r * r).1;
            // Differences lose digits in proportion to the numbers subtracted.
            let tolerance = 1e-8 * (r + weight * r) + 1e-15 * (scale2 + rho(r)) / step;
            assert!((slope - weight * r).abs() <= tolerance, "{kernel:?} at {r}: {slope} {}", weight * r);
        }
    }
}

#[test]
fn least_squares_near_zero_and_never_a_gain_far_away() {
    for (kernel, scale2) in kernels() {
        let near = 1e-6 * scale2;
        let (rho, weight) = kernel.evaluate(near);
        assert!((rho / (0.5 * near) - 1.0).abs() < 1e-4 && (weight - 1.0).abs() < 1e-4, "{kernel:?}");
        assert_eq!(kernel.evaluate(0.0), (0.0, 1.0), "{kernel:?}");
        let values: Vec<(f64, f64)> = residuals().map(|r| kernel.evaluate(r * r)).collect();
        for pair in values.windows(2) {
            assert!(pair[1].0 >= pair[0].0 && pair[1].1 <= pair[0].1 && pair[1].1 >= 0.0, "{kernel:?}: {pair:?}");
        }
    }
}

#[test]
fn tukey_ends_at_its_scale() {
    for c2 in [0.25, 16.0, 2500.0] {
        for r2 in [c2, 1.1 * c2, 1e300, f64::INFINITY, f64::NAN] {
            assert_eq!(Kernel::Tukey { c2 }.evaluate(r2), (c2 / 6.0, 0.0), "{r2}");
        }
    }
}

/// Compares lane by lane.
struct Compare {
    r2: [f64; LANES],
    what: String,
}

impl WithRho for Compare {
    fn run(self, rho: impl Rho) {
        let (values, weights) = rho.lanes(Portable, Lanes(self.r2));
        for lane in 0..LANES {
            let (value, weight) = rho.evaluate(self.r2[lane]);
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-15 * (1.0 + b.abs()) || a.to_bits() == b.to_bits();
            assert!(close(values.0[lane], value) && close(weights.0[lane], weight), "{}: {:?}", self.what, self.r2);
        }
    }
}

#[test]
fn by_lanes_is_one_by_one() {
    for (kernel, scale2) in kernels() {
        for r2 in [[0.0, 0.06, 0.99, 1.0], [1.01, 1e300, f64::INFINITY, f64::NAN]] {
            kernel.with(Compare { r2: r2.map(|x| x * scale2), what: format!("{kernel:?}") });
        }
    }
}
