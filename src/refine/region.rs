//! How far from an estimate the truth may be: regions of a stated probability.
//!
//! With dimension $`d`$, covariance $`\Sigma`$ and Student's t of $`\nu`$ degrees of freedom, the errors $`e`$ with
//!
//! ```math
//! e^T \Sigma^{-1} e \le d \, F_{d, \nu}(p) \, \frac{\nu - 2}{\nu}
//! ```
//!
//! have the probability $`p`$, where $`F_{d, \nu}(p)`$ is a quantile of Fisher's distribution; an infinite $`\nu`$ gives
//! a Gaussian's chi-square quantile.

use libm::lgamma;

use crate::error::{Got, InputError, require};
use crate::geometry::math::{exp, log};

/// Squared Mahalanobis distance, against a covariance of so many `dimensions`, within which the truth lies with the
/// probability `level`, for errors of Student's t with `dof` degrees of freedom (infinite: Gaussian).
///
/// ```
/// use groundpose::region_radius2;
///
/// // 95 % of a Gaussian error of a pose, and of a yaw: 1.96 standard deviations.
/// assert!((region_radius2(0.95, 6, f64::INFINITY)? - 12.592).abs() < 1e-3);
/// assert!((region_radius2(0.95, 1, f64::INFINITY)?.sqrt() - 1.95996).abs() < 1e-5);
/// // Heavy tails of the same variance: nearer for one half, further for nearly all.
/// assert!(region_radius2(0.5, 6, 5.6)? < region_radius2(0.5, 6, f64::INFINITY)?);
/// assert!(region_radius2(0.95, 6, 5.6)? > region_radius2(0.95, 6, f64::INFINITY)?);
/// # Ok::<(), groundpose::InputError>(())
/// ```
///
/// # Errors
/// A level that is not between 0 and 1, no dimension, a `dof` of 2 or less (such errors have no covariance).
pub fn region_radius2(level: f64, dimensions: usize, dof: f64) -> Result<f64, InputError> {
    require(level > 0.0 && level < 1.0, "level", "a probability between 0 and 1", Got::Number(level))?;
    require(dimensions > 0, "dimensions", "at least 1", Got::Count(dimensions))?;
    require(dof > 2.0, "dof", "more than 2: errors of fewer have no covariance", Got::Number(dof))?;
    let half = 0.5 * dimensions as f64;
    let (mut low, mut high) = (0.0, 1.0);
    while probability_within(high, half, dof) < level {
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if probability_within(middle, half, dof) < level { low = middle } else { high = middle }
    }
    Ok(0.5 * (low + high))
}

/// Halvings of an interval as long as its lower end: to the last bits.
const BISECTIONS: usize = 60;

/// Probability that the squared distance is below `radius2`, in `2 half` dimensions.
fn probability_within(radius2: f64, half: f64, dof: f64) -> f64 {
    if dof.is_infinite() {
        return gamma_part(half, 0.5 * radius2);
    }
    // the squared distance against the scale matrix, whose covariance is dof / (dof - 2) times as large
    let scaled = radius2 * dof / (dof - 2.0);
    beta_part(half, 0.5 * dof, scaled / (scaled + dof), dof / (scaled + dof))
}

/// The regularised lower incomplete gamma function `P(a, x)`, by its series.
fn gamma_part(a: f64, x: f64) -> f64 {
    if x == 0.0 {
        return 0.0;
    }
    exp(a * log(x) - x - lgamma(a + 1.0)) * series(|n| x / (a + n))
}

/// The regularised incomplete beta function `I_x(a, b)` with `y = 1 - x`, by the series of the smaller side.
fn beta_part(a: f64, b: f64, x: f64, y: f64) -> f64 {
    if x > 0.5 {
        return 1.0 - beta_part(b, a, y, x);
    }
    if x == 0.0 {
        return 0.0;
    }
    let logarithm = a * log(x) + b * log(y) + lgamma(a + b) - lgamma(a + 1.0) - lgamma(b);
    exp(logarithm) * series(|n| x * (a + b + n - 1.0) / (a + n))
}

/// `1 + r(1) + r(1) r(2) + ...` of positive ratios that fall below one.
fn series(ratio: impl Fn(f64) -> f64) -> f64 {
    let (mut sum, mut term, mut n) = (1.0, 1.0, 1.0);
    loop {
        let r = ratio(n);
        term *= r;
        sum += term;
        if r < 1.0 && term < 1e-17 * sum {
            return sum;
        }
        n += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_tables() {
        // chi-square and F, from printed tables
        for (level, dimensions, expected) in [(0.95, 1, 3.8415), (0.9, 2, 4.6052), (0.99, 3, 11.3449), (0.5, 6, 5.3481)]
        {
            let got = region_radius2(level, dimensions, f64::INFINITY).unwrap();
            assert!((got - expected).abs() < 1e-4, "{level} {dimensions}: {got}");
        }
        for (level, dimensions, dof, f) in [(0.95, 1, 10.0, 4.9646), (0.95, 6, 5.0, 4.9503), (0.99, 3, 4.0, 16.6944)] {
            let got = region_radius2(level, dimensions, dof).unwrap();
            let expected = dimensions as f64 * f * (dof - 2.0) / dof;
            assert!((got - expected).abs() < 1e-3, "{level} {dimensions} {dof}: {got} {expected}");
        }
    }

    #[test]
    fn many_degrees_of_freedom_are_gaussian() {
        let (t, gauss) = (region_radius2(0.95, 6, 1e7).unwrap(), region_radius2(0.95, 6, f64::INFINITY).unwrap());
        assert!((t - gauss).abs() < 1e-4, "{t} {gauss}");
    }

    #[test]
    fn what_cannot_be_is_named() {
        for (level, dimensions, dof, argument) in
            [(1.0, 6, 5.0, "level"), (f64::NAN, 6, 5.0, "level"), (0.5, 0, 5.0, "dimensions"), (0.5, 6, 2.0, "dof")]
        {
            assert_eq!(region_radius2(level, dimensions, dof).unwrap_err().argument, argument);
        }
    }
}
