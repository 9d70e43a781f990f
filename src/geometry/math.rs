//! The few scalar functions the core needs, with the same bits on every platform.
//!
//! Transcendental functions always come from `libm`, so that a feature never changes a number.
//! The square root is correctly rounded everywhere; with `std` it is one instruction.

pub(crate) use libm::{atan2, cos, exp, log, pow, sin, tan};

#[cfg(feature = "std")]
#[inline(always)]
pub(crate) fn sqrt(x: f64) -> f64 {
    x.sqrt()
}

#[cfg(not(feature = "std"))]
#[inline(always)]
pub(crate) fn sqrt(x: f64) -> f64 {
    libm::sqrt(x)
}

#[inline(always)]
pub(crate) fn square(x: f64) -> f64 {
    x * x
}

#[inline(always)]
pub(crate) fn norm2(x: f64, y: f64) -> f64 {
    sqrt(x * x + y * y)
}

/// Real roots of `a x^2 + b x + c`, without cancellation; at most two.
#[inline]
pub(crate) fn quadratic_roots(a: f64, b: f64, c: f64) -> impl Iterator<Item = f64> {
    let discriminant = b * b - 4.0 * a * c;
    let q = -0.5 * (b + copysign(sqrt(discriminant.max(0.0)), b));
    // Complex roots, and divisions by zero of degenerate equations, are NaN or infinite: not finite.
    let valid = discriminant >= 0.0;
    [q / a, c / q].into_iter().filter(move |x| valid && x.is_finite())
}

#[inline(always)]
pub(crate) fn copysign(magnitude: f64, sign: f64) -> f64 {
    if sign.is_sign_negative() { -magnitude } else { magnitude }
}
