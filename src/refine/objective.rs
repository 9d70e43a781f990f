//! The cost of one object: keypoints under a robust kernel, and priors; with its normal equations.

use crate::geometry::math::square;
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::refine::box_sides::Sides;
use crate::refine::kernels::Kernel;
use crate::refine::normal::{Normal, State};
use crate::refine::normal_joint::LineariseJoint;
use crate::refine::normal_pose::{Cost, Linearise, Summands};
use crate::refine::priors::{PriorTerms, Priors};
use crate::search::noise::{Noise, NoiseModel};
use crate::simd::blocks::Block;
use crate::simd::dispatch::VectorUnit;
use crate::simd::lanes::LANES;
use crate::simd::projection::{Measure, Projection};

/// Everything a cost is made of, besides the state and the kernel.
pub(crate) struct Objective<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) view: &'a View,
    pub(crate) model: &'a ShapeModel<'a>,
    pub(crate) visible: &'a [u32],
    pub(crate) blocks: &'a mut [Block],
    pub(crate) priors: Priors,
    pub(crate) noise: NoiseModel,
}

impl Objective<'_> {
    /// Moves the model points to the shape of a state; a rigid model has one shape.
    pub(crate) fn set_shape(&mut self, coefficients: &[f64; MAX_MODES]) {
        if self.model.eigenvalues().is_empty() {
            return;
        }
        for (k, &i) in self.visible.iter().enumerate() {
            let [x, y, z] = self.model.keypoint(i as usize, coefficients);
            let (block, lane) = (&mut self.blocks[k / LANES], k % LANES);
            (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = (x, y, z);
        }
    }

    /// Normal equations and cost at a state. The blocks must hold the state's shape.
    pub(crate) fn linearise<const D: usize>(&self, state: &State, kernel: Kernel, normal: &mut Normal<D>) {
        let terms = self.prior_terms();
        let sides = terms.sides(state);
        if D == 6 {
            let summands = self.summands(state, sides.as_ref(), kernel);
            self.unit.run(Linearise { summands, normal });
        } else {
            let summands = self.summands(state, None, kernel);
            self.unit.run(LineariseJoint { summands, model: self.model, visible: self.visible, normal });
            if let Some(sides) = &sides {
                normal.cost += terms.add_sides(state, sides, normal);
            }
        }
        terms.add_tilt_and_shape(state, normal);
    }

    /// The cost of [`Objective::linearise`] alone.
    pub(crate) fn cost(&self, state: &State, kernel: Kernel) -> f64 {
        let terms = self.prior_terms();
        let sides = terms.sides(state);
        self.unit.run(Cost(self.summands(state, sides.as_ref(), kernel))) + terms.tilt_and_shape_cost(state)
    }

    fn summands<'s>(&'s self, state: &'s State, sides: Option<&'s Sides>, kernel: Kernel) -> Summands<'s> {
        Summands { blocks: self.blocks, sides, camera: &self.view.camera, pose: &state.pose, kernel }
    }

    fn prior_terms(&self) -> PriorTerms<'_> {
        PriorTerms { unit: self.unit, priors: &self.priors, view: self.view, model: self.model }
    }

    /// Cost of the priors alone (pixels squared, halved).
    pub(crate) fn prior_cost(&self, state: &State) -> f64 {
        self.prior_terms().cost(state)
    }

    /// Squared residuals into the blocks.
    pub(crate) fn measure(&mut self, pose: &Pose) {
        let projection = &Projection::new(&self.view.camera, pose);
        self.unit.run(Measure { blocks: self.blocks, projection });
    }

    /// Noise of the keypoints, given a pose; leaves the squared residuals in the blocks.
    pub(crate) fn estimate_noise(&mut self, pose: &Pose) -> Noise {
        self.measure(pose);
        self.noise.estimate(self.unit, self.blocks)
    }

    /// Squared residual and weight of every visible keypoint, after [`Objective::estimate_noise`].
    pub(crate) fn measured(&self) -> impl Iterator<Item = (f64, f64)> + Clone {
        let pairs = self.blocks.iter().flat_map(|block| (0..LANES).map(|l| (block.r2.0[l], block.weight.0[l])));
        pairs.take(self.visible.len())
    }

    /// Gives every point its own weight, or none when it is further than `tau` pixels from a pose.
    pub(crate) fn activate_within(&mut self, pose: &Pose, tau: f64) {
        self.measure(pose);
        let tau2 = square(tau);
        for block in &mut *self.blocks {
            for l in 0..LANES {
                block.active.0[l] = if block.r2.0[l] <= tau2 { block.weight.0[l] } else { 0.0 };
            }
        }
    }

    /// Gives every point its own weight.
    pub(crate) fn activate_all(&mut self) {
        for block in &mut *self.blocks {
            block.active = block.weight;
        }
    }
}
