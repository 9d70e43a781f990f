//! Four numbers side by side, and what the hot loops may do with them.
//!
//! Every operation is the scalar one, lane by lane, and sums run per lane and are added in a fixed order: the result
//! is the same bits for every vector unit.

use core::ops::{Add, AddAssign, Div, Mul, Sub};

use crate::geometry::math::sqrt;

/// Points that a block holds.
pub(crate) const LANES: usize = 4;

/// One number per point of a block, in memory; as a [`Vector`], arithmetic without a vector unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(32))]
pub(crate) struct Lanes(pub(crate) [f64; LANES]);

/// A vector unit: what makes vectors.
pub(crate) trait Unit: Copy {
    /// Four numbers in its registers.
    type Vector: Vector;

    fn load(self, lanes: Lanes) -> Self::Vector;

    #[inline(always)]
    fn splat(self, x: f64) -> Self::Vector {
        self.load(Lanes([x; LANES]))
    }

    #[inline(always)]
    fn zero(self) -> Self::Vector {
        self.splat(0.0)
    }

    /// The lanes that have a bit, the first lane's the lowest, in front; the others are anything.
    fn packed(self, vector: Self::Vector, bits: u32) -> Self::Vector;
}

/// Of every set of lanes, their numbers in order, and then others.
pub(crate) const PACKED: [[u8; LANES]; 1 << LANES] = {
    let mut packed = [[0; LANES]; 1 << LANES];
    let mut bits = 0;
    while bits < packed.len() {
        let (mut lane, mut place) = (0, 0);
        while lane < LANES {
            if bits >> lane & 1 == 1 {
                packed[bits][place] = lane as u8;
                place += 1;
            }
            lane += 1;
        }
        bits += 1;
    }
    packed
};

/// Four numbers in registers.
pub(crate) trait Vector:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Mul<f64, Output = Self>
    + AddAssign
{
    fn lanes(self) -> Lanes;

    fn sqrt(self) -> Self;

    /// `self` where it is less than `other`, else `other`: also where `self` is not a number.
    fn min(self, other: Self) -> Self;

    /// `other` where it is larger than `self`, else `self`: also where `other` is not a number.
    fn max(self, other: Self) -> Self;

    /// One where `self` is at most `other`, else zero: also where it is not a number.
    fn at_most(self, other: Self) -> Self;

    /// `self` where `condition` is positive, else `otherwise`.
    fn where_positive(self, condition: Self, otherwise: Self) -> Self;

    /// One bit for every lane that is at least zero, the first lane's the lowest.
    fn bits_at_least_zero(self) -> u32;

    /// The last lane first.
    #[inline(always)]
    fn reversed(self, unit: impl Unit<Vector = Self>) -> Self {
        let [a, b, c, d] = self.lanes().0;
        unit.load(Lanes([d, c, b, a]))
    }

    /// The first lanes of four vectors, their second lanes, and so on.
    #[inline(always)]
    fn transposed(vectors: [Self; LANES], unit: impl Unit<Vector = Self>) -> [Self; LANES] {
        let [a, b, c, d] = vectors.map(|vector| vector.lanes().0);
        [0, 1, 2, 3].map(|lane| unit.load(Lanes([a[lane], b[lane], c[lane], d[lane]])))
    }

    /// Sum over lanes in a fixed order.
    #[inline(always)]
    fn sum(self) -> f64 {
        let [a, b, c, d] = self.lanes().0;
        (a + b) + (c + d)
    }

    /// The sums of four vectors.
    #[inline(always)]
    fn sums(vectors: [Self; LANES]) -> [f64; LANES] {
        let [a, b, c, d] = vectors;
        [a.sum(), b.sum(), c.sum(), d.sum()]
    }
}

/// No vector unit that is known of: the compiler does what it can.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

impl Unit for Portable {
    type Vector = Lanes;

    #[inline(always)]
    fn load(self, lanes: Lanes) -> Lanes {
        lanes
    }

    #[inline(always)]
    fn packed(self, vector: Lanes, bits: u32) -> Lanes {
        let from = PACKED[bits as usize % PACKED.len()];
        let lane = |place: usize| vector.0[from[place] as usize % LANES];
        Lanes([lane(0), lane(1), lane(2), lane(3)])
    }
}

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
}

impl Vector for Lanes {
    #[inline(always)]
    fn lanes(self) -> Lanes {
        self
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.zip(self, |x, _| sqrt(x))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { b } else { a })
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        self.zip(other, |a, b| if a <= b { 1.0 } else { 0.0 })
    }

    #[inline(always)]
    fn where_positive(self, condition: Self, otherwise: Self) -> Self {
        let choose = |l: usize| if condition.0[l] > 0.0 { self.0[l] } else { otherwise.0[l] };
        Self([choose(0), choose(1), choose(2), choose(3)])
    }

    #[inline(always)]
    fn bits_at_least_zero(self) -> u32 {
        let bit = |l: usize| u32::from(self.0[l] >= 0.0) << l;
        bit(0) | bit(1) | bit(2) | bit(3)
    }
}

/// Operators that act lane by lane.
macro_rules! lane_by_lane {
    ($($operator:ident $method:ident $sign:tt),*) => {$(
        impl $operator for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $sign b)
            }
        }
    )*};
}

lane_by_lane!(Add add +, Sub sub -, Mul mul *, Div div /);

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
