//! `estimate_batch`: many objects, ragged as NaN rows, several models, the GIL released.

use std::sync::Arc;

use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::prelude::*;

use super::arrays::{flat, require_shape, rows};
use super::classes::{ModelData, PyModel, PyView};
use super::input_error;
use super::options::PyOptions;
use super::threads::pool;
use crate::batch::OBJECTS_PER_TASK;
use crate::camera::View;
use crate::error::NoPose;
use crate::estimate::{Estimate, Estimator};
use crate::object::Bbox;
use crate::observation::Observation;
use crate::options::Solver;
use crate::refine::MAX_STAGES;
use crate::workspace::{GrowingWorkspace, Workspace};

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
    let mut results = vec![Err(NoPose::TooFewKeypoints); objects.min(OBJECTS_PER_BLOCK)];
    for start in (0..objects).step_by(OBJECTS_PER_BLOCK) {
        py.check_signals()?;
        let results = &mut results[..OBJECTS_PER_BLOCK.min(objects - start)];
        py.detach(|| match &pool {
            None => {
                let residuals = outputs.residuals_of(start, results.len());
                inputs.estimate(&estimator, &mut GrowingWorkspace::new(), start, results, residuals);
                outputs.store(start, results);
            }
            Some(pool) => pool.install(|| {
                inputs.estimate_parallel(&estimator, start, results, outputs.residuals_of(start, results.len()));
                outputs.store_parallel(start, results);
            }),
        });
    }
    outputs.into_dict(py)
}

/// A pose, or why there is none.
type Answer = Result<Estimate, NoPose>;

impl Inputs<'_> {
    /// Answers and rows of residuals of the objects from `start` on.
    fn estimate(
        &self,
        estimator: &Estimator,
        workspace: &mut GrowingWorkspace,
        start: usize,
        results: &mut [Answer],
        residuals: &mut [f64],
    ) {
        for (k, result) in results.iter_mut().enumerate() {
            let row = &mut residuals[k * self.keypoints..(k + 1) * self.keypoints];
            *result = self.estimate_one(estimator, start + k, workspace, row);
        }
    }

    /// The same on the threads of the current pool.
    fn estimate_parallel(&self, estimator: &Estimator, start: usize, results: &mut [Answer], residuals: &mut [f64]) {
        let row = self.keypoints;
        if row == 0 {
            return self.estimate(estimator, &mut GrowingWorkspace::new(), start, results, residuals);
        }
        results
            .par_chunks_mut(OBJECTS_PER_TASK)
            .zip(residuals.par_chunks_mut(OBJECTS_PER_TASK * row))
            .enumerate()
            .for_each_init(GrowingWorkspace::new, |workspace, (k, (results, residuals))| {
                self.estimate(estimator, workspace, start + k * OBJECTS_PER_TASK, results, residuals);
            });
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
    model: &'a crate::object::ShapeModel<'a>,
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

/// One output array of numbers: its name, its shape for one object, and how an estimate fills it.
struct Field<T> {
    name: &'static str,
    shape: fn(modes: usize) -> Vec<usize>,
    write: fn(&Estimate, &mut [T]),
}

const NUMBERS: [Field<f64>; 14] = [
    Field { name: "R", shape: |_| vec![3, 3], write: |e, out| out.copy_from_slice(e.pose.r.transpose().as_slice()) },
    Field { name: "t", shape: |_| vec![3], write: |e, out| out.copy_from_slice(e.pose.t.as_slice()) },
    Field { name: "yaw", shape: |_| vec![], write: |e, out| out[0] = e.yaw },
    Field { name: "reprojection_rmse", shape: |_| vec![], write: |e, out| out[0] = e.reprojection_rmse },
    Field { name: "score", shape: |_| vec![], write: |e, out| out[0] = e.score },
    Field { name: "inlier_threshold", shape: |_| vec![], write: |e, out| out[0] = e.inlier_threshold },
    Field { name: "noise_sigma", shape: |_| vec![], write: |e, out| out[0] = e.noise_sigma },
    Field { name: "confidence", shape: |_| vec![], write: |e, out| out[0] = e.ransac.confidence },
    Field { name: "log10_nfa", shape: |_| vec![], write: |e, out| out[0] = e.log10_nfa },
    Field { name: "ambiguity", shape: |_| vec![], write: |e, out| out[0] = e.ambiguity },
    Field {
        name: "covariance",
        shape: |_| vec![6, 6],
        write: |e, out| {
            if let Some(covariance) = &e.covariance {
                out.copy_from_slice(covariance.as_slice());
            }
        },
    },
    Field {
        name: "shape_coefficients",
        shape: |modes| vec![modes],
        write: |e, out| out.copy_from_slice(&e.shape_coefficients[..out.len()]),
    },
    Field { name: "shape_covariance", shape: |modes| vec![modes, modes], write: write_shape_covariance },
    Field {
        name: "stage_costs",
        shape: |_| vec![MAX_STAGES],
        write: |e, out| out.copy_from_slice(&e.stages.map(|s| s.cost)),
    },
];

const COUNTS: [Field<i64>; 4] = [
    Field { name: "inlier_count", shape: |_| vec![], write: |e, out| out[0] = e.inlier_count as i64 },
    Field { name: "iterations", shape: |_| vec![], write: |e, out| out[0] = e.ransac.iterations as i64 },
    Field { name: "hypotheses", shape: |_| vec![], write: |e, out| out[0] = e.ransac.hypotheses as i64 },
    Field {
        name: "stage_iterations",
        shape: |_| vec![MAX_STAGES],
        write: |e, out| out.copy_from_slice(&e.stages.map(|s| s.iterations as i64)),
    },
];

fn write_shape_covariance(estimate: &Estimate, out: &mut [f64]) {
    let modes = out.len().isqrt();
    if let Some(covariance) = &estimate.shape_covariance {
        for (k, value) in out.iter_mut().enumerate() {
            *value = covariance[(k / modes, k % modes)];
        }
    }
}

/// An array of results in the making.
struct Column<T: 'static> {
    field: &'static Field<T>,
    shape: Vec<usize>,
    size: usize,
    values: Vec<T>,
}

