//! One law for every kernel: the weight is `rho'(r) / r`, near zero and far away.

use crate::refine::kernels::{Kernel, tukey, tukey_lanes};
use crate::simd::lanes::{LANES, Lanes, Portable};

/// Kernels, each with the square of its scale.
const KERNELS: [(Kernel, f64); 7] = [
    (Kernel::LeastSquares, 1.0),
    (Kernel::Tukey { c2: 0.25 }, 0.25),
    (Kernel::Tukey { c2: 16.0 }, 16.0),
    (Kernel::Tukey { c2: 2500.0 }, 2500.0),
    (Kernel::Student { s2: 1.0, dof: 3.0 }, 1.0),
    (Kernel::Student { s2: 400.0, dof: 8.0 }, 400.0),
    (Kernel::Student { s2: 7e-4, dof: 8.0 }, 7e-4),
];

/// From 0.0001 to 10,000 pixels.
fn residuals() -> impl Iterator<Item = f64> {
    (-40..=40).map(|k| 10_f64.powf(f64::from(k) * 0.1))
}

#[test]
fn weight_is_slope_over_residual() {
    for (kernel, scale2) in KERNELS {
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
    for (kernel, scale2) in KERNELS {
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

#[test]
fn tukey_by_lanes_is_tukey() {
    let c2 = 16.0;
    for r2 in [[0.0, 1.0, 15.9, 16.0], [16.1, 1e300, f64::INFINITY, f64::NAN]] {
        let (rho, weight) = tukey_lanes(Portable, Lanes(r2), c2, 1.0 / c2);
        for lane in 0..LANES {
            let expected = tukey(r2[lane], c2, 1.0 / c2);
            assert!((rho.0[lane] - expected.0).abs() < 1e-15 && (weight.0[lane] - expected.1).abs() < 1e-15);
        }
    }
}
