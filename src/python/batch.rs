//! `estimate_batch`: many objects, ragged as NaN rows, several models, the GIL released.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::ThreadPool;

use super::arrays::{flat, require_shape, rows};
use super::classes::{ModelData, PyModel, PyView, to_matrix};
use super::input_error;
use super::options::PyOptions;
use super::outputs::Outputs;
use super::threads::pool;
use crate::estimate::batch::{Answers, Batch, OBJECTS_PER_TASK, Objects};
use crate::estimate::estimator::Estimator;
use crate::estimate::frame_tilt::FrameTilt;
use crate::estimate::workspace::GrowingWorkspace;
use crate::geometry::bbox::Bbox;
use crate::model::observation::{Observation, VIEWING_ANGLES};
use crate::model::shape_model::ShapeModel;

/// Time between two looks for an interrupt; an object takes microseconds, the slowest milliseconds.
const LOOK: Duration = Duration::from_millis(50);

/// Everything the objects of a call share.
struct Inputs<'a> {
    keypoints_2d: &'a [[f64; 2]],
    keypoints: usize,
    scores: Option<&'a [f64]>,
    bboxes: Option<&'a [[f64; 4]]>,
    thresholds: Option<&'a [f64]>,
    vehicle_probability: Option<&'a [f64]>,
    viewing_angles: Option<&'a [[f64; VIEWING_ANGLES]]>,
    models: Vec<Arc<ModelData>>,
}

/// Poses of a batch; one dict of arrays. With `frame_tilt_sigma` the frame's tilt is estimated first, from all objects,
/// and in the dict too.
#[pyfunction]
#[pyo3(signature = (view, keypoints_2d, keypoint_scores, bboxes, models, inlier_thresholds, options, threads,
                    frame_tilt_sigma=None, vehicle_probability=None, viewing_angle_probabilities=None))]
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
    frame_tilt_sigma: Option<f64>,
    vehicle_probability: Option<PyReadonlyArray1<'py, f64>>,
    viewing_angle_probabilities: Option<PyReadonlyArray2<'py, f64>>,
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
    if let Some(p) = &vehicle_probability {
        require_shape("vehicle_probability", &p.as_array(), &[objects])?;
    }
    if let Some(p) = &viewing_angle_probabilities {
        require_shape("viewing_angle_probabilities", &p.as_array(), &[objects, VIEWING_ANGLES])?;
    }
    let inputs = Inputs {
        keypoints_2d: rows::<2, _>("keypoints_2d", &keypoints_2d)?,
        keypoints,
        scores: keypoint_scores.as_ref().map(|s| flat("keypoint_scores", s)).transpose()?,
        bboxes: bboxes.as_ref().map(|b| rows::<4, _>("bboxes", b)).transpose()?,
        thresholds: inlier_thresholds.as_ref().map(|t| flat("inlier_threshold", t)).transpose()?,
        vehicle_probability: vehicle_probability.as_ref().map(|p| flat("vehicle_probability", p)).transpose()?,
        viewing_angles: viewing_angle_probabilities
            .as_ref()
            .map(|p| rows::<VIEWING_ANGLES, _>("viewing_angle_probabilities", p))
            .transpose()?,
        models,
    };
    let estimator = Estimator::new(options.0)?;
    // One thread is the caller's own: no pool, no hand-over.
    let pool = if threads == 1 || objects <= OBJECTS_PER_TASK { None } else { Some(pool(threads)?) };
    let mut outputs = Outputs::new(objects, keypoints, &inputs.models);
    let mut view = view.0;
    let dict = PyDict::new(py);
    if let Some(sigma) = frame_tilt_sigma {
        let frame = estimator.frame_tilt(&view, objects, sigma, |free, axes| {
            estimate_all(py, &free.batch(&view, &inputs)?, pool.as_deref(), axes)
        })?;
        view = frame.view;
        add_tilt(&dict, &frame)?;
    }
    estimate_all(py, &estimator.batch(&view, &inputs)?, pool.as_deref(), outputs.rows())?;
    outputs.add_to(&dict)?;
    Ok(dict)
}

/// All answers, with the GIL released but for looks for an interrupt.
fn estimate_all(
    py: Python<'_>,
    batch: &Batch<Inputs>,
    pool: Option<&ThreadPool>,
    answers: impl Answers,
) -> PyResult<()> {
    py.check_signals()?;
    py.detach(|| match pool {
        None => {
            let (mut last, mut found) = (Instant::now(), Ok(()));
            batch.on_this_thread(&mut GrowingWorkspace::new(), 0, answers, || {
                if last.elapsed() >= LOOK {
                    found = Python::attach(|py| py.check_signals());
                    last = Instant::now();
                }
                found.is_ok()
            });
            found
        }
        Some(pool) => on_pool(pool, |go_on| batch.on_threads(0, answers, go_on)),
    })
}

/// Work on the threads of a pool, which ask whether to go on while this one looks for an interrupt.
fn on_pool(pool: &ThreadPool, work: impl FnOnce(&(dyn Fn() -> bool + Sync)) + Send) -> PyResult<()> {
    let stopped = AtomicBool::new(false);
    let (at_work, ended) = channel::<()>();
    pool.in_place_scope(|scope| {
        scope.spawn(|_| {
            let _at_work = at_work; // let go of at the end, also by a panic
            work(&|| !stopped.load(Relaxed));
        });
        while ended.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
            if let Err(interrupt) = Python::attach(|py| py.check_signals()) {
                stopped.store(true, Relaxed);
                return Err(interrupt);
            }
        }
        Ok(())
    })
}

/// Pitch and roll of a frame's view, and their covariance.
fn add_tilt(dict: &Bound<'_, PyDict>, frame: &FrameTilt) -> PyResult<()> {
    dict.set_item("pitch", frame.view.tilt.pitch)?;
    dict.set_item("roll", frame.view.tilt.roll)?;
    // about the ground's z axis (roll) and x axis (pitch), in the order in which a view has them
    let c = frame.covariance;
    dict.set_item("tilt_covariance", to_matrix(dict.py(), &[[c[(1, 1)], c[(1, 0)]], [c[(0, 1)], c[(0, 0)]]])?)
}

impl Objects for Inputs<'_> {
    fn observe<R>(&self, i: usize, f: impl FnOnce(&Observation) -> R) -> Option<R> {
        let model = self.models[if self.models.len() == 1 { 0 } else { i }].shape_model();
        let count = model.keypoint_count();
        let row = i * self.keypoints;
        let keypoints = &self.keypoints_2d[row..row + count];
        let scores = self.scores.map(|s| &s[row..row + count]);
        let bbox = self.bboxes.map(|b| b[i]).filter(|b| !b.iter().all(|x| x.is_nan()));
        let mut observation = observe(keypoints, &model, scores, bbox, self.thresholds.map(|t| t[i]))?;
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
