//! Four numbers in a 256-bit register of an x86 machine.
//!
//! AVX has no masks for vectors of this width, AVX-512 does; the compiler uses them, and its 32 registers, where the
//! loop is compiled for it.

use core::arch::x86_64::{__m256d, _CMP_GE_OQ, _CMP_GT_OQ, _CMP_LE_OQ};
use core::ops::{Add, AddAssign, Div, Mul, Sub};

use pulp::bytemuck::cast;
use pulp::core_arch::x86::{Avx, Avx2};

use crate::simd::lanes::{LANES, Lanes, PACKED, Unit, Vector};

/// A vector, and the proof that the machine can work with it.
#[derive(Clone, Copy)]
pub(crate) struct AvxVector(__m256d, Avx);

/// What a machine with these vectors has.
#[derive(Clone, Copy)]
pub(crate) struct AvxUnit {
    pub(crate) avx: Avx,
    pub(crate) avx2: Avx2,
}

impl Unit for AvxUnit {
    type Vector = AvxVector;

    #[inline(always)]
    fn load(self, lanes: Lanes) -> AvxVector {
        AvxVector(cast(lanes.0), self.avx)
    }

    #[inline(always)]
    fn splat(self, x: f64) -> AvxVector {
        AvxVector(self.avx._mm256_set1_pd(x), self.avx)
    }

    #[inline(always)]
    fn packed(self, vector: AvxVector, bits: u32) -> AvxVector {
        let halves = cast(HALVES[bits as usize % HALVES.len()]);
        AvxVector(cast(self.avx2._mm256_permutevar8x32_ps(cast(vector.0), halves)), self.avx)
    }
}

/// [`PACKED`] of the halves of numbers.
const HALVES: [[u32; 2 * LANES]; PACKED.len()] = {
    let mut halves = [[0; 2 * LANES]; PACKED.len()];
    let mut bits = 0;
    while bits < PACKED.len() {
        let mut half = 0;
        while half < 2 * LANES {
            halves[bits][half] = 2 * PACKED[bits][half / 2] as u32 + half as u32 % 2;
            half += 1;
        }
        bits += 1;
    }
    halves
};

impl Vector for AvxVector {
    #[inline(always)]
    fn lanes(self) -> Lanes {
        Lanes(cast(self.0))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.1._mm256_sqrt_pd(self.0), self.1)
    }

    // "If either source operand is NaN, the second operand is returned": a < b ? a : b.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.1._mm256_min_pd(self.0, other.0), self.1)
    }

    // The same for the larger one: b > a ? b : a.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.1._mm256_max_pd(other.0, self.0), self.1)
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        let (avx, one) = (self.1, self.1._mm256_set1_pd(1.0));
        Self(avx._mm256_and_pd(avx._mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0), one), avx)
    }

    #[inline(always)]
    fn where_positive(self, condition: Self, otherwise: Self) -> Self {
        let avx = self.1;
        let is_positive = avx._mm256_cmp_pd::<_CMP_GT_OQ>(condition.0, avx._mm256_setzero_pd());
        Self(avx._mm256_blendv_pd(otherwise.0, self.0, is_positive), avx)
    }

    #[inline(always)]
    fn transposed([x, y, z, w]: [Self; LANES], _: impl Unit<Vector = Self>) -> [Self; LANES] {
        let avx = x.1;
        // x0, y0, x2, y2; x1, y1, x3, y3; and the same of z and w
        let (even, odd) = (avx._mm256_unpacklo_pd(x.0, y.0), avx._mm256_unpackhi_pd(x.0, y.0));
        let (even_zw, odd_zw) = (avx._mm256_unpacklo_pd(z.0, w.0), avx._mm256_unpackhi_pd(z.0, w.0));
        [
            Self(avx._mm256_permute2f128_pd::<0x20>(even, even_zw), avx),
            Self(avx._mm256_permute2f128_pd::<0x20>(odd, odd_zw), avx),
            Self(avx._mm256_permute2f128_pd::<0x31>(even, even_zw), avx),
            Self(avx._mm256_permute2f128_pd::<0x31>(odd, odd_zw), avx),
        ]
    }

    #[inline(always)]
    fn reversed(self, _: impl Unit<Vector = Self>) -> Self {
        let avx = self.1;
        let halves = avx._mm256_permute2f128_pd::<0x01>(self.0, self.0);
        Self(avx._mm256_permute_pd::<0b0101>(halves), avx)
    }

    #[inline(always)]
    fn sums([x, y, z, w]: [Self; LANES]) -> [f64; LANES] {
        let avx = x.1;
        // x0 + x1, y0 + y1, x2 + x3, y2 + y3, and the same of z and w
        let (xy, zw) = (avx._mm256_hadd_pd(x.0, y.0), avx._mm256_hadd_pd(z.0, w.0));
        let low = avx._mm256_permute2f128_pd::<0x20>(xy, zw);
        let high = avx._mm256_permute2f128_pd::<0x31>(xy, zw);
        cast(avx._mm256_add_pd(low, high))
    }

    #[inline(always)]
    fn bits_at_least_zero(self) -> u32 {
        let (avx, zero) = (self.1, self.1._mm256_setzero_pd());
        avx._mm256_movemask_pd(avx._mm256_cmp_pd::<_CMP_GE_OQ>(self.0, zero)) as u32
    }
}

/// Operators that are one instruction.
macro_rules! instructions {
    ($($operator:ident $method:ident $instruction:ident),*) => {$(
        impl $operator for AvxVector {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.1.$instruction(self.0, other.0), self.1)
            }
        }
    )*};
}

instructions!(Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

impl Mul<f64> for AvxVector {
    type Output = Self;
    #[inline(always)]
    fn mul(self, x: f64) -> Self {
        self * Self(self.1._mm256_set1_pd(x), self.1)
    }
}

impl AddAssign for AvxVector {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
