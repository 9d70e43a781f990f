//! `solve_frame`: the poses of a frame's objects together.

use nalgebra::Matrix3;
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::arrays::{fixed, flat, require_shape, rows};
use super::classes::{PyView, to_matrix};
use super::input_error;
use crate::error::InputError;
use crate::estimate::camera_state::{CAMERA_NUMBERS, CameraState};
use crate::estimate::frame::{Frame, solve_frame as solve};
use crate::estimate::frame_answer::FrameAnswer;
use crate::estimate::frame_object::FrameObject;
use crate::estimate::frame_priors::{FramePriors, MAX_CLASSES, ScalePrior};
use crate::geometry::camera::Camera;
use crate::geometry::pose::Pose;
use crate::geometry::view::{Tilt, View};
use crate::refine::covariance::PoseCovariance;

/// The standard deviations of `FramePriors` in order, and (mean, standard deviation of it, of a vehicle) of each class.
pub(crate) const SIGMAS: [&str; 6] = ["pitch_sigma", "roll_sigma", "height_sigma", "roughness", "slope", "curvature"];

/// What a `CameraState` carries: its mean, and the rows of its covariance.
type Carried<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>);

/// A frame's tilt, height and sizes, and its objects' poses, in one dict of arrays; with what is known of the camera, that
/// after the frame too.
#[pyfunction]
#[pyo3(signature = (view, sigmas, scales, classes, bottom_centres, rotations, translations, covariances, carried=None))]
#[expect(clippy::too_many_arguments, reason = "one private call with everything a frame needs")]
pub(crate) fn solve_frame<'py>(
    py: Python<'py>,
    view: &PyView,
    sigmas: [f64; 6],
    scales: PyReadonlyArray2<'py, f64>,
    classes: Vec<usize>,
    bottom_centres: PyReadonlyArray2<'py, f64>,
    rotations: PyReadonlyArray3<'py, f64>,
    translations: PyReadonlyArray2<'py, f64>,
    covariances: PyReadonlyArray3<'py, f64>,
    carried: Option<Carried<'py>>,
) -> PyResult<Bound<'py, PyDict>> {
    let count = classes.len();
    require_shape("R", &rotations.as_array(), &[count, 3, 3])?;
    require_shape("covariance", &covariances.as_array(), &[count, 6, 6])?;
    if translations.shape() != [count, 3] || bottom_centres.shape() != [count, 3] {
        return Err(input_error("t", &format!("shape ({count}, 3)"), &format!("{:?}", translations.shape())));
    }
    let priors = priors(sigmas, rows::<3, _>("scales", &scales)?)?;
    let places = (rows::<3, _>("t", &translations)?, rows::<3, _>("bottom_centres", &bottom_centres)?);
    let (rotations, covariances) = (flat("R", &rotations)?, flat("covariance", &covariances)?);
    let object = |k: usize| {
        let r = Matrix3::from_row_slice(&rotations[9 * k..9 * (k + 1)]);
        let pose = Pose { r, t: places.0[k].into() };
        let covariance = PoseCovariance::from_row_slice(&covariances[36 * k..36 * (k + 1)]);
        FrameObject::new(pose, covariance, places.1[k], classes[k])
    };
    let objects = (0..count).map(object).collect::<Result<Vec<_>, InputError>>()?;
    let mut answers = vec![FrameAnswer::default(); count];
    let dict = PyDict::new(py);
    let frame = match carried {
        None => solve(&view.0, &priors, &objects, &mut answers)?,
        Some(carried) => {
            let mut state = state(view, priors, &carried)?;
            let frame = state.solve(&objects, &mut answers)?;
            add_state(&dict, &state)?;
            frame
        }
    };
    add_frame(&dict, &frame)?;
    add_answers(&dict, &answers, &frame)?;
    Ok(dict)
}

/// What is known of a camera at first, or with what was carried, with another drive its tilt unknown again.
#[pyfunction]
#[pyo3(signature = (view, sigmas, scales, carried=None, another_drive=true))]
pub(crate) fn camera_state<'py>(
    py: Python<'py>,
    view: &PyView,
    sigmas: [f64; 6],
    scales: PyReadonlyArray2<'py, f64>,
    carried: Option<Carried<'py>>,
    another_drive: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let priors = priors(sigmas, rows::<3, _>("scales", &scales)?)?;
    let state = match carried {
        None => CameraState::new(&view.0, priors)?,
        Some(carried) => {
            let mut state = state(view, priors, &carried)?;
            if another_drive {
                state.start_drive();
            }
            state
        }
    };
    let dict = PyDict::new(py);
    add_state(&dict, &state)?;
    Ok(dict)
}

