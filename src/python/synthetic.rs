//! `synthetic_scenes`: the generator of the core as arrays.

use numpy::{PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::choose;
use super::classes::to_matrix;
use crate::synthetic::{BboxError, Kind, Outliers, Protocol, Scene};

#[pyfunction]
#[pyo3(signature = (kind, trials, seed=0, first_trial=0, n_points=300, outlier_ratio=0.5, outliers="image",
                    noise_sigma=2.0, pitch_error_deg=0.0, bbox_error=0.0, bbox_error_kind="outward"))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn synthetic_scenes<'py>(
    py: Python<'py>,
    kind: &str,
    trials: usize,
    seed: u64,
    first_trial: u64,
    n_points: usize,
    outlier_ratio: f64,
    outliers: &str,
    noise_sigma: f64,
    pitch_error_deg: f64,
    bbox_error: f64,
    bbox_error_kind: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let protocol = Protocol {
        kind: choose("kind", kind, &[("cube", Kind::Cube), ("vehicle", Kind::Vehicle)])?,
        n_points,
        outlier_ratio,
        outliers: choose("outliers", outliers, &[("image", Outliers::Image), ("box", Outliers::Box)])?,
        noise_sigma,
        pitch_error: pitch_error_deg.to_radians(),
        bbox_error,
        bbox_error_kind: choose(
            "bbox_error_kind",
            bbox_error_kind,
            &[("outward", BboxError::Outward), ("shift", BboxError::Shift)],
        )?,
    };
    protocol.check()?;
    let scenes: Vec<Scene> = (0..trials as u64).map(|k| protocol.scene(seed, first_trial + k)).collect();
    let width = scenes.iter().map(|s| s.keypoints_2d.len()).max().unwrap_or(0);
    let dict = PyDict::new(py);
    let padded = |values: &dyn Fn(&Scene) -> Vec<f64>, size: usize| -> Vec<f64> {
        scenes
            .iter()
            .flat_map(|s| {
                let mut row = values(s);
                row.resize(width * size, f64::NAN);
                row
            })
            .collect()
    };
    let keypoints_2d = padded(&|s| s.keypoints_2d.as_flattened().to_vec(), 2);
    let keypoints_3d = padded(&|s| s.keypoints_3d.as_flattened().to_vec(), 3);
    dict.set_item("keypoints_2d", keypoints_2d.to_pyarray(py).reshape([trials, width, 2])?)?;
    dict.set_item("keypoints_3d", keypoints_3d.to_pyarray(py).reshape([trials, width, 3])?)?;
    let mask: Vec<bool> =
        scenes.iter().flat_map(|s| (0..width).map(|i| s.is_inlier.get(i).copied().unwrap_or(false))).collect();
    dict.set_item("inlier_truth", mask.to_pyarray(py).reshape([trials, width])?)?;
    let bboxes: Vec<[f64; 4]> = scenes.iter().map(|s| s.bbox).collect();
    dict.set_item("bboxes", to_matrix(py, &bboxes)?)?;
    let rotations: Vec<f64> = scenes.iter().flat_map(|s| s.pose.r.transpose().as_slice().to_vec()).collect();
    dict.set_item("R", rotations.to_pyarray(py).reshape([trials, 3, 3])?)?;
    let translations: Vec<[f64; 3]> = scenes.iter().map(|s| s.pose.t.into()).collect();
    dict.set_item("t", to_matrix(py, &translations)?)?;
    dict.set_item("bbox_3d", to_matrix(py, &protocol.bbox_3d())?)?;
    let column = |value: &dyn Fn(&Scene) -> f64| scenes.iter().map(value).collect::<Vec<f64>>().to_pyarray(py);
    dict.set_item("inlier_threshold", column(&|s| s.inlier_threshold))?;
    dict.set_item("noise_sigma", column(&|s| s.noise_sigma))?;
    dict.set_item("pitch_true", column(&|s| s.pitch))?;
    let camera = protocol.camera();
    dict.set_item("fx", camera.fx)?;
    dict.set_item("fy", camera.fy)?;
    dict.set_item("cx", camera.cx)?;
    dict.set_item("cy", camera.cy)?;
    dict.set_item("image_size", camera.image_size)?;
    dict.set_item("pitch_told", 0.0)?;
    Ok(dict)
}
