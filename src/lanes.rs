//! Four numbers side by side, for the compiler to put into vector registers.
//!
//! Every operation is the scalar one, lane by lane, and sums run per lane and are added in a fixed order: the result
//! is the same bits for every width of vector unit.

use core::ops::{Add, AddAssign, Div, Mul, Sub};

/// Points that a block holds.
pub(crate) const LANES: usize = 4;

/// One number per point of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Lanes(pub(crate) [f64; LANES]);

impl Lanes {
    #[inline(always)]
    pub(crate) const fn splat(x: f64) -> Self {
        Self([x; LANES])
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (self.0, other.0);
        Self([f(a0, b0), f(a1, b1), f(a2, b2), f(a3, b3)])
    }

    #[inline(always)]
    pub(crate) fn reciprocal(self) -> Self {
        Self::splat(1.0).zip(self, |one, x| one / x)
    }

    /// `self` where it is less than `other`, else `other`: also where `self` is not a number.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    /// `other` where it is less than `self`, else `self`.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { b } else { a })
    }

    /// One where `self` is at most `other`, else zero: also where it is not a number.
    #[inline(always)]
    pub(crate) fn at_most(self, other: Self) -> Self {
        self.zip(other, |a, b| if a <= b { 1.0 } else { 0.0 })
    }

    /// `self` where `condition` is positive, else `otherwise`.
    #[inline(always)]
    pub(crate) fn where_positive(self, condition: Self, otherwise: f64) -> Self {
        self.zip(condition, |a, c| if c > 0.0 { a } else { otherwise })
    }

    /// Sum over lanes in a fixed order.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        (a + b) + (c + d)
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Lanes {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl Mul<f64> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, x: f64) -> Self {
        self * Self::splat(x)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