fn state(view: &PyView, priors: FramePriors, (mean, covariance): &Carried) -> PyResult<CameraState> {
    let mean = flat("mean", mean)?.try_into();
    let mean = mean.map_err(|_| input_error("mean", &format!("{CAMERA_NUMBERS} numbers"), "another length"))?;
    let covariance = fixed::<CAMERA_NUMBERS, CAMERA_NUMBERS, _>("covariance", covariance)?;
    Ok(CameraState::new(&view.0, priors)?.with_numbers(mean, covariance))
}

fn add_state(dict: &Bound<'_, PyDict>, state: &CameraState) -> PyResult<()> {
    dict.set_item("state_mean", state.mean().to_vec().into_pyarray(dict.py()))?;
    dict.set_item("state_covariance", to_matrix(dict.py(), &state.covariance())?)?;
    dict.set_item("state_conflict", state.height_conflict())
}

/// The defaults of the standard deviations, and of a class's size.
#[pyfunction]
pub(crate) fn default_frame_priors(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let (priors, scale) = (FramePriors::default(), ScalePrior::default());
    let values =
        [priors.pitch_sigma, priors.roll_sigma, priors.height_sigma, priors.roughness, priors.slope, priors.curvature];
    let dict = PyDict::new(py);
    for (name, value) in SIGMAS.into_iter().zip(values) {
        dict.set_item(name, value)?;
    }
    dict.set_item("class_size_sigma", scale.sigma)?;
    dict.set_item("own_size_sigma", scale.own_sigma)?;
    Ok(dict)
}

/// Whether priors can be, before there is a frame.
#[pyfunction]
pub(crate) fn check_frame_priors(sigmas: [f64; 6], scales: PyReadonlyArray2<'_, f64>) -> PyResult<()> {
    let any_view = View::new(Camera::new(1.0, 1.0, 0.0, 0.0)?, Tilt::default())?;
    Ok(priors(sigmas, rows::<3, _>("scales", &scales)?)?.check(&any_view)?)
}

fn priors(
    [pitch_sigma, roll_sigma, height_sigma, roughness, slope, curvature]: [f64; 6],
    rows: &[[f64; 3]],
) -> PyResult<FramePriors> {
    let mut scales = [ScalePrior::default(); MAX_CLASSES];
    if rows.len() > MAX_CLASSES {
        return Err(input_error("models", &format!("at most {MAX_CLASSES} classes"), &rows.len().to_string()));
    }
    for (scale, &[log_mean, sigma, own_sigma]) in scales.iter_mut().zip(rows) {
        *scale = ScalePrior { log_mean, sigma, own_sigma };
    }
    Ok(FramePriors { pitch_sigma, roll_sigma, height_sigma, roughness, slope, curvature, scales })
}

fn add_frame(dict: &Bound<'_, PyDict>, frame: &Frame) -> PyResult<()> {
    dict.set_item("pitch", frame.view.tilt.pitch)?;
    dict.set_item("roll", frame.view.tilt.roll)?;
    dict.set_item("height", frame.view.height)?;
    let covariance: [[f64; 3]; 3] = frame.covariance.into();
    dict.set_item("view_covariance", to_matrix(dict.py(), &covariance)?)?;
    dict.set_item("scales", to_matrix(dict.py(), &frame.scales.map(|scale| [scale.log_mean, scale.sigma]))?)?;
    dict.set_item("agreeing", frame.objects)?;
    dict.set_item("height_conflict", frame.height_conflict)
}

fn add_answers(dict: &Bound<'_, PyDict>, answers: &[FrameAnswer], frame: &Frame) -> PyResult<()> {
    let (py, count) = (dict.py(), answers.len());
    let numbers = |value: fn(&FrameAnswer) -> f64| answers.iter().map(value).collect::<Vec<f64>>().into_pyarray(py);
    dict.set_item("log_size", numbers(|a| a.log_size))?;
    dict.set_item("log_size_sigma", numbers(|a| a.log_size_sigma))?;
    dict.set_item("frame_weight", numbers(|a| a.weight))?;
    let yaw: Vec<f64> = answers.iter().map(|a| a.pose.yaw(&frame.view)).collect();
    dict.set_item("yaw", yaw.into_pyarray(py))?;
    let t: Vec<[f64; 3]> = answers.iter().map(|a| a.pose.t.into()).collect();
    dict.set_item("t", to_matrix(py, &t)?)?;
    let moved: Vec<[f64; 6]> = answers.iter().map(|a| a.moved.into()).collect();
    dict.set_item("moved", to_matrix(py, &moved)?)?;
    let matrices = |size: usize, value: fn(&FrameAnswer, (usize, usize)) -> f64| {
        Array3::from_shape_fn((count, size, size), |(k, i, j)| value(&answers[k], (i, j))).into_pyarray(py)
    };
    dict.set_item("R", matrices(3, |a, at| a.pose.r[at]))?;
    dict.set_item("covariance", matrices(6, |a, at| a.covariance[at]))?;
    dict.set_item("moved_covariance", matrices(7, |a, at| a.moved_covariance[at]))
}
