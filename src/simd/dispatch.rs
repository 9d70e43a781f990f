//! Hot loops compiled for several vector units; the best the machine has is chosen at run time.
//!
//! The arithmetic is the same in all of them, operation by operation, so the results are the same bits.

#[cfg(all(feature = "std", target_arch = "x86_64"))]
use crate::simd::avx::AvxUnit;
use crate::simd::lanes::{Portable, Unit};

/// A loop over many numbers that may run on any vector unit. `run`, and everything it calls, is inlined always.
pub(crate) trait HotLoop {
    type Output;
    fn run<U: Unit>(self, unit: U) -> Self::Output;
}

/// The vector unit of this machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VectorUnit {
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    arch: pulp::x86::Arch,
    /// Tests compare the unit with none.
    #[cfg(all(test, feature = "std", target_arch = "aarch64"))]
    is_left_out: bool,
}

impl VectorUnit {
    /// Looks what there is.
    #[inline]
    pub(crate) fn detect() -> Self {
        Self {
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            arch: pulp::x86::Arch::new(),
            #[cfg(all(test, feature = "std", target_arch = "aarch64"))]
            is_left_out: false,
        }
    }

    /// What the hot loops run on.
    #[cfg(feature = "python")]
    pub(crate) fn name(self) -> &'static str {
        #[cfg(target_arch = "x86_64")]
        return match self.arch {
            pulp::x86::Arch::V4(_) => "avx512",
            pulp::x86::Arch::V3(_) => "avx2",
            _ => "baseline",
        };
        #[cfg(target_arch = "aarch64")]
        return "neon";
        #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
        "baseline"
    }

    /// Every unit of this machine, and none.
    #[cfg(all(test, feature = "std", target_arch = "x86_64"))]
    pub(crate) fn all() -> Vec<Self> {
        use pulp::x86::{Arch, V3, V4};
        let found = [V3::try_new().map(Arch::V3), V4::try_new().map(Arch::V4), Some(Arch::Scalar)];
        found.into_iter().flatten().map(|arch| Self { arch }).collect()
    }

    /// Every unit of this machine, and none.
    #[cfg(all(test, feature = "std", target_arch = "aarch64"))]
    pub(crate) fn all() -> Vec<Self> {
        [false, true].map(|is_left_out| Self { is_left_out }).to_vec()
    }

    /// Runs a loop on this unit.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    #[inline(always)]
    pub(crate) fn run<H: HotLoop>(self, hot_loop: H) -> H::Output {
        use pulp::x86::Arch;
        match self.arch {
            Arch::V4(v4) => v4.vectorize(
                #[inline(always)]
                || hot_loop.run(AvxUnit { avx: v4.avx, avx2: v4.avx2 }),
            ),
            Arch::V3(v3) => v3.vectorize(
                #[inline(always)]
                || hot_loop.run(AvxUnit { avx: v3.avx, avx2: v3.avx2 }),
            ),
            _ => hot_loop.run(Portable),
        }
    }

    /// Runs a loop on this unit: every machine of 64 bits has it, so the compiler answers the question.
    #[cfg(all(feature = "std", target_arch = "aarch64"))]
    #[inline(always)]
    pub(crate) fn run<H: HotLoop>(self, hot_loop: H) -> H::Output {
        #[cfg(test)]
        if self.is_left_out {
            return hot_loop.run(Portable);
        }
        match pulp::core_arch::aarch64::Neon::try_new() {
            Some(neon) => hot_loop.run(neon),
            None => hot_loop.run(Portable),
        }
    }

    /// Runs a loop; without the standard library the compiler does what it can.
    #[cfg(not(all(feature = "std", any(target_arch = "x86_64", target_arch = "aarch64"))))]
    #[inline(always)]
    pub(crate) fn run<H: HotLoop>(self, hot_loop: H) -> H::Output {
        hot_loop.run(Portable)
    }
}
