//! `Models`: the shape models of an estimator, looked up once.

use std::sync::Arc;

use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::classes::{ModelData, PyModel};
use super::observe::{Inputs, ModelOf};

#[pyclass(frozen, name = "Models", module = "groundpose._core")]
pub(crate) struct PyModels {
    pub(super) each: Vec<Arc<ModelData>>,
    /// Whether all objects have the only one.
    pub(super) only: bool,
    /// Most and fewest keypoints of a model.
    pub(super) widest: usize,
    pub(super) narrowest: usize,
    /// Most modes of a model.
    pub(super) modes: usize,
}

#[pymethods]
impl PyModels {
    /// Of a `ShapeModel`, or a `Model`, for all objects, or a tuple of some; `None` when something is none.
    #[staticmethod]
    fn of(models: &Bound<'_, PyAny>) -> Option<Self> {
        let Ok(several) = models.cast::<PyTuple>() else { return Some(Self::new(vec![data(models)?], true)) };
        Some(Self::new(several.iter().map(|model| data(&model)).collect::<Option<_>>()?, false))
    }
}

impl PyModels {
    /// What is known of the objects of a call that were checked, without what was given of each.
    pub(super) fn inputs<'a>(
        &'a self,
        keypoints: usize,
        scores: Option<&'a [f64]>,
        numbers: Option<&'a [i64]>,
    ) -> Inputs<'a> {
        let own = if self.only { ModelOf::Only } else { ModelOf::Own };
        Inputs {
            keypoints_2d: &[],
            keypoints,
            scores,
            bboxes: None,
            thresholds: None,
            vehicle_probability: None,
            viewing_angles: None,
            models: &self.each,
            model_of: numbers.map_or(own, ModelOf::Numbered),
        }
    }

    fn new(each: Vec<Arc<ModelData>>, only: bool) -> Self {
        let counts = || each.iter().map(|model| model.keypoints());
        Self {
            widest: counts().max().unwrap_or(0),
            narrowest: counts().min().unwrap_or(0),
            modes: each.iter().map(|model| model.modes()).max().unwrap_or(0),
            only,
            each,
        }
    }
}

/// The core's part of a `ShapeModel`, or a `Model` itself.
fn data(model: &Bound<'_, PyAny>) -> Option<Arc<ModelData>> {
    let shared = |model: &Bound<'_, PyAny>| Some(Arc::clone(&model.cast::<PyModel>().ok()?.get().0));
    shared(model).or_else(|| shared(&model.getattr(intern!(model.py(), "_handle")).ok()?))
}