impl<T: Copy + numpy::Element> Column<T> {
    fn all(fields: &'static [Field<T>], objects: usize, modes: usize, empty: T) -> Vec<Self> {
        let column = |field: &'static Field<T>| {
            let shape = (field.shape)(modes);
            let size = shape.iter().product();
            Self { field, shape: [vec![objects], shape].concat(), size, values: vec![empty; objects * size] }
        };
        fields.iter().map(column).collect()
    }

    fn store(&mut self, start: usize, results: &[Answer]) {
        for (i, result) in (start..).zip(results) {
            if let Ok(estimate) = result {
                (self.field.write)(estimate, &mut self.values[i * self.size..(i + 1) * self.size]);
            }
        }
    }

    fn add_to(self, dict: &Bound<'_, PyDict>) -> PyResult<()> {
        dict.set_item(self.field.name, self.values.into_pyarray(dict.py()).reshape(self.shape)?)
    }
}

/// Arrays of results; NaN until an object has an answer.
struct Outputs {
    objects: usize,
    keypoints: usize,
    status: Vec<u8>,
    stop_reason: Vec<u8>,
    solver: Vec<u8>,
    inlier_mask: Vec<bool>,
    residuals: Vec<f64>,
    numbers: Vec<Column<f64>>,
    counts: Vec<Column<i64>>,
}

impl Outputs {
    fn new(objects: usize, keypoints: usize, models: &[Arc<ModelData>]) -> Self {
        let modes = models.iter().map(|m| m.modes()).max().unwrap_or(0);
        Self {
            objects,
            keypoints,
            status: vec![0; objects],
            stop_reason: vec![0; objects],
            solver: vec![0; objects],
            inlier_mask: vec![false; objects * keypoints],
            residuals: vec![f64::NAN; objects * keypoints],
            numbers: Column::all(&NUMBERS, objects, modes, f64::NAN),
            counts: Column::all(&COUNTS, objects, modes, 0),
        }
    }

    /// Rows of residuals of `count` objects from `start` on.
    fn residuals_of(&mut self, start: usize, count: usize) -> &mut [f64] {
        &mut self.residuals[start * self.keypoints..(start + count) * self.keypoints]
    }

    /// Answers of the objects from `start` on into all arrays.
    fn store(&mut self, start: usize, results: &[Answer]) {
        self.store_states(start, results);
        self.numbers.iter_mut().for_each(|column| column.store(start, results));
        self.counts.iter_mut().for_each(|column| column.store(start, results));
    }

    /// The same, one array a task.
    fn store_parallel(&mut self, start: usize, results: &[Answer]) {
        self.store_states(start, results);
        self.numbers.par_iter_mut().for_each(|column| column.store(start, results));
        self.counts.par_iter_mut().for_each(|column| column.store(start, results));
    }

    fn store_states(&mut self, start: usize, results: &[Answer]) {
        for (i, result) in (start..).zip(results) {
            match result {
                Err(reason) => self.status[i] = *reason as u8,
                Ok(estimate) => {
                    let row = i * self.keypoints..(i + 1) * self.keypoints;
                    for (mask, &residual) in self.inlier_mask[row.clone()].iter_mut().zip(&self.residuals[row]) {
                        *mask = residual <= estimate.inlier_threshold;
                    }
                    self.stop_reason[i] = estimate.ransac.stop_reason as u8;
                    self.solver[i] = estimate.solver as u8;
                }
            }
        }
    }

    fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let dict = PyDict::new(py);
        let per_keypoint = [self.objects, self.keypoints];
        for (name, values) in [("status", self.status), ("stop_reason", self.stop_reason), ("solver", self.solver)] {
            dict.set_item(name, values.into_pyarray(py))?;
        }
        self.numbers.into_iter().try_for_each(|column| column.add_to(&dict))?;
        self.counts.into_iter().try_for_each(|column| column.add_to(&dict))?;
        dict.set_item("inlier_mask", self.inlier_mask.into_pyarray(py).reshape(per_keypoint)?)?;
        dict.set_item("residuals", self.residuals.into_pyarray(py).reshape(per_keypoint)?)?;
        Ok(dict)
    }
}
