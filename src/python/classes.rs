//! Classes that hold checked values.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, ToPyArray};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::arrays::{fixed, flat, require_shape, rows};
use super::choose;
use crate::camera::{Camera, Tilt, View};
use crate::minimal::p1p::Cases;
use crate::object::{Footprint, ShapeModel};
use crate::options::{Options, Solver};
use crate::refine::Refinement;
use crate::score::Scoring;

#[pyclass(frozen, name = "Camera", module = "groundpose._core")]
pub(crate) struct PyCamera(pub(crate) Camera);

#[pymethods]
impl PyCamera {
    #[new]
    #[pyo3(signature = (fx, fy, cx, cy, distortion=None, image_size=None))]
    fn new(
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        distortion: Option<[f64; 5]>,
        image_size: Option<[f64; 2]>,
    ) -> PyResult<Self> {
        let mut camera = Camera::new(fx, fy, cx, cy)?;
        if let Some(distortion) = distortion {
            camera = camera.with_distortion(distortion)?;
        }
        if let Some([width, height]) = image_size {
            camera = camera.with_image_size(width, height)?;
        }
        Ok(Self(camera))
    }

    #[getter]
    fn fx(&self) -> f64 {
        self.0.fx
    }

    #[getter]
    fn fy(&self) -> f64 {
        self.0.fy
    }

    #[getter]
    fn cx(&self) -> f64 {
        self.0.cx
    }

    #[getter]
    fn cy(&self) -> f64 {
        self.0.cy
    }

    #[getter]
    fn distortion(&self) -> Option<[f64; 5]> {
        self.0.distortion
    }

    #[getter]
    fn image_size(&self) -> Option<[f64; 2]> {
        self.0.image_size
    }

    fn undistort<'py>(
        &self,
        py: Python<'py>,
        pixels: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let undistorted: Vec<[f64; 2]> =
            rows::<2, _>("pixels", &pixels)?.iter().map(|&p| self.0.undistort(p).unwrap_or([f64::NAN; 2])).collect();
        to_matrix(py, &undistorted)
    }

    fn distort<'py>(&self, py: Python<'py>, pixels: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let distorted: Vec<[f64; 2]> = rows::<2, _>("pixels", &pixels)?.iter().map(|&p| self.0.distort(p)).collect();
        to_matrix(py, &distorted)
    }
}

#[pyclass(frozen, name = "View", module = "groundpose._core")]
pub(crate) struct PyView(pub(crate) View);

#[pymethods]
impl PyView {
    #[new]
    #[pyo3(signature = (camera, pitch=0.0, roll=0.0, height=None))]
    fn new(camera: &PyCamera, pitch: f64, roll: f64, height: Option<f64>) -> PyResult<Self> {
        Self::with_height(View::new(camera.0, Tilt { pitch, roll })?, height)
    }

    #[staticmethod]
    #[pyo3(signature = (camera, gravity, height=None))]
    fn from_gravity(camera: &PyCamera, gravity: [f64; 3], height: Option<f64>) -> PyResult<Self> {
        Self::with_height(View::from_gravity(camera.0, gravity)?, height)
    }

    #[getter]
    fn camera(&self) -> PyCamera {
        PyCamera(self.0.camera)
    }

    #[getter]
    fn pitch(&self) -> f64 {
        self.0.tilt.pitch
    }

    #[getter]
    fn roll(&self) -> f64 {
        self.0.tilt.roll
    }

    #[getter]
    fn height(&self) -> Option<f64> {
        self.0.height
    }

    #[getter(R_camera_from_ground)]
    fn r_camera_from_ground<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        // nalgebra stores columns: the transpose's columns are the rows.
        let rows: [[f64; 3]; 3] = self.0.r_camera_from_ground.transpose().into();
        to_matrix(py, &rows)
    }

    fn horizon(&self) -> (f64, f64, f64) {
        self.0.horizon().into()
    }

    fn side_planes<'py>(&self, py: Python<'py>, left: f64, right: f64) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let planes: [[f64; 3]; 2] = self.0.side_planes(left, right).map(Into::into);
        to_matrix(py, &planes)
    }

    fn project<'py>(&self, py: Python<'py>, points: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pixels: Vec<[f64; 2]> = rows::<3, _>("points_camera", &points)?
            .iter()
            .map(|&p| self.0.camera.project(&p.into()).unwrap_or([f64::NAN; 2]))
            .collect();
        to_matrix(py, &pixels)
    }
}

