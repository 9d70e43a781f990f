//! The visible keypoints of one object in blocks, with the shape of its model.
//!
//! Who asks for points says of which shape, who asks for residuals says at which pose and shape. What the blocks held
//! before shows in nothing but the time it takes.

use crate::geometry::camera::Camera;
use crate::geometry::math::square;
use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::refine::modes::{Modes, MovePoints, Row};
use crate::refine::normal::State;
use crate::simd::blocks::Block;
use crate::simd::dispatch::VectorUnit;
use crate::simd::projection::{Measured, Projection, activate_within};

/// The visible keypoints of one object.
pub(crate) struct Keypoints<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) camera: &'a Camera,
    pub(crate) model: &'a ShapeModel<'a>,
    /// Index in the model of every visible keypoint.
    pub(crate) visible: &'a [u32],
    /// Pixels and weights of all, model points of some shape.
    blocks: &'a mut [Block],
    modes: Modes<'a>,
    /// The shape that the blocks hold, where it is known.
    held: Option<[f64; MAX_MODES]>,
}

impl<'a> Keypoints<'a> {
    /// Keypoints whose blocks hold the mean shape.
    pub(crate) fn of_mean_shape(
        unit: VectorUnit,
        camera: &'a Camera,
        model: &'a ShapeModel<'a>,
        visible: &'a [u32],
        blocks: &'a mut [Block],
        room: &'a mut [Row],
    ) -> Self {
        let modes = Modes::new(model, visible, room);
        Self { unit, camera, model, visible, blocks, modes, held: Some([0.0; MAX_MODES]) }
    }

    /// The same keypoints for someone else to work with.
    pub(crate) fn lend(&mut self) -> Keypoints<'_> {
        Keypoints { blocks: &mut *self.blocks, held: self.held.take(), ..*self }
    }

    /// How they move with the shape.
    pub(crate) fn modes(&self) -> Modes<'a> {
        self.modes
    }

    /// The points of a shape.
    #[inline]
    pub(crate) fn of_shape(&mut self, coefficients: &[f64; MAX_MODES]) -> &[Block] {
        self.hold(coefficients);
        self.blocks
    }

    /// The points of a state's shape with their residuals at its pose.
    #[inline]
    pub(crate) fn measure(&mut self, state: &State) -> Measured<'_> {
        self.hold(&state.coefficients);
        Measured::new(self.unit, self.blocks, &Projection::new(self.camera, &state.pose))
    }

    /// Reprojection errors at a state, pixels, one per visible keypoint; infinite behind the camera.
    pub(crate) fn residuals(&mut self, state: &State, residuals: &mut [f64]) {
        let unit = self.unit;
        self.measure(state).residuals(unit, residuals);
    }

    /// Gives every point its own weight in the sums that follow, or none when it is further than `tau` pixels from a
    /// state.
    pub(crate) fn activate_within(&mut self, state: &State, tau: f64) {
        self.hold(&state.coefficients);
        activate_within(self.unit, self.blocks, &Projection::new(self.camera, &state.pose), square(tau));
    }

    /// Gives every point its own weight in the sums that follow.
    pub(crate) fn activate_all(&mut self) {
        for block in &mut *self.blocks {
            block.active = block.weight;
        }
    }

    /// Moves the model points to a shape unless they are there; a rigid model has one shape.
    #[inline]
    fn hold(&mut self, coefficients: &[f64; MAX_MODES]) {
        let modes = self.model.eigenvalues().len();
        if modes > 0 && self.held.is_none_or(|held| held[..modes] != coefficients[..modes]) {
            self.unit.run(MovePoints { blocks: self.blocks, modes: self.modes, coefficients });
            self.held = Some(*coefficients);
        }
    }
}
