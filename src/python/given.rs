//! What a call gives, where it can be read as it is: arrays of the right type, layout and shape.

use numpy::ndarray::{Dimension, Ix1, Ix2, Ix3};
use numpy::{Element, PyArray, PyArrayMethods, PyReadonlyArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::models::PyModels;
use super::observe::{Inputs, ModelOf};
use crate::model::observation::VIEWING_ANGLES;

type Argument<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

/// The arrays of a call; shapes beside that of the keypoints are not yet checked.
pub(super) struct Given<'py> {
    pub(super) objects: usize,
    keypoints_2d: PyReadonlyArray<'py, f64, Ix3>,
    bboxes: Option<PyReadonlyArray<'py, f64, Ix2>>,
    scores: Option<PyReadonlyArray<'py, f64, Ix2>>,
    model_indices: Option<PyReadonlyArray<'py, i64, Ix1>>,
    vehicle_probability: Option<PyReadonlyArray<'py, f64, Ix1>>,
    viewing_angles: Option<PyReadonlyArray<'py, f64, Ix2>>,
}

impl<'py> Given<'py> {
    /// None where something is not such an array. The rest: boxes, scores, numbers of models, and what a network says.
    pub(super) fn new<'a>(
        keypoints_2d: &Bound<'py, PyAny>,
        rest: (Argument<'a, 'py>, Argument<'a, 'py>, Argument<'a, 'py>, Argument<'a, 'py>, Argument<'a, 'py>),
    ) -> Option<Self> {
        let keypoints_2d = plain::<f64, Ix3>(keypoints_2d)?;
        let (bboxes, scores, model_indices, vehicle_probability, viewing_angles) = rest;
        Some(Self {
            objects: keypoints_2d.shape()[0],
            keypoints_2d,
            bboxes: optional(bboxes)?,
            scores: optional(scores)?,
            model_indices: optional(model_indices)?,
            vehicle_probability: optional(vehicle_probability)?,
            viewing_angles: optional(viewing_angles)?,
        })
    }

    /// The same as slices; none where a shape or a number of a model does not fit.
    pub(super) fn inputs<'a>(&'a self, models: &'a PyModels, thresholds: Option<&'a [f64]>) -> Option<Inputs<'a>> {
        let &[objects, keypoints, 2] = self.keypoints_2d.shape() else { return None };
        let model_of = self.model_of(models)?;
        // no object, no width
        let width_fits = keypoints == models.widest || objects == 0;
        let inputs = Inputs {
            keypoints_2d: self.keypoints_2d.as_slice().ok()?.as_chunks().0,
            keypoints,
            scores: shaped(&self.scores, &[objects, keypoints])?,
            bboxes: shaped(&self.bboxes, &[objects, 4])?.map(|b| b.as_chunks().0),
            thresholds,
            vehicle_probability: shaped(&self.vehicle_probability, &[objects])?,
            viewing_angles: shaped(&self.viewing_angles, &[objects, VIEWING_ANGLES])?.map(|p| p.as_chunks().0),
            models: &models.each,
            model_of,
        };
        let fits = width_fits && thresholds.is_none_or(|t| t.len() == objects);
        let ragged = models.narrowest < models.widest;
        (fits && !(ragged && (0..objects).any(|i| inputs.has_more_than_its_model(i)))).then_some(inputs)
    }

    fn model_of<'a>(&'a self, models: &PyModels) -> Option<ModelOf<'a>> {
        let Some(numbers) = &self.model_indices else {
            return match (models.only, models.each.len()) {
                (true, _) => Some(ModelOf::Only),
                (false, count) => (count == self.objects).then_some(ModelOf::Own),
            };
        };
        let numbers = numbers.as_slice().ok()?;
        let known = |&number: &i64| usize::try_from(number).is_ok_and(|number| number < models.each.len());
        (numbers.len() == self.objects && numbers.iter().all(known)).then_some(ModelOf::Numbered(numbers))
    }
}

impl Inputs<'_> {
    /// Whether an object has numbers beyond the keypoints of its model.
    fn has_more_than_its_model(&self, i: usize) -> bool {
        let own = i * self.keypoints + self.model(i).keypoints();
        self.keypoints_2d[own..(i + 1) * self.keypoints].iter().flatten().any(|x| !x.is_nan())
    }
}

/// An array, and no kind of one, of numbers in order.
fn plain<'py, T: Element, D: Dimension>(value: &Bound<'py, PyAny>) -> Option<PyReadonlyArray<'py, T, D>> {
    let array = value.cast_exact::<PyArray<T, D>>().ok()?.try_readonly().ok()?;
    // `as_slice` takes Fortran order too, and refuses what is not aligned
    (array.is_c_contiguous() && array.as_slice().is_ok()).then_some(array)
}

/// `plain` of what was given; none of nothing is no failure.
#[expect(clippy::option_option, reason = "not given, and not such an array")]
fn optional<'py, T: Element, D: Dimension>(value: Argument<'_, 'py>) -> Option<Option<PyReadonlyArray<'py, T, D>>> {
    value.map_or(Some(None), |value| plain(value).map(Some))
}

/// The numbers of an array of a shape.
#[expect(clippy::option_option, reason = "not given, and of another shape")]
fn shaped<'a, D: Dimension>(
    array: &'a Option<PyReadonlyArray<'_, f64, D>>,
    shape: &[usize],
) -> Option<Option<&'a [f64]>> {
    match array {
        Some(array) if array.shape() == shape => array.as_slice().ok().map(Some),
        Some(_) => None,
        None => Some(None),
    }
}
