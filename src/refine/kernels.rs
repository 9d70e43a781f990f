//! Robust kernels: `rho(r)` and the weight `rho'(r) / r` of iteratively reweighted least squares.
//!
//! All take squared residuals, so that no square root is needed, and all are `r^2 / 2` near zero.

use crate::simd::lanes::{Unit, Vector};

/// A robust kernel with its scale.
///
/// ```
/// use groundpose::Kernel;
///
/// let tukey = Kernel::Tukey { c2: 4.0 * 4.0 };
/// let (near, weight_near) = tukey.evaluate(0.1 * 0.1);
/// assert!((near - 0.005).abs() < 1e-5 && weight_near > 0.99);
/// let (_, weight_far) = tukey.evaluate(5.0 * 5.0);
/// assert_eq!(weight_far, 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kernel {
    /// `r^2 / 2`.
    LeastSquares,
    /// Tukey's biweight (paper, eq. 10); no influence beyond the scale `c`.
    Tukey {
        /// `c^2`.
        c2: f64,
    },
    /// Student's t with `dof` degrees of freedom and the given scale: heavy tails, never flat.
    Student {
        /// Scale squared.
        s2: f64,
        /// Degrees of freedom.
        dof: f64,
    },
}

impl Kernel {
    /// `(rho, rho'(r) / r)` at the squared residual `r2`.
    #[inline(always)]
    #[must_use]
    pub fn evaluate(self, r2: f64) -> (f64, f64) {
        match self {
            Kernel::LeastSquares => (0.5 * r2, 1.0),
            Kernel::Tukey { c2 } => tukey(r2, c2, 1.0 / c2),
            Kernel::Student { s2, dof } => {
                let x = 1.0 + r2 / (s2 * dof);
                (0.5 * s2 * dof * crate::geometry::math::log(x), 1.0 / x)
            }
        }
    }
}

/// Tukey's biweight with `1 / c^2` at hand (paper, eq. 10).
#[inline(always)]
pub(crate) fn tukey(r2: f64, c2: f64, inverse_c2: f64) -> (f64, f64) {
    // A residual that is not a number (a point in the camera plane) counts as beyond the scale.
    let x = if r2 < c2 { r2 * inverse_c2 } else { 1.0 };
    let y = 1.0 - x;
    (c2 / 6.0 * (1.0 - y * y * y), y * y)
}

/// [`tukey`] on many residuals.
#[inline(always)]
pub(crate) fn tukey_lanes<U: Unit>(unit: U, r2: U::Vector, c2: f64, inverse_c2: f64) -> (U::Vector, U::Vector) {
    let one = unit.splat(1.0);
    let y = one - (r2 * inverse_c2).min(one);
    let weight = y * y;
    ((one - weight * y) * (c2 / 6.0), weight)
}
