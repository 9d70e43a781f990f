//! Hot loops compiled for several vector units; the widest the machine has is chosen at run time.
//!
//! The arithmetic is the same in all of them, operation by operation, so the results are the same bits.

/// The vector unit of this machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VectorUnit {
    #[cfg(feature = "std")]
    arch: pulp::Arch,
}

impl VectorUnit {
    /// Looks what there is.
    #[inline]
    pub(crate) fn detect() -> Self {
        Self {
            #[cfg(feature = "std")]
            arch: pulp::Arch::new(),
        }
    }

    /// Runs a loop, with everything inlined into it, on this unit.
    #[inline(always)]
    pub(crate) fn run<R>(self, hot_loop: impl FnOnce() -> R) -> R {
        #[cfg(feature = "std")]
        return self.arch.dispatch(hot_loop);
        #[cfg(not(feature = "std"))]
        return hot_loop();
    }
}