impl PyView {
    fn with_height(view: View, height: Option<f64>) -> PyResult<Self> {
        Ok(Self(match height {
            Some(height) => view.with_height(height)?,
            None => view,
        }))
    }
}

/// Owned arrays of a shape model, checked once.
pub(crate) struct ModelData {
    mean: Vec<[f64; 3]>,
    basis: Vec<[f64; 3]>,
    eigenvalues: Vec<f64>,
    bbox_3d: [[f64; 3]; 2],
    footprint: Footprint,
}

impl ModelData {
    pub(crate) fn shape_model(&self) -> ShapeModel<'_> {
        ShapeModel::checked_before(&self.mean, &self.basis, &self.eigenvalues, self.bbox_3d, self.footprint)
    }

    pub(crate) fn modes(&self) -> usize {
        self.eigenvalues.len()
    }

    pub(crate) fn keypoints(&self) -> usize {
        self.mean.len()
    }
}

#[pyclass(frozen, name = "Model", module = "groundpose._core")]
pub(crate) struct PyModel(pub(crate) Arc<ModelData>);

#[pymethods]
impl PyModel {
    #[new]
    #[pyo3(signature = (keypoints_3d, bbox_3d, basis=None, eigenvalues=None, footprint=None))]
    fn new(
        keypoints_3d: PyReadonlyArray2<'_, f64>,
        bbox_3d: PyReadonlyArray2<'_, f64>,
        basis: Option<PyReadonlyArray3<'_, f64>>,
        eigenvalues: Option<PyReadonlyArray1<'_, f64>>,
        footprint: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<Self> {
        let mean = rows::<3, _>("keypoints_3d", &keypoints_3d)?.to_vec();
        let bbox_3d = fixed::<2, 3, _>("bbox_3d", &bbox_3d)?;
        let eigenvalues = match &eigenvalues {
            Some(e) => flat("eigenvalues", e)?.to_vec(),
            None => Vec::new(),
        };
        let basis = match &basis {
            Some(b) => {
                require_shape("basis", &b.as_array(), &[eigenvalues.len(), mean.len(), 3])?;
                rows::<3, _>("basis", b)?.to_vec()
            }
            None => Vec::new(),
        };
        let mut checked = ShapeModel::rigid(&mean, bbox_3d)?.with_modes(&basis, &eigenvalues)?;
        if let Some(footprint) = &footprint {
            checked = checked.with_footprint(Footprint::new(rows::<2, _>("footprint", footprint)?)?);
        }
        let footprint = *checked.footprint();
        Ok(Self(Arc::new(ModelData { mean, basis, eigenvalues, bbox_3d, footprint })))
    }

    #[getter]
    fn footprint<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        to_matrix(py, self.0.footprint.corners())
    }
}

#[pyclass(frozen, name = "Options", module = "groundpose._core")]
pub(crate) struct PyOptions(pub(crate) Options);

/// Named values of an option, in one table for both directions.
pub(crate) struct Choices<T: 'static>(&'static str, &'static [(&'static str, T)]);

const SOLVERS: Choices<Solver> = Choices(
    "solver",
    &[
        ("auto", Solver::Auto),
        ("p1p", Solver::P1p),
        ("p3p", Solver::P3p),
        ("up2p", Solver::Up2p),
        ("p1p_height", Solver::P1pHeight),
    ],
);
pub(crate) const CASES: Choices<Cases> = Choices("cases", &[("all", Cases::All), ("paper", Cases::Paper)]);
const SCORINGS: Choices<Scoring> = Choices("scoring", &[("msac", Scoring::Msac), ("inliers", Scoring::Inliers)]);
const REFINEMENTS: Choices<Refinement> = Choices(
    "refinement",
    &[
        ("default", Refinement::Default),
        ("hre", Refinement::Hre),
        ("re", Refinement::Re),
        ("gn", Refinement::Gn),
        ("none", Refinement::None),
    ],
);

impl<T: Copy + PartialEq> Choices<T> {
    pub(crate) fn parse(&self, name: &str) -> PyResult<T> {
        choose(self.0, name, self.1)
    }

    fn name(&self, value: T) -> &'static str {
        self.1.iter().find(|(_, v)| *v == value).map_or("", |(n, _)| n)
    }
}

