//! The minimal solvers, one sample at a time, for tests and teaching.

use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::arrays::{fixed, flat};
use super::classes::{PyCamera, PyModel, PyView, to_matrix};
use super::input_error;
use super::options::CASES;
use crate::geometry::bbox::Bbox;
use crate::geometry::pose::Pose;
use crate::minimal::MinimalSolver;
use crate::minimal::p1p::P1p;
use crate::minimal::p1p_height::P1pHeight;
use crate::minimal::p3p::solve_p3p as p3p;
use crate::minimal::up2p::solve_up2p as up2p;
use crate::model::observation::Observation;

type Poses<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>);

fn to_arrays<'py>(py: Python<'py>, poses: &[Pose]) -> PyResult<Poses<'py>> {
    let r = Array3::from_shape_fn((poses.len(), 3, 3), |(k, i, j)| poses[k].r[(i, j)]);
    let t: Vec<[f64; 3]> = poses.iter().map(|p| p.t.into()).collect();
    Ok((r.into_pyarray(py), to_matrix(py, &t)?))
}

fn pair(argument: &str, array: &PyReadonlyArray1<'_, f64>) -> PyResult<[f64; 2]> {
    let values = flat(argument, array)?;
    values.try_into().map_err(|_| input_error(argument, "2 numbers", &values.len().to_string()))
}

fn bbox(array: &PyReadonlyArray1<'_, f64>) -> PyResult<Bbox> {
    let values = flat("bbox", array)?;
    let sides = values.try_into().map_err(|_| input_error("bbox", "4 numbers", &values.len().to_string()))?;
    Ok(Bbox::new(sides)?)
}

/// An observation in which only keypoint `index` is seen.
fn with_one_keypoint<T>(
    model: &PyModel,
    index: usize,
    keypoint_2d: [f64; 2],
    use_it: impl FnOnce(&Observation) -> T,
) -> PyResult<T> {
    let model = model.0.shape_model();
    if index >= model.keypoint_count() {
        let expected = format!("an index below {}", model.keypoint_count());
        return Err(input_error("keypoint_index", &expected, &index.to_string()));
    }
    let mut keypoints = vec![[f64::NAN; 2]; model.keypoint_count()];
    keypoints[index] = keypoint_2d;
    Ok(use_it(&Observation::new(&keypoints, &model)?))
}

#[pyfunction]
#[pyo3(signature = (view, model, keypoint_index, keypoint_2d, bbox, cases="all"))]
pub(crate) fn solve_p1p<'py>(
    py: Python<'py>,
    view: &PyView,
    model: &PyModel,
    keypoint_index: usize,
    keypoint_2d: PyReadonlyArray1<'py, f64>,
    bbox: PyReadonlyArray1<'py, f64>,
    cases: &str,
) -> PyResult<Poses<'py>> {
    let cases = CASES.parse(cases)?;
    let bbox = self::bbox(&bbox)?;
    let mut poses = Vec::new();
    with_one_keypoint(model, keypoint_index, pair("keypoint_2d", &keypoint_2d)?, |observation| {
        P1p::new(&view.0, observation, &bbox, cases).solve([keypoint_index], &mut |p| poses.push(p));
    })?;
    to_arrays(py, &poses)
}

#[pyfunction]
pub(crate) fn solve_p1p_height<'py>(
    py: Python<'py>,
    view: &PyView,
    model: &PyModel,
    keypoint_index: usize,
    keypoint_2d: PyReadonlyArray1<'py, f64>,
    bbox: PyReadonlyArray1<'py, f64>,
) -> PyResult<Poses<'py>> {
    let height = view.0.height.ok_or_else(|| input_error("view", "a view with a height", "none"))?;
    let bbox = self::bbox(&bbox)?;
    let mut poses = Vec::new();
    with_one_keypoint(model, keypoint_index, pair("keypoint_2d", &keypoint_2d)?, |observation| {
        P1pHeight::new(&view.0, observation, &bbox, height).solve([keypoint_index], &mut |p| poses.push(p));
    })?;
    to_arrays(py, &poses)
}

#[pyfunction]
pub(crate) fn solve_p3p<'py>(
    py: Python<'py>,
    camera: &PyCamera,
    points_3d: PyReadonlyArray2<'py, f64>,
    pixels: PyReadonlyArray2<'py, f64>,
) -> PyResult<Poses<'py>> {
    let points = fixed::<3, 3, _>("points_3d", &points_3d)?;
    let pixels = fixed::<3, 2, _>("pixels", &pixels)?;
    let mut poses = Vec::new();
    p3p(points.map(Into::into), pixels.map(|p| camera.0.ray(p)), &mut |p| poses.push(p));
    to_arrays(py, &poses)
}

#[pyfunction]
pub(crate) fn solve_up2p<'py>(
    py: Python<'py>,
    view: &PyView,
    points_3d: PyReadonlyArray2<'py, f64>,
    pixels: PyReadonlyArray2<'py, f64>,
) -> PyResult<Poses<'py>> {
    let points = fixed::<2, 3, _>("points_3d", &points_3d)?;
    let pixels = fixed::<2, 2, _>("pixels", &pixels)?;
    let mut poses = Vec::new();
    up2p(&view.0, points, pixels.map(|p| view.0.ground_ray(p)), &mut |p| poses.push(p));
    to_arrays(py, &poses)
}
