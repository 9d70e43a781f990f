//! How far points are spread.

use crate::simd::blocks::Block;
use crate::simd::dispatch::HotLoop;
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};

/// The point that is furthest from the first one: its place and its squared distance.
pub(crate) struct Furthest<'a, P> {
    pub(crate) blocks: &'a [Block],
    /// Where the points of a block are.
    pub(crate) position: P,
}

const COUNT: Lanes = Lanes([0.0, 1.0, 2.0, 3.0]);

impl<P: Fn(&Block) -> [Lanes; 3]> HotLoop for Furthest<'_, P> {
    type Output = (usize, f64);

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> (usize, f64) {
        let Some(block) = self.blocks.first() else { return (0, 0.0) };
        let first = (self.position)(block).map(|numbers| numbers.0[0]);
        let (mut most, mut places) = (unit.zero(), unit.zero());
        for (k, block) in self.blocks.iter().enumerate() {
            let [x, y, z] = (self.position)(block);
            let (x, y, z) = (
                unit.load(x) - unit.splat(first[0]),
                unit.load(y) - unit.splat(first[1]),
                unit.load(z) - unit.splat(first[2]),
            );
            let squared = x * x + y * y + z * z;
            let here = unit.load(COUNT) + unit.splat((LANES * k) as f64);
            places = here.where_positive(squared - most, places);
            most = most.max(squared);
        }
        let (most, places) = (most.lanes().0, places.lanes().0);
        let furthest = (1..LANES).fold(0, |best, lane| if most[lane] > most[best] { lane } else { best });
        (places[furthest] as usize, most[furthest])
    }
}
