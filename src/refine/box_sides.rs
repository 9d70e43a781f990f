//! The sides of a 2D box as residuals of a pose: where the projected 3D box ends against where the 2D box does.

use crate::geometry::math::square;
use crate::refine::box_extremes::Extreme;
use crate::refine::kernels::{Rho, Tukey};
use crate::simd::blocks::Block;
use crate::simd::lanes::{LANES, Lanes};

/// The sides as four points, one a lane: left, top, right, bottom. Left and right speak of a column, top and bottom of
/// a row.
pub(crate) struct Sides {
    /// Corners of the 3D box as model points, sides as pixels; an unknown side has weight zero.
    pub(crate) block: Block,
    /// Where the corners are in the image: of a column or a row.
    coordinates: [f64; LANES],
    /// Scale of their kernel, pixels squared, and their weight in units of the pixel cost.
    c2: f64,
    pub(crate) scale: f64,
}

pub(crate) const SPEAKS_OF_COLUMN: Lanes = Lanes([1.0, 0.0, 1.0, 0.0]);
pub(crate) const SPEAKS_OF_ROW: Lanes = Lanes([0.0, 1.0, 0.0, 1.0]);

impl Sides {
    /// From the extremes of the projected box and the sides of the 2D box relative to the principal point; NaN is a
    /// side that is not known.
    #[inline]
    pub(crate) fn new(extremes: &[Extreme; LANES], bbox: &[f64; LANES], c2: f64, scale: f64) -> Self {
        let mut block = Block::EMPTY;
        for side in 0..LANES {
            let corner = &extremes[side].corner;
            (block.x.0[side], block.y.0[side], block.z.0[side]) = (corner[0], corner[1], corner[2]);
            let known = !bbox[side].is_nan();
            let position = if known { bbox[side] } else { 0.0 };
            // The other coordinate has no weight.
            (block.u.0[side], block.v.0[side]) = (position, position);
            block.weight.0[side] = f64::from(u8::from(known));
        }
        Self { block, coordinates: extremes.map(|e| e.coordinate), c2, scale }
    }

    /// Pixels, projected minus observed.
    pub(crate) fn residuals(&self) -> [f64; LANES] {
        core::array::from_fn(|side| self.coordinates[side] - self.block.u.0[side])
    }

    /// How the cost of a side grows.
    #[inline(always)]
    pub(crate) fn kernel(&self) -> Tukey {
        Tukey::new(self.c2)
    }

    /// Their cost (pixels squared, halved).
    pub(crate) fn cost(&self) -> f64 {
        let kernel = self.kernel();
        let (residuals, known) = (self.residuals(), self.block.weight.0);
        (0..LANES).map(|side| self.scale * known[side] * kernel.evaluate(square(residuals[side])).0).sum()
    }
}
