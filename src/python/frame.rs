//! The tilt of a frame from the poses of its objects.

use numpy::{PyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use super::arrays::{require_shape, rows};
use super::classes::{PyView, to_matrix};
use crate::estimate::frame_tilt::{UpAxis, frame_tilt as tilt};
use crate::estimate::options::Options;
use crate::geometry::pose::Pose;
use crate::refine::covariance::PoseCovariance;

/// Pitch, roll, their covariance and the effective number of objects; rows that are not finite say nothing.
#[pyfunction]
#[pyo3(signature = (view, R, covariance, prior_sigma))]
#[expect(non_snake_case, reason = "the field's name of a rotation")]
pub(crate) fn frame_tilt<'py>(
    py: Python<'py>,
    view: &PyView,
    R: PyReadonlyArray3<'py, f64>,
    covariance: PyReadonlyArray3<'py, f64>,
    prior_sigma: f64,
) -> PyResult<(f64, f64, Bound<'py, PyArray2<f64>>, f64)> {
    let rotations = rows::<3, _>("R", &R)?;
    let count = rotations.len() / 3;
    require_shape("R", &R.as_array(), &[count, 3, 3])?;
    require_shape("covariance", &covariance.as_array(), &[count, 6, 6])?;
    let covariances = rows::<6, _>("covariance", &covariance)?;
    let axes: Vec<UpAxis> = (0..count)
        .map(|k| {
            let r = nalgebra::Matrix3::from_fn(|i, j| rotations[3 * k + i][j]);
            let covariance = PoseCovariance::from_fn(|i, j| covariances[6 * k + i][j]);
            UpAxis::new(&view.0, &Pose { r, t: nalgebra::Vector3::zeros() }, &covariance)
        })
        .collect();
    let frame = tilt(&view.0, &axes, Options::OBJECT_TILT_SIGMA, prior_sigma);
    // about the ground's z axis (roll) and x axis (pitch), in the order in which a view has them
    let c = frame.covariance;
    let swapped = to_matrix(py, &[[c[(1, 1)], c[(1, 0)]], [c[(0, 1)], c[(0, 0)]]])?;
    Ok((frame.view.tilt.pitch, frame.view.tilt.roll, swapped, frame.objects))
}
