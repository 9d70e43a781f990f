//! `estimate_batch`: many objects, ragged as NaN rows, several models, the GIL released.

use std::sync::Arc;

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use super::arrays::{flat, require_shape, rows};
use super::classes::{ModelData, PyModel, PyView};
use super::input_error;
use super::options::PyOptions;
use super::outputs::{Answer, Outputs, Rows};
use super::threads::pool;
use crate::error::NoPose;
use crate::estimate::batch::OBJECTS_PER_TASK;
use crate::estimate::estimator::Estimator;
use crate::estimate::options::Solver;
use crate::estimate::workspace::{GrowingWorkspace, Workspace};
use crate::geometry::bbox::Bbox;
use crate::geometry::view::View;
use crate::model::observation::Observation;

/// Objects between two looks for an interrupt; also bounds the memory beyond inputs and outputs.
const OBJECTS_PER_BLOCK: usize = 2048;

/// Everything the objects of a call share.
struct Inputs<'a> {
    view: View,
    keypoints_2d: &'a [[f64; 2]],
    keypoints: usize,
    scores: Option<&'a [f64]>,
    bboxes: Option<&'a [[f64; 4]]>,
    thresholds: Option<&'a [f64]>,
    models: Vec<Arc<ModelData>>,
}

/// Poses of a batch; one dict of arrays.
#[pyfunction]
#[pyo3(signature = (view, keypoints_2d, keypoint_scores, bboxes, models, inlier_thresholds, options, threads))]
#[expect(clippy::too_many_arguments, reason = "one private call with everything a batch needs")]
pub(crate) fn estimate_batch<'py>(
    py: Python<'py>,
    view: &PyView,
    keypoints_2d: PyReadonlyArray3<'py, f64>,
    keypoint_scores: Option<PyReadonlyArray2<'py, f64>>,
    bboxes: Option<PyReadonlyArray2<'py, f64>>,
    models: &Bound<'py, PyList>,
    inlier_thresholds: Option<PyReadonlyArray1<'py, f64>>,
    options: &PyOptions,
    threads: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let &[objects, keypoints, _] = keypoints_2d.shape() else {
        return Err(input_error("keypoints_2d", "shape (N, P, 2)", &format!("{:?}", keypoints_2d.shape())));
    };
    let models: Vec<Arc<ModelData>> =
        models.iter().map(|m| Ok(Arc::clone(&m.cast::<PyModel>()?.get().0))).collect::<PyResult<_>>()?;
    if models.len() != objects && !(models.len() == 1 || objects == 0) {
        let expected = format!("one model, or one for each of {objects} objects");
        return Err(input_error("models", &expected, &models.len().to_string()));
    }
    if let Some(m) = models.iter().find(|m| m.keypoints() > keypoints) {
        let expected = format!("at least the model's {} keypoints a row", m.keypoints());
        return Err(input_error("keypoints_2d", &expected, &keypoints.to_string()));
    }
    if let Some(s) = &keypoint_scores {
        require_shape("keypoint_scores", &s.as_array(), &[objects, keypoints])?;
    }
    if let Some(b) = &bboxes {
        require_shape("bboxes", &b.as_array(), &[objects, 4])?;
    }
    if let Some(t) = &inlier_thresholds {
        require_shape("inlier_threshold", &t.as_array(), &[objects])?;
    }
    let inputs = Inputs {
        view: view.0,
        keypoints_2d: rows::<2, _>("keypoints_2d", &keypoints_2d)?,
        keypoints,
        scores: keypoint_scores.as_ref().map(|s| flat("keypoint_scores", s)).transpose()?,
        bboxes: bboxes.as_ref().map(|b| rows::<4, _>("bboxes", b)).transpose()?,
        thresholds: inlier_thresholds.as_ref().map(|t| flat("inlier_threshold", t)).transpose()?,
        models,
    };
    if options.0.solver == Solver::P1pHeight && view.0.height.is_none() {
        return Err(input_error("view", "a height, for solver \"p1p_height\"", "none"));
    }
    let estimator = Estimator::new(options.0)?;
    let mut outputs = Outputs::new(objects, keypoints, &inputs.models);
    // One thread is the caller's own: no pool, no hand-over.
    let pool = if threads == 1 || objects <= OBJECTS_PER_TASK { None } else { Some(pool(threads)?) };
    let (mut rest, mut workspace) = (outputs.rows(), GrowingWorkspace::new());
    while rest.objects() > 0 {
        py.check_signals()?;
        let count = OBJECTS_PER_BLOCK.min(rest.objects());
        let (rows, others) = rest.split_at(count);
        py.detach(|| match &pool {
            None => inputs.estimate(&estimator, &mut workspace, rows),
            Some(pool) => pool.install(|| inputs.estimate_parallel(&estimator, rows)),
        });
        rest = others;
    }
    outputs.into_dict(py)
}

impl Inputs<'_> {
    /// Answers of some objects into their rows.
    fn estimate(&self, estimator: &Estimator, workspace: &mut GrowingWorkspace, mut rows: Rows) {
        for k in 0..rows.objects() {
            let answer = self.estimate_one(estimator, rows.first + k, workspace, rows.residuals_of(k));
            rows.store(k, &answer);
        }
    }

    /// The same on the threads of the current pool.
    fn estimate_parallel(&self, estimator: &Estimator, rows: Rows) {
        let objects = rows.objects();
        if objects <= OBJECTS_PER_TASK {
            return self.estimate(estimator, &mut GrowingWorkspace::new(), rows);
        }
        let (left, right) = rows.split_at((objects / 2).next_multiple_of(OBJECTS_PER_TASK));
        rayon::join(|| self.estimate_parallel(estimator, left), || self.estimate_parallel(estimator, right));
    }

    fn estimate_one(
        &self,
        estimator: &Estimator,
        i: usize,
        workspace: &mut GrowingWorkspace,
        residuals: &mut [f64],
    ) -> Answer {
        residuals.fill(f64::NAN);
        let model = self.models[if self.models.len() == 1 { 0 } else { i }].shape_model();
        let count = model.keypoint_count();
        let row = i * self.keypoints;
        let keypoints = &self.keypoints_2d[row..row + count];
        let scores = self.scores.map(|s| &s[row..row + count]);
        let bbox = self.bboxes.map(|b| b[i]).filter(|b| !b.iter().all(|x| x.is_nan()));
        let observation =
            observe(keypoints, &model, scores, bbox, self.thresholds.map(|t| t[i])).ok_or(NoPose::InvalidInput)?;
        let estimate = estimator.estimate_indexed(&self.view, &observation, workspace, i as u64)?;
        residuals[..count].copy_from_slice(workspace.residuals());
        Ok(estimate)
    }
}

/// The observation of one object; `None` where one of its own numbers is not usable.
fn observe<'a>(
    keypoints: &'a [[f64; 2]],
    model: &'a crate::model::shape_model::ShapeModel<'a>,
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
