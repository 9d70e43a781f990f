//! What follows from an object and its answer, computed again where many answers are kept: most of what an answer
//! consists of, in an eighth of the time that it took to find.

use crate::error::NoPose;
use crate::estimate::attempt::options_that_found;
use crate::estimate::describe::store_residuals;
use crate::estimate::estimator::{Estimator, without_lens};
use crate::estimate::object::{Memory, Object};
use crate::estimate::options::Options;
use crate::estimate::refine::objective;
use crate::estimate::workspace::Buffers;
use crate::geometry::view::View;
use crate::model::observation::Observation;
use crate::refine::covariance::{Covariances, covariance};
use crate::refine::normal::State;

/// An answer, as far as the rest follows from it.
pub(crate) struct Found {
    pub(crate) state: State,
    pub(crate) noise_sigma: f64,
    /// Whether the solver of three keypoints found it.
    pub(crate) by_three_keypoints: bool,
}

impl Estimator {
    /// The covariances of an answer where they are asked for, and its residuals in the buffers: the bits of what
    /// [`Estimator::estimate_checked`] said of this object. Through a wide lens an answer does not say enough.
    ///
    /// # Errors
    /// None, of an object that has an answer.
    pub(crate) fn again(
        &self,
        view: &View,
        observation: &Observation,
        found: &Found,
        mut buffers: Buffers,
    ) -> Result<Option<Covariances>, NoPose> {
        let options = options_that_found(self.options(), found.by_three_keypoints);
        if view.camera.lens.is_none() {
            return again(view, observation, &options, found, buffers);
        }
        let pixels = core::mem::take(&mut buffers.pixels);
        let (view, bbox) = without_lens(view, observation, pixels);
        again(&view, &observation.seen_ideally(pixels, bbox), &options, found, buffers)
    }
}

fn again(
    view: &View,
    observation: &Observation,
    options: &Options,
    found: &Found,
    buffers: Buffers,
) -> Result<Option<Covariances>, NoPose> {
    let (object, mut memory) = Object::gather(view, observation, options, 0, buffers)?;
    let Memory { keypoints, residuals, .. } = &mut memory;
    let visible = keypoints.visible;
    store_residuals(keypoints.measure(&found.state), visible, object.inlier_threshold, residuals);
    if !options.covariance {
        return Ok(None);
    }
    let errors = options.shared_errors(object.size());
    let mut objective = objective(&object, keypoints.lend(), found.noise_sigma);
    covariance(&mut objective, &found.state, object.inlier_threshold, &errors).map(Some).ok_or(NoPose::Degenerate)
}
