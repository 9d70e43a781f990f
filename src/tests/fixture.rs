//! The parts of an [`Objective`], owned, so that a test can build one from plain values.

use crate::geometry::view::View;
use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::refine::kernels::Kernel;
use crate::refine::keypoints::Keypoints;
use crate::refine::normal::{Normal, State};
use crate::refine::objective::Objective;
use crate::refine::priors::Priors;
use crate::search::noise::NoiseModel;
use crate::simd::blocks::Block;
use crate::simd::dispatch::VectorUnit;
use crate::simd::lanes::LANES;

/// Nothing known besides the keypoints.
pub(super) const NO_PRIORS: Priors = Priors {
    noise_sigma: 1.0,
    tilt_sigma: f64::INFINITY,
    shape: false,
    bbox: [f64::NAN; 4],
    use_bbox: false,
    bbox_sigma: f64::INFINITY,
};

/// Keypoints of one object in blocks.
pub(super) struct Fixture {
    view: View,
    visible: Vec<u32>,
    blocks: Vec<Block>,
    pub(super) priors: Priors,
}

impl Fixture {
    /// Keypoints that are not NaN, each with its weight.
    pub(super) fn new(
        view: View,
        model: &ShapeModel,
        keypoints_2d: &[[f64; 2]],
        weight: impl Fn(usize) -> f64,
    ) -> Self {
        let seen = keypoints_2d.iter().enumerate().filter(|(_, pixel)| !pixel[0].is_nan());
        let visible: Vec<u32> = seen.map(|(i, _)| i as u32).collect();
        let mut blocks = vec![Block::EMPTY; visible.len().div_ceil(LANES)];
        for (k, &i) in visible.iter().enumerate() {
            let (i, block, lane) = (i as usize, &mut blocks[k / LANES], k % LANES);
            (block.u.0[lane], block.v.0[lane]) = view.camera.centred(keypoints_2d[i]).into();
            (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = model.keypoint(i, &[0.0; MAX_MODES]).into();
            (block.weight.0[lane], block.active.0[lane]) = (weight(i), weight(i));
        }
        Self { view, visible, blocks, priors: NO_PRIORS }
    }

    /// Once: the blocks hold the mean shape.
    pub(super) fn objective<'a>(&'a mut self, model: &'a ShapeModel<'a>) -> Objective<'a> {
        let (unit, camera) = (VectorUnit::detect(), &self.view.camera);
        let keypoints = Keypoints::of_mean_shape(unit, camera, model, &self.visible, &mut self.blocks, &mut []);
        Objective { view: &self.view, keypoints, priors: self.priors, noise: NoiseModel { guess: 2.0, area: 1e4 } }
    }
}

/// Normal equations at a state.
pub(super) fn linearised<const D: usize>(objective: &mut Objective, state: &State, kernel: Kernel) -> Normal<D> {
    let mut normal = Normal::ZERO;
    objective.linearise(state, kernel, &mut normal);
    normal
}

/// Random numbers between -1 and 1.
pub(super) struct Random(crate::search::sampler::Stream);

impl Random {
    pub(super) fn new(trial: u64) -> Self {
        Self(crate::search::sampler::Stream::new(7, trial))
    }

    pub(super) fn next(&mut self) -> f64 {
        const STEPS: usize = 1 << 40;
        2.0 * self.0.below(STEPS) as f64 / STEPS as f64 - 1.0
    }

    pub(super) fn numbers<const N: usize>(&mut self) -> [f64; N] {
        [(); N].map(|()| self.next())
    }
}
