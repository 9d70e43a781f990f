//! Hot loops over points laid out for vector units; the same bits on each of them.

#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx;
pub(crate) mod blocks;
pub(crate) mod dispatch;
pub(crate) mod lanes;
#[cfg(all(feature = "std", target_arch = "aarch64"))]
mod neon;
pub(crate) mod projection;
pub(crate) mod spread;
