//! Four numbers in two 128-bit registers of an Arm machine.

use core::arch::aarch64::{float64x2_t, uint64x2_t};
use core::ops::{Add, AddAssign, Div, Mul, Sub};

use pulp::bytemuck::cast;
use pulp::core_arch::aarch64::Neon;

use crate::simd::lanes::{LANES, Lanes, PACKED, Unit, Vector};

/// The lower and the upper half of a vector, and the proof that the machine can work with them.
#[derive(Clone, Copy)]
pub(crate) struct NeonVector([float64x2_t; 2], Neon);

impl Unit for Neon {
    type Vector = NeonVector;

    #[inline(always)]
    fn load(self, lanes: Lanes) -> NeonVector {
        NeonVector(cast(lanes.0), self)
    }

    #[inline(always)]
    fn splat(self, x: f64) -> NeonVector {
        NeonVector([self.vdupq_n_f64(x); 2], self)
    }

    #[inline(always)]
    fn packed(self, vector: NeonVector, bits: u32) -> NeonVector {
        let lanes = vector.lanes().0;
        self.load(Lanes(PACKED[bits as usize % PACKED.len()].map(|lane| lanes[usize::from(lane) % LANES])))
    }
}

impl NeonVector {
    /// `this` where a comparison holds, else `other`.
    #[inline(always)]
    fn choose(self, holds: [uint64x2_t; 2], this: Self, other: Self) -> Self {
        let neon = self.1;
        let half = |k: usize| neon.vbslq_f64(holds[k], this.0[k], other.0[k]);
        Self([half(0), half(1)], neon)
    }

    #[inline(always)]
    fn is_less(self, other: Self) -> [uint64x2_t; 2] {
        let neon = self.1;
        [neon.vcltq_f64(self.0[0], other.0[0]), neon.vcltq_f64(self.0[1], other.0[1])]
    }
}

impl Vector for NeonVector {
    #[inline(always)]
    fn lanes(self) -> Lanes {
        Lanes(cast(self.0))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let neon = self.1;
        Self([neon.vsqrtq_f64(self.0[0]), neon.vsqrtq_f64(self.0[1])], neon)
    }

    // Not the instructions of these names: those return what is not a number.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.choose(self.is_less(other), self, other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.choose(self.is_less(other), other, self)
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        let neon = self.1;
        let holds = [neon.vcleq_f64(self.0[0], other.0[0]), neon.vcleq_f64(self.0[1], other.0[1])];
        self.choose(holds, neon.splat(1.0), neon.zero())
    }

    #[inline(always)]
    fn where_positive(self, condition: Self, otherwise: Self) -> Self {
        self.choose(self.1.zero().is_less(condition), self, otherwise)
    }

    #[inline(always)]
    fn sums([x, y, z, w]: [Self; LANES]) -> [f64; LANES] {
        let neon = x.1;
        // (x0 + x1) + (x2 + x3), (y0 + y1) + (y2 + y3)
        let two = |x: Self, y: Self| neon.vaddq_f64(neon.vpaddq_f64(x.0[0], y.0[0]), neon.vpaddq_f64(x.0[1], y.0[1]));
        cast([two(x, y), two(z, w)])
    }

    #[inline(always)]
    fn bits_at_least_zero(self) -> u32 {
        let (neon, zero) = (self.1, self.1.vdupq_n_f64(0.0));
        let [a, b, c, d]: [u64; LANES] = cast([neon.vcgeq_f64(self.0[0], zero), neon.vcgeq_f64(self.0[1], zero)]);
        (a & 1 | b & 2 | c & 4 | d & 8) as u32
    }
}

/// Operators that are one instruction for each half.
macro_rules! instructions {
    ($($operator:ident $method:ident $instruction:ident),*) => {$(
        impl $operator for NeonVector {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let neon = self.1;
                Self([neon.$instruction(self.0[0], other.0[0]), neon.$instruction(self.0[1], other.0[1])], neon)
            }
        }
    )*};
}

instructions!(Add add vaddq_f64, Sub sub vsubq_f64, Mul mul vmulq_f64, Div div vdivq_f64);

impl Mul<f64> for NeonVector {
    type Output = Self;
    #[inline(always)]
    fn mul(self, x: f64) -> Self {
        self * self.1.splat(x)
    }
}

impl AddAssign for NeonVector {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
