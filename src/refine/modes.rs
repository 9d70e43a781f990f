//! Mean shape and modes of the visible keypoints, laid out as their blocks are.

use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::simd::blocks::Block;
use crate::simd::dispatch::HotLoop;
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};

/// Coordinates of four keypoints of the mean shape, or their displacements in a mode.
pub(crate) type Row = [Lanes; 3];

/// Rows that a block of a model with so many modes has: none where there is one shape.
pub(crate) fn rows_per_block(modes: usize) -> usize {
    if modes == 0 { 0 } else { 1 + modes }
}

/// The rows of every block: mean shape, then one mode after the other.
#[derive(Clone, Copy)]
pub(crate) struct Modes<'a> {
    model: &'a ShapeModel<'a>,
    /// Index in the model of every visible keypoint.
    visible: &'a [u32],
    /// Those of all blocks, or none: then they are laid out whenever they are needed.
    rows: &'a [Row],
}

impl<'a> Modes<'a> {
    /// Laid out once if there is room.
    pub(crate) fn new(model: &'a ShapeModel<'a>, visible: &'a [u32], room: &'a mut [Row]) -> Self {
        let height = rows_per_block(model.eigenvalues().len());
        let rows: &'a [Row] = match room.get_mut(..height * visible.len().div_ceil(LANES)) {
            Some(rows) if height > 0 => {
                lay_out(model, visible, rows);
                rows
            }
            _ => &[],
        };
        Self { model, visible, rows }
    }

    /// Whose they are.
    pub(crate) fn model(&self) -> &'a ShapeModel<'a> {
        self.model
    }

    /// How many modes there are.
    #[inline(always)]
    pub(crate) fn count(&self) -> usize {
        self.model.eigenvalues().len()
    }

    /// The modes of a block, in `made` where they are not laid out.
    #[inline(always)]
    pub(crate) fn of_block<'s>(&'s self, block: usize, made: &'s mut Option<Rows>) -> &'s [Row] {
        self.rows(block, made).split_first().map_or(&[], |(_, modes)| modes)
    }

    /// The same with the mean shape before them.
    #[inline(always)]
    fn rows<'s>(&'s self, block: usize, made: &'s mut Option<Rows>) -> &'s [Row] {
        let height = 1 + self.count();
        match self.rows.get(block * height..(block + 1) * height) {
            Some(rows) => rows,
            None => &made.insert(self.made(block))[..height],
        }
    }

    #[cold]
    #[inline(never)]
    fn made(&self, block: usize) -> Rows {
        let mut rows = [Row::default(); 1 + MAX_MODES];
        let visible = self.visible.get(block * LANES..).unwrap_or_default();
        lay_out(self.model, &visible[..visible.len().min(LANES)], &mut rows[..1 + self.count()]);
        rows
    }
}

/// Those of a block with most modes.
pub(crate) type Rows = [Row; 1 + MAX_MODES];

/// The rows of all blocks of some keypoints; lanes beyond the last keypoint repeat it.
#[inline(never)]
fn lay_out(model: &ShapeModel, visible: &[u32], rows: &mut [Row]) {
    let (modes, count) = (model.eigenvalues().len(), visible.len());
    for k in 0..1 + modes {
        let points = if k == 0 { model.mean() } else { model.mode(k - 1) };
        for lane in 0..count.next_multiple_of(LANES) {
            let [x, y, z] = points[visible[lane.min(count - 1)] as usize];
            let row = &mut rows[lane / LANES * (1 + modes) + k];
            (row[0].0[lane % LANES], row[1].0[lane % LANES], row[2].0[lane % LANES]) = (x, y, z);
        }
    }
}

/// Moves the model points of blocks to a shape: [`ShapeModel::keypoint`] of each. Lanes beyond the last keypoint repeat it.
pub(crate) struct MovePoints<'a> {
    pub(crate) blocks: &'a mut [Block],
    pub(crate) modes: Modes<'a>,
    pub(crate) coefficients: &'a [f64; MAX_MODES],
}

impl HotLoop for MovePoints<'_> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) {
        for (number, block) in self.blocks.iter_mut().enumerate() {
            let made = &mut None;
            let [mean, modes @ ..] = self.modes.rows(number, made) else { return };
            let [mut x, mut y, mut z] = load(unit, mean);
            for (row, &lambda) in modes.iter().zip(self.coefficients) {
                let moved = load(unit, row);
                x += moved[0] * lambda;
                y += moved[1] * lambda;
                z += moved[2] * lambda;
            }
            (block.x, block.y, block.z) = (x.lanes(), y.lanes(), z.lanes());
        }
    }
}

/// A row in registers.
#[inline(always)]
pub(crate) fn load<U: Unit>(unit: U, row: &Row) -> [U::Vector; 3] {
    [unit.load(row[0]), unit.load(row[1]), unit.load(row[2])]
}