#[pymethods]
impl PyOptions {
    #[new]
    #[pyo3(signature = (**fields))]
    fn new(fields: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut options = Options::default();
        for (key, value) in fields.into_iter().flatten() {
            let key: String = key.extract()?;
            set_option(&mut options, &key, &value).map_err(|e| {
                if e.is_instance_of::<PyTypeError>(value.py()) { wrong_type(&key, &value, &e) } else { e }
            })?;
        }
        options.check()?;
        Ok(Self(options))
    }
}

fn wrong_type(key: &str, value: &Bound<'_, PyAny>, cause: &PyErr) -> PyErr {
    let got = value.get_type().name().map_or_else(|_| "another type".to_owned(), |n| n.to_string());
    match key {
        _ if !is_option(key) => PyTypeError::new_err(cause.to_string()),
        _ => PyTypeError::new_err(format!("{key}: {cause}, got {got}")),
    }
}

fn is_option(key: &str) -> bool {
    OPTION_NAMES.contains(&key)
}

const OPTION_NAMES: [&str; 16] = [
    "inlier_threshold",
    "relative_threshold",
    "confidence",
    "solver",
    "cases",
    "scoring",
    "refinement",
    "hre_thresholds",
    "tilt_sigma",
    "shape_prior",
    "bbox_sigma",
    "covariance",
    "max_iterations",
    "min_keypoints",
    "max_log10_nfa",
    "score_weights",
];

fn set_option(options: &mut Options, key: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    match key {
        "inlier_threshold" => options.inlier_threshold = value.extract()?,
        "relative_threshold" => options.relative_threshold = value.extract()?,
        "confidence" => options.confidence = value.extract()?,
        "solver" => options.solver = SOLVERS.parse(value.extract()?)?,
        "cases" => options.cases = CASES.parse(value.extract()?)?,
        "scoring" => options.scoring = SCORINGS.parse(value.extract()?)?,
        "refinement" => options.refinement = REFINEMENTS.parse(value.extract()?)?,
        "hre_thresholds" => options.hre_thresholds = value.extract()?,
        "tilt_sigma" => options.tilt_sigma = value.extract()?,
        "shape_prior" => options.shape_prior = value.extract()?,
        "bbox_sigma" => options.bbox_sigma = value.extract()?,
        "covariance" => options.covariance = value.extract()?,
        "max_iterations" => options.max_iterations = value.extract()?,
        "min_keypoints" => options.min_keypoints = value.extract()?,
        "max_log10_nfa" => options.max_log10_nfa = value.extract()?,
        "score_weights" => options.score_weights = value.extract()?,
        "seed" => options.seed = value.extract()?,
        _ => {
            let names = OPTION_NAMES.join(", ");
            return Err(PyTypeError::new_err(format!("Options: expected one of {names}, seed, got {key:?}")));
        }
    }
    Ok(())
}

/// Every option with its default: the place of defaults for Python too.
#[pyfunction]
pub(crate) fn default_options(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let o = Options::default();
    let dict = PyDict::new(py);
    dict.set_item("inlier_threshold", o.inlier_threshold)?;
    dict.set_item("relative_threshold", o.relative_threshold)?;
    dict.set_item("confidence", o.confidence)?;
    dict.set_item("solver", SOLVERS.name(o.solver))?;
    dict.set_item("cases", CASES.name(o.cases))?;
    dict.set_item("scoring", SCORINGS.name(o.scoring))?;
    dict.set_item("refinement", REFINEMENTS.name(o.refinement))?;
    dict.set_item("hre_thresholds", (o.hre_thresholds[0], o.hre_thresholds[1], o.hre_thresholds[2]))?;
    dict.set_item("tilt_sigma", o.tilt_sigma)?;
    dict.set_item("shape_prior", o.shape_prior)?;
    dict.set_item("bbox_sigma", o.bbox_sigma)?;
    dict.set_item("covariance", o.covariance)?;
    dict.set_item("max_iterations", o.max_iterations)?;
    dict.set_item("min_keypoints", o.min_keypoints)?;
    dict.set_item("max_log10_nfa", o.max_log10_nfa)?;
    dict.set_item("score_weights", o.score_weights)?;
    dict.set_item("seed", o.seed)?;
    Ok(dict)
}

/// Rows as a matrix of numpy's.
pub(crate) fn to_matrix<'py, const N: usize>(
    py: Python<'py>,
    rows: &[[f64; N]],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Bound<'py, PyArray1<f64>> = rows.as_flattened().to_pyarray(py);
    flat.reshape([rows.len(), N])
}
