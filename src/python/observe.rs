//! The objects of a call as observations: rows of arrays, ragged as NaN rows, several models.

use std::sync::Arc;

use super::classes::ModelData;
use super::outputs::Rows;
use crate::estimate::answers::Objects;
use crate::estimate::batch::Axes;
use crate::geometry::bbox::Bbox;
use crate::model::observation::{Observation, VIEWING_ANGLES};
use crate::model::shape_model::ShapeModel;

/// Everything the objects of a call share.
pub(super) struct Inputs<'a> {
    pub(super) keypoints_2d: &'a [[f64; 2]],
    pub(super) keypoints: usize,
    pub(super) scores: Option<&'a [f64]>,
    pub(super) bboxes: Option<&'a [[f64; 4]]>,
    pub(super) thresholds: Option<&'a [f64]>,
    pub(super) vehicle_probability: Option<&'a [f64]>,
    pub(super) viewing_angles: Option<&'a [[f64; VIEWING_ANGLES]]>,
    pub(super) models: &'a [Arc<ModelData>],
    pub(super) model_of: ModelOf<'a>,
}

/// Which of the models an object has.
#[derive(Clone, Copy)]
pub(super) enum ModelOf<'a> {
    /// All have the only one.
    Only,
    /// Each its own.
    Own,
    /// By numbers, which are all of models.
    Numbered(&'a [i64]),
}

impl<'a> ModelOf<'a> {
    pub(super) fn numbers(self) -> Option<&'a [i64]> {
        match self {
            Self::Only | Self::Own => None,
            Self::Numbered(numbers) => Some(numbers),
        }
    }
}

impl Inputs<'_> {
    pub(super) fn model(&self, i: usize) -> &ModelData {
        &self.models[match self.model_of {
            ModelOf::Only => 0,
            ModelOf::Own => i,
            ModelOf::Numbered(numbers) => numbers[i] as usize,
        }]
    }

    /// Keypoints and modes of an object's model.
    pub(super) fn size_of(&self, i: usize) -> (usize, usize) {
        (self.model(i).keypoints(), self.model(i).modes())
    }

    fn keypoints_of(&self, i: usize) -> &[[f64; 2]] {
        &self.keypoints_2d[i * self.keypoints..(i + 1) * self.keypoints]
    }

    /// Calls `f` with the observation of object `i` with these keypoints; `None` where one of its numbers is not usable.
    pub(super) fn with<R>(&self, i: usize, keypoints: &[[f64; 2]], f: impl FnOnce(&Observation) -> R) -> Option<R> {
        let model = self.model(i).shape_model();
        let count = model.keypoint_count();
        let scores = self.scores.map(|s| &s[i * self.keypoints..i * self.keypoints + count]);
        let bbox = self.bboxes.map(|b| b[i]).filter(|b| !b.iter().all(|x| x.is_nan()));
        let mut observation = observe(&keypoints[..count], &model, scores, bbox, self.thresholds.map(|t| t[i]))?;
        // NaN: a network did not say
        if let Some(probability) = self.vehicle_probability.map(|p| p[i]).filter(|p| !p.is_nan()) {
            observation = observation.with_vehicle_probability(probability).ok()?;
        }
        if let Some(angles) = self.viewing_angles.map(|p| &p[i]).filter(|p| !p[0].is_nan()) {
            observation = observation.with_viewing_angles(angles).ok()?;
        }
        Some(f(&observation))
    }
}

impl Objects<Rows<'_>> for Inputs<'_> {
    fn observe<R>(&self, i: usize, rows: &mut Rows, k: usize, f: impl FnOnce(&Observation) -> R) -> Option<R> {
        let bbox = self.bboxes.map_or([f64::NAN; 4], |bboxes| bboxes[i]);
        let keypoints = rows.keep(k, self.keypoints_of(i), bbox);
        self.with(i, keypoints, f)
    }
}

impl Objects<Axes<'_>> for Inputs<'_> {
    fn observe<R>(&self, i: usize, _: &mut Axes, _: usize, f: impl FnOnce(&Observation) -> R) -> Option<R> {
        self.with(i, self.keypoints_of(i), f)
    }
}

/// The observation of one object; `None` where one of its own numbers is not usable.
fn observe<'a>(
    keypoints: &'a [[f64; 2]],
    model: &'a ShapeModel<'a>,
    scores: Option<&'a [f64]>,
    bbox: Option<[f64; 4]>,
    threshold: Option<f64>,
) -> Option<Observation<'a>> {
    let mut observation = Observation::new(keypoints, model).ok()?;
    if let Some(scores) = scores {
        observation = observation.with_scores(scores).ok()?;
    }
    if let Some(sides) = bbox {
        observation = observation.with_bbox(Bbox::new(sides).ok()?);
    }
    if let Some(threshold) = threshold {
        observation = observation.with_inlier_threshold(threshold).ok()?;
    }
    Some(observation)
}
