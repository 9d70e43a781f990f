//! Draws without replacement. The stream of an object depends on (seed, object index) only.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// The named generator of the whole project: xoshiro256++, seeded through SplitMix64.
#[derive(Clone, Debug)]
pub(crate) struct Stream(Xoshiro256PlusPlus);

impl Stream {
    /// The stream of one object (or of one synthetic trial).
    pub(crate) fn new(seed: u64, index: u64) -> Self {
        // The odd constant (2^64 / golden ratio) keeps neighbouring indices apart before SplitMix64 mixes them.
        Self(Xoshiro256PlusPlus::seed_from_u64(seed ^ index.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
    }

    /// 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// An integer below `bound`.
    #[inline]
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        // Multiply and shift: the bias is below 2^-32 for every bound that fits an image.
        ((u128::from(self.0.next_u64()) * bound as u128) >> 64) as usize
    }

    /// A number in [0, 1).
    #[cfg(feature = "synthetic")]
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// `SIZE` different indices below `count`, uniformly.
    pub(crate) fn combination<const SIZE: usize>(&mut self, count: usize) -> [usize; SIZE] {
        let mut sample = [0; SIZE];
        for k in 0..SIZE {
            sample[k] = loop {
                let candidate = self.below(count);
                if !sample[..k].contains(&candidate) {
                    break candidate;
                }
            };
        }
        sample
    }

    /// A random order of the indices in `order`.
    pub(crate) fn shuffle(&mut self, order: &mut [u32]) {
        for k in (1..order.len()).rev() {
            order.swap(k, self.below(k + 1));
        }
    }
}
