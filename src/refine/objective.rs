//! The cost of one object: keypoints under a robust kernel, and priors; with its normal equations.

use crate::geometry::math::square;
use crate::geometry::view::View;
use crate::model::shape_model::MAX_MODES;
use crate::refine::box_sides::Sides;
use crate::refine::kernels::Kernel;
use crate::refine::keypoints::Keypoints;
use crate::refine::modes::Modes;
use crate::refine::normal::{Normal, State};
use crate::refine::normal_joint::{LineariseJoint, padded_pairs};
use crate::refine::normal_pose::{Cost, Linearise, Summands};
use crate::refine::priors::{PriorTerms, Priors};
use crate::search::noise::{Noise, NoiseModel};
use crate::search::score::{Scoring, cost};
use crate::simd::blocks::Block;
use crate::simd::dispatch::VectorUnit;
use crate::simd::projection::Projection;

/// Everything a cost is made of, besides the state and the kernel.
pub(crate) struct Objective<'a> {
    pub(crate) view: &'a View,
    pub(crate) keypoints: Keypoints<'a>,
    pub(crate) priors: Priors,
    pub(crate) noise: NoiseModel,
}

impl Objective<'_> {
    /// Normal equations and cost at a state, over the points that are active.
    pub(crate) fn linearise<const D: usize>(&mut self, state: &State, kernel: Kernel, normal: &mut Normal<D>) {
        let (unit, modes, view) = (self.keypoints.unit, self.keypoints.modes(), self.view);
        let (blocks, terms) = self.at(state);
        let sides = terms.sides(state);
        add_up(unit, summands(view, blocks, state, sides.as_ref(), kernel), modes, state, normal);
        terms.add_tilt_and_shape(state, normal);
    }

    /// [`Objective::linearise`] of the keypoints alone, with their squared residuals.
    #[inline(never)]
    pub(crate) fn linearise_keypoints<const D: usize>(&mut self, state: &State) -> Normal<D> {
        let mut normal = Normal::ZERO;
        let (unit, modes, view) = (self.keypoints.unit, self.keypoints.modes(), self.view);
        let (blocks, _) = self.at(state);
        add_up(unit, summands(view, blocks, state, None, Kernel::LeastSquares), modes, state, &mut normal);
        normal
    }

    /// The cost of [`Objective::linearise`] alone.
    pub(crate) fn cost(&mut self, state: &State, kernel: Kernel) -> f64 {
        let (unit, view) = (self.keypoints.unit, self.view);
        let (blocks, terms) = self.at(state);
        let sides = terms.sides(state);
        unit.run(Cost(summands(view, blocks, state, sides.as_ref(), kernel))) + terms.tilt_and_shape_cost(state)
    }

    /// Truncated squared error of all keypoints, priors included (pixels squared, halved), or infinity where the
    /// keypoints alone cost `bound`.
    pub(crate) fn truncated_cost(&mut self, state: &State, threshold: f64, bound: f64) -> f64 {
        let unit = self.keypoints.unit;
        let projection = Projection::new(self.keypoints.camera, &state.pose);
        let tau2 = square(threshold);
        let scale = 0.5 * tau2;
        let (blocks, terms) = self.at(state);
        let points = cost(unit, blocks, &projection, Scoring::Msac, tau2, bound / scale);
        if points.is_finite() { scale * points + terms.cost(state) } else { f64::INFINITY }
    }

    /// Noise of the keypoints, given a state.
    pub(crate) fn estimate_noise(&mut self, state: &State) -> Noise {
        self.noise.estimate(self.keypoints.unit, self.keypoints.measure(state))
    }

    /// The points of a state's shape, and the priors.
    #[inline]
    fn at(&mut self, state: &State) -> (&[Block], PriorTerms<'_>) {
        let (unit, model) = (self.keypoints.unit, self.keypoints.model);
        let terms = PriorTerms { unit, priors: &self.priors, view: self.view, model };
        (self.keypoints.of_shape(&state.coefficients), terms)
    }
}

#[inline]
fn summands<'s>(
    view: &'s View,
    blocks: &'s [Block],
    state: &'s State,
    sides: Option<&'s Sides>,
    kernel: Kernel,
) -> Summands<'s> {
    Summands { blocks, sides, camera: &view.camera, pose: &state.pose, kernel }
}

/// Normal equations and cost of summands.
#[inline(always)]
fn add_up<const D: usize>(unit: VectorUnit, summands: Summands, modes: Modes, state: &State, normal: &mut Normal<D>) {
    if D == 6 {
        unit.run(Linearise { summands, normal });
    } else {
        let model = modes.model();
        let (bbox_3d, bbox_basis) = (model.bbox_3d_of(&state.coefficients), model.bbox_basis());
        if D == 11 {
            unit.run(LineariseJoint::<D, 5, { padded_pairs(5) }> { summands, modes, bbox_3d, bbox_basis, normal });
        } else {
            unit.run(LineariseJoint::<D, MAX_MODES, { padded_pairs(MAX_MODES) }> {
                summands,
                modes,
                bbox_3d,
                bbox_basis,
                normal,
            });
        }
    }
}
