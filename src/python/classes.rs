//! Classes that hold checked values.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, ToPyArray};
use pyo3::prelude::*;

use super::arrays::{fixed, flat, require_shape, rows};
use super::{choose, input_error};
use crate::geometry::camera::Camera;
use crate::geometry::footprint::Footprint;
use crate::geometry::lens::Lens;
use crate::geometry::lens::brown_conrady::BrownConrady;
use crate::geometry::view::{Tilt, View};
use crate::model::shape_model::ShapeModel;

/// Rows between two looks for an interrupt: a hundredth of a second, in the slowest lens a tenth.
const ROWS_PER_LOOK: usize = 1 << 16;

#[pyclass(frozen, name = "Camera", module = "groundpose._core")]
pub(crate) struct PyCamera(pub(crate) Camera);

#[pymethods]
impl PyCamera {
    #[new]
    #[pyo3(signature = (fx, fy, cx, cy, distortion=None, image_size=None, lens=BrownConrady::NAME))]
    fn new(
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        distortion: Option<Vec<f64>>,
        image_size: Option<[f64; 2]>,
        lens: &str,
    ) -> PyResult<Self> {
        let mut camera = Camera::new(fx, fy, cx, cy)?;
        let with_coefficients = choose("lens", lens, &Lens::MODELS)?;
        if let Some(k) = distortion {
            let lens = with_coefficients(&k);
            let expected = "as many coefficients as the lens model has";
            camera =
                camera.with_lens(lens.ok_or_else(|| input_error("distortion", expected, &k.len().to_string()))?)?;
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
    fn distortion(&self) -> Option<Vec<f64>> {
        self.0.lens.map(|lens| lens.coefficients().to_vec())
    }

    #[getter]
    fn image_size(&self) -> Option<[f64; 2]> {
        self.0.image_size
    }

    fn project<'py>(
        &self,
        py: Python<'py>,
        points_camera: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = rows::<3, _>("points_camera", &points_camera)?;
        of_each(py, points, |p| self.0.project(&p.into()).unwrap_or([f64::NAN; 2]))
    }

    fn image_of<'py>(
        &self,
        py: Python<'py>,
        points_camera: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pixels: Vec<[f64; 2]> = rows::<3, _>("points_camera", &points_camera)?
            .iter()
            .map(|&p| self.0.image_of(&p.into()).unwrap_or([f64::NAN; 2]))
            .collect();
        to_matrix(py, &pixels)
    }

    fn directions_of<'py>(
        &self,
        py: Python<'py>,
        pixels: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let directions: Vec<[f64; 3]> = rows::<2, _>("pixels", &pixels)?
            .iter()
            .map(|&p| self.0.direction_of(p).map_or([f64::NAN; 3], Into::into))
            .collect();
        to_matrix(py, &directions)
    }

    fn rays<'py>(&self, py: Python<'py>, pixels: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_each(py, rows::<2, _>("pixels", &pixels)?, |p| self.0.ray(p).into())
    }

    fn undistort<'py>(
        &self,
        py: Python<'py>,
        pixels: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_each(py, rows::<2, _>("pixels", &pixels)?, |p| self.0.undistort(p).unwrap_or([f64::NAN; 2]))
    }

    fn distort<'py>(&self, py: Python<'py>, pixels: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        of_each(py, rows::<2, _>("pixels", &pixels)?, |p| self.0.distort(p))
    }
}

/// A function of each row, with looks for an interrupt.
fn of_each<'py, const N: usize, const M: usize>(
    py: Python<'py>,
    rows: &[[f64; N]],
    function: impl Fn([f64; N]) -> [f64; M],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut made = Vec::with_capacity(rows.len());
    for block in rows.chunks(ROWS_PER_LOOK) {
        py.check_signals()?;
        made.extend(block.iter().map(|&row| function(row)));
    }
    to_matrix(py, &made)
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
    bbox_basis: Vec<[[f64; 3]; 2]>,
    footprint: Footprint,
}

impl ModelData {
    pub(crate) fn shape_model(&self) -> ShapeModel<'_> {
        ShapeModel::checked_before(
            &self.mean,
            &self.basis,
            &self.eigenvalues,
            self.bbox_3d,
            &self.bbox_basis,
            self.footprint,
        )
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
    #[pyo3(signature = (keypoints_3d, bbox_3d, basis=None, eigenvalues=None, footprint=None, bbox_basis=None))]
    fn new(
        keypoints_3d: PyReadonlyArray2<'_, f64>,
        bbox_3d: PyReadonlyArray2<'_, f64>,
        basis: Option<PyReadonlyArray3<'_, f64>>,
        eigenvalues: Option<PyReadonlyArray1<'_, f64>>,
        footprint: Option<PyReadonlyArray2<'_, f64>>,
        bbox_basis: Option<PyReadonlyArray3<'_, f64>>,
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
        let bbox_basis = match &bbox_basis {
            Some(b) => {
                require_shape("bbox_basis", &b.as_array(), &[eigenvalues.len(), 2, 3])?;
                rows::<3, _>("bbox_basis", b)?.as_chunks().0.to_vec()
            }
            None => Vec::new(),
        };
        let mut checked = ShapeModel::rigid(&mean, bbox_3d)?.with_modes(&basis, &eigenvalues)?;
        if !bbox_basis.is_empty() {
            checked = checked.with_bbox_basis(&bbox_basis)?;
        }
        if let Some(footprint) = &footprint {
            checked = checked.with_footprint(Footprint::new(rows::<2, _>("footprint", footprint)?)?);
        }
        let footprint = *checked.footprint();
        Ok(Self(Arc::new(ModelData { mean, basis, eigenvalues, bbox_3d, bbox_basis, footprint })))
    }

    #[getter]
    fn footprint<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        to_matrix(py, self.0.footprint.corners())
    }
}

/// Rows as a matrix of numpy's.
pub(crate) fn to_matrix<'py, const N: usize>(
    py: Python<'py>,
    rows: &[[f64; N]],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Bound<'py, PyArray1<f64>> = rows.as_flattened().to_pyarray(py);
    flat.reshape([rows.len(), N])
}
