//! Results of a batch: one array a field, written row by row while its objects are estimated.

use std::iter::zip;
use std::sync::{LazyLock, Mutex, PoisonError};

use numpy::ndarray::Array;
use numpy::{Element, IntoPyArray};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

use super::again::{COVARIANCES, Kept, Made};
use super::fields::{COUNTS, Field, NUMBERS, OTHERS, Other, is_made_again, is_needed_again};
use super::points::{LentPoints, PointRows, Points};
use super::values::{Lent, Values};
use super::words;
use crate::estimate::answers::{Answer, Answers, Places};
use crate::estimate::describe::Estimate;

/// What stands for a field.
type Any<'py> = Bound<'py, PyAny>;

/// Where the values of a field are.
#[derive(Clone, Copy)]
enum Place {
    KeypointsGiven,
    BoxesGiven,
    Status,
    Ok,
    StopReason,
    Solver,
    InlierMask,
    Residuals,
    NominalTiltSigma,
    TiltCovariance,
    ScaleCovariance,
    Number(usize),
    Count(usize),
    Other(usize),
}

static PLACES: LazyLock<Vec<(&str, Place)>> = LazyLock::new(|| {
    let mut places = vec![
        ("keypoints_2d", Place::KeypointsGiven),
        ("bboxes", Place::BoxesGiven),
        ("status", Place::Status),
        ("ok", Place::Ok),
        ("stop_reason", Place::StopReason),
        ("solver", Place::Solver),
        ("inlier_mask", Place::InlierMask),
        ("residuals", Place::Residuals),
        ("nominal_tilt_sigma", Place::NominalTiltSigma),
        ("tilt_covariance", Place::TiltCovariance),
        ("scale_covariance", Place::ScaleCovariance),
    ];
    places.extend(NUMBERS.iter().enumerate().map(|(k, field)| (field.name, Place::Number(k))));
    places.extend(COUNTS.iter().enumerate().map(|(k, field)| (field.name, Place::Count(k))));
    places.extend(OTHERS.iter().enumerate().map(|(k, field)| (field.name, Place::Other(k))));
    places
});

/// Some objects' part of a column.
struct ColumnRows<'a, T: 'static> {
    field: &'static Field<Estimate, T>,
    size: usize,
    /// What stands for no answer.
    empty: T,
    values: &'a mut [T],
}

/// A column for each field.
fn columns<T: Copy + Default + Element>(py: Python<'_>, fields: &[Field<Estimate, T>], size: Size) -> Vec<Values<T>> {
    let column = |field: &Field<Estimate, T>| {
        let shape = size.of((field.shape)(size.modes));
        if !size.is_compact {
            Values::new(py, &shape)
        } else if is_made_again(field.name) {
            Values::none()
        } else {
            Values::of_numpy(py, &shape)
        }
    };
    fields.iter().map(column).collect()
}

fn lend_all<'a, 'py, T: Copy + Default + Element>(
    columns: &'a mut [Values<T>],
    py: Python<'py>,
) -> PyResult<Vec<Lent<'a, 'py, T>>> {
    columns.iter_mut().map(|column| column.lend(py)).collect()
}

/// How large a batch is.
#[derive(Clone, Copy)]
pub(super) struct Size {
    pub(super) objects: usize,
    pub(super) keypoints: usize,
    pub(super) modes: usize,
    /// Whether residuals and covariances are left out, which are made again when they are asked for.
    pub(super) is_compact: bool,
}

impl Size {
    /// A shape with a row for each object.
    pub(super) fn of(self, row: Vec<usize>) -> Vec<usize> {
        [vec![self.objects], row].concat()
    }

    /// Residuals kept of an object.
    fn residuals(self) -> usize {
        if self.is_compact { 0 } else { self.keypoints }
    }
}

/// How many numbers an array of a shape has.
fn numbers(shape: Vec<usize>) -> usize {
    shape.iter().product()
}

impl<'a, T: Copy> ColumnRows<'a, T> {
    fn all<'py>(
        fields: &'static [Field<Estimate, T>],
        size: Size,
        lent: &'a mut [Lent<'_, 'py, T>],
        empty: T,
    ) -> PyResult<Vec<Self>>
    where
        T: Element,
    {
        let column = |(field, lent): (&'static Field<Estimate, T>, &'a mut Lent<'_, 'py, T>)| {
            Ok(Self { field, size: numbers((field.shape)(size.modes)), empty, values: lent.slice()? })
        };
        let is_kept = |field: &Field<Estimate, T>| !(size.is_compact && is_made_again(field.name));
        fields.iter().zip(lent).filter(|(field, _)| is_kept(field)).map(column).collect()
    }

    fn split_at(self, k: usize) -> (Self, Self) {
        let (left, right) = self.values.split_at_mut(k * self.size);
        (Self { values: left, ..self }, ColumnRows { values: right, ..self })
    }

    fn store(&mut self, k: usize, answer: &Answer) {
        let row = &mut self.values[k * self.size..(k + 1) * self.size];
        match answer {
            Ok(estimate) => (self.field.write)(estimate, row),
            Err(_) => row.fill(self.empty),
        }
    }
}

/// Arrays of results, beside copies of what was given.
pub(super) struct Outputs {
    size: Size,
    keypoints_2d: Points,
    bboxes: Values<f64>,
    status: Values<u8>,
    stop_reason: Values<u8>,
    solver: Values<u8>,
    inlier_mask: Values<bool>,
    residuals: Values<f64>,
    numbers: Vec<Values<f64>>,
    counts: Vec<Values<u32>>,
    others: Mutex<Vec<Other>>,
    frame_tilt_sigma: f64,
    /// Whether something is still to be made from what is here.
    is_pending: bool,
}

/// All arrays while they are written.
pub(super) struct Writing<'a, 'py> {
    size: Size,
    keypoints_2d: LentPoints<'a, 'py>,
    bboxes: Lent<'a, 'py, f64>,
    status: Lent<'a, 'py, u8>,
    stop_reason: Lent<'a, 'py, u8>,
    solver: Lent<'a, 'py, u8>,
    inlier_mask: Lent<'a, 'py, bool>,
    residuals: Lent<'a, 'py, f64>,
    numbers: Vec<Lent<'a, 'py, f64>>,
    counts: Vec<Lent<'a, 'py, u32>>,
    others: &'a Mutex<Vec<Other>>,
}

/// The rows of some objects in all arrays.
pub(super) struct Rows<'a> {
    first: usize,
    size: Size,
    keypoints_2d: PointRows<'a>,
    bboxes: &'a mut [[f64; 4]],
    status: &'a mut [u8],
    stop_reason: &'a mut [u8],
    solver: &'a mut [u8],
    inlier_mask: &'a mut [bool],
    residuals: &'a mut [f64],
    numbers: Vec<ColumnRows<'a, f64>>,
    counts: Vec<ColumnRows<'a, u32>>,
    others: &'a Mutex<Vec<Other>>,
}

impl Rows<'_> {
    /// Copies what was given of object `k` of these; the copies are what is worked on.
    pub(super) fn keep(&mut self, k: usize, keypoints: &[[f64; 2]], bbox: [f64; 4]) -> &[[f64; 2]] {
        self.bboxes[k] = bbox;
        self.keypoints_2d.keep(k * self.size.keypoints, keypoints)
    }
}

impl Places for Rows<'_> {
    fn len(&self) -> usize {
        self.status.len()
    }

    fn split_at(self, k: usize) -> (Self, Self) {
        let (keypoints_2d, keypoints_2d_of_others) = self.keypoints_2d.split_at(k * self.size.keypoints);
        let (bboxes, bboxes_of_others) = self.bboxes.split_at_mut(k);
        let (status, status_of_others) = self.status.split_at_mut(k);
        let (stop_reason, stop_reason_of_others) = self.stop_reason.split_at_mut(k);
        let (solver, solver_of_others) = self.solver.split_at_mut(k);
        let (inlier_mask, inlier_mask_of_others) = self.inlier_mask.split_at_mut(k * self.size.residuals());
        let (residuals, residuals_of_others) = self.residuals.split_at_mut(k * self.size.residuals());
        let (numbers, numbers_of_others) = self.numbers.into_iter().map(|column| column.split_at(k)).unzip();
        let (counts, counts_of_others) = self.counts.into_iter().map(|column| column.split_at(k)).unzip();
        let these = Rows {
            first: self.first,
            size: self.size,
            keypoints_2d,
            bboxes,
            status,
            stop_reason,
            solver,
            inlier_mask,
            residuals,
            numbers,
            counts,
            others: self.others,
        };
        let others = Rows {
            first: self.first + k,
            size: self.size,
            keypoints_2d: keypoints_2d_of_others,
            bboxes: bboxes_of_others,
            status: status_of_others,
            stop_reason: stop_reason_of_others,
            solver: solver_of_others,
            inlier_mask: inlier_mask_of_others,
            residuals: residuals_of_others,
            numbers: numbers_of_others,
            counts: counts_of_others,
            others: self.others,
        };
        (these, others)
    }
}

impl Answers for Rows<'_> {
    fn store(&mut self, k: usize, answer: Answer, residuals: &[f64]) {
        self.numbers.iter_mut().for_each(|column| column.store(k, &answer));
        self.counts.iter_mut().for_each(|column| column.store(k, &answer));
        if !self.size.is_compact {
            let row = k * self.size.keypoints..(k + 1) * self.size.keypoints;
            let found = answer.as_ref().ok().map(|estimate| (residuals, estimate.inlier_threshold));
            store_residuals(found, &mut self.residuals[row.clone()], &mut self.inlier_mask[row]);
        }
        match answer {
            Err(reason) => self.status[k] = reason as u8,
            Ok(estimate) => {
                self.stop_reason[k] = estimate.ransac.stop_reason as u8;
                self.solver[k] = estimate.solver as u8;
                if let Some(other) = &estimate.alternative {
                    let other = Other::new(self.first + k, other);
                    self.others.lock().unwrap_or_else(PoisonError::into_inner).push(other);
                }
            }
        }
    }
}

/// Residuals of the model's keypoints and a threshold, if there is an answer, in rows that may be longer.
pub(super) fn store_residuals(found: Option<(&[f64], f64)>, out: &mut [f64], mask: &mut [bool]) {
    let (residuals, threshold) = found.unwrap_or((&[], f64::NAN));
    let (own, beyond) = out.split_at_mut(residuals.len());
    own.copy_from_slice(residuals);
    beyond.fill(f64::NAN);
    for (mask, &residual) in mask.iter_mut().zip(&*out) {
        *mask = residual <= threshold;
    }
}

impl Writing<'_, '_> {
    pub(super) fn rows(&mut self) -> PyResult<Rows<'_>> {
        Ok(Rows {
            first: 0,
            size: self.size,
            keypoints_2d: self.keypoints_2d.rows()?,
            bboxes: self.bboxes.slice()?.as_chunks_mut().0,
            status: self.status.slice()?,
            stop_reason: self.stop_reason.slice()?,
            solver: self.solver.slice()?,
            inlier_mask: self.inlier_mask.slice()?,
            residuals: self.residuals.slice()?,
            numbers: ColumnRows::all(&NUMBERS, self.size, &mut self.numbers, f64::NAN)?,
            counts: ColumnRows::all(&COUNTS, self.size, &mut self.counts, 0)?,
            others: self.others,
        })
    }
}

impl Outputs {
    /// Of a frame whose tilt has this standard deviation (NaN: none); `keypoints_2d` are what is given.
    pub(super) fn new(py: Python<'_>, size: Size, keypoints_2d: &[[f64; 2]], frame_tilt_sigma: f64) -> Self {
        let (bboxes, points) = (size.of(vec![4]), size.of(vec![size.keypoints, 2]));
        let (one, measured) = ([size.objects], [size.objects, size.residuals()]);
        Self {
            size,
            keypoints_2d: match size.is_compact {
                true => Points::compact(py, &points, keypoints_2d),
                false => Points::new(py, &points),
            },
            bboxes: if size.is_compact { Values::of_numpy(py, &bboxes) } else { Values::new(py, &bboxes) },
            status: Values::new(py, &one),
            stop_reason: Values::new(py, &one),
            solver: Values::new(py, &one),
            inlier_mask: Values::new(py, &measured),
            residuals: Values::new(py, &measured),
            numbers: columns(py, &NUMBERS, size),
            counts: columns(py, &COUNTS, size),
            others: Mutex::default(),
            frame_tilt_sigma,
            is_pending: size.is_compact,
        }
    }

    pub(super) fn writing<'a, 'py>(&'a mut self, py: Python<'py>) -> PyResult<Writing<'a, 'py>> {
        Ok(Writing {
            size: self.size,
            keypoints_2d: self.keypoints_2d.lend(py)?,
            bboxes: self.bboxes.lend(py)?,
            status: self.status.lend(py)?,
            stop_reason: self.stop_reason.lend(py)?,
            solver: self.solver.lend(py)?,
            inlier_mask: self.inlier_mask.lend(py)?,
            residuals: self.residuals.lend(py)?,
            numbers: lend_all(&mut self.numbers, py)?,
            counts: lend_all(&mut self.counts, py)?,
            others: &self.others,
        })
    }

    /// Names of the fields.
    pub(super) fn names() -> Vec<&'static str> {
        PLACES.iter().map(|(name, _)| *name).collect()
    }

    /// Whether a field is still to be made from others.
    pub(super) fn is_missing(&self, name: &str) -> bool {
        self.is_pending && (matches!(name, "residuals" | "inlier_mask") || is_made_again(name))
    }

    /// What the rest is made from, while there is something to be made.
    pub(super) fn kept(&self, py: Python<'_>) -> Option<Kept> {
        if !self.is_pending {
            return None;
        }
        let number = |name| {
            let k = NUMBERS.iter().position(|field| field.name == name)?;
            self.numbers[k].shared(py)
        };
        Some(Kept {
            size: self.size,
            keypoints_2d: self.keypoints_2d.shared(py)?,
            bboxes: self.bboxes.shared(py)?,
            solver: self.solver.bytes(py),
            status: self.status.bytes(py),
            r: number("R")?,
            t: number("t")?,
            thresholds: number("inlier_threshold")?,
            noise_sigma: number("noise_sigma")?,
            coefficients: number("shape_coefficients")?,
        })
    }

    /// Takes what was made, unless somebody was faster.
    pub(super) fn complete(&mut self, made: Made) {
        if !std::mem::take(&mut self.is_pending) {
            return;
        }
        (self.residuals, self.inlier_mask) = (made.residuals, made.inlier_mask);
        for (name, values) in zip(COVARIANCES, made.covariances) {
            if let Some(k) = NUMBERS.iter().position(|field| field.name == name) {
                self.numbers[k] = values;
            }
        }
    }

    /// The array of a field; none of another name. What something is still to be made from is given as a copy.
    pub(super) fn array<'py>(&mut self, py: Python<'py>, name: &str) -> PyResult<Option<Any<'py>>> {
        let place = PLACES.iter().find(|(known, _)| *known == name);
        place.map(|&(_, place)| self.at(py, place)).transpose()
    }

    /// Adds the arrays of all fields that a dictionary does not have.
    pub(super) fn fill(&mut self, fields: &Bound<'_, PyDict>) -> PyResult<()> {
        let py = fields.py();
        for &(name, place) in PLACES.iter() {
            let name = PyString::intern(py, name);
            if !fields.contains(&name)? {
                fields.set_item(name, self.at(py, place)?)?;
            }
        }
        Ok(())
    }

    fn at<'py>(&mut self, py: Python<'py>, place: Place) -> PyResult<Any<'py>> {
        let size = self.size;
        let per_keypoint = || size.of(vec![size.keypoints]);
        Ok(match place {
            Place::KeypointsGiven => {
                let (shape, points) = (size.of(vec![size.keypoints, 2]), &mut self.keypoints_2d);
                if self.is_pending { points.copy(py, &shape)? } else { points.array(py, &shape)? }.into_any()
            }
            Place::BoxesGiven => given(py, &mut self.bboxes, &size.of(vec![4]), self.is_pending)?,
            Place::Status => words::status(py, &self.status.bytes(py)),
            Place::StopReason => words::stop_reason(py, &self.stop_reason.bytes(py)),
            Place::Solver => words::solver(py, &self.solver.bytes(py)),
            Place::Ok => {
                let ok = self.status.bytes(py).iter().map(|&status| status == 0).collect::<Vec<_>>();
                ok.into_pyarray(py).into_any()
            }
            Place::InlierMask => self.inlier_mask.array(py, &per_keypoint())?.into_any(),
            Place::Residuals => self.residuals.array(py, &per_keypoint())?.into_any(),
            Place::NominalTiltSigma => filled(py, [2], self.frame_tilt_sigma),
            Place::TiltCovariance => filled(py, [2, 2], f64::NAN),
            Place::ScaleCovariance => filled(py, [size.objects, size.modes + 1], 0.0),
            Place::Number(k) => {
                let (field, shape) = (&NUMBERS[k], size.of((NUMBERS[k].shape)(size.modes)));
                given(py, &mut self.numbers[k], &shape, self.is_pending && is_needed_again(field.name))?
            }
            Place::Count(k) => self.counts[k].widened(py, &size.of((COUNTS[k].shape)(size.modes)))?.into_any(),
            Place::Other(k) => self.of_others(py, &OTHERS[k])?,
        })
    }

    /// A field of the other readings; NaN where there is none.
    fn of_others<'py>(&self, py: Python<'py>, field: &Field<Other, f64>) -> PyResult<Any<'py>> {
        let shape = (field.shape)(self.size.modes);
        let (size, shape) = (numbers(shape.clone()), self.size.of(shape));
        let mut values = Values::new(py, &shape);
        let mut lent = values.lend(py)?;
        let rows = lent.slice()?;
        rows.fill(f64::NAN);
        for other in self.others.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            (field.write)(other, &mut rows[other.object * size..(other.object + 1) * size]);
        }
        drop(lent);
        Ok(values.array(py, &shape)?.into_any())
    }
}

/// The array of a field, or a copy of it.
fn given<'py, T: Element + Copy + Default>(
    py: Python<'py>,
    values: &mut Values<T>,
    shape: &[usize],
    as_a_copy: bool,
) -> PyResult<Any<'py>> {
    Ok(if as_a_copy { values.copy(py, shape)? } else { values.array(py, shape)? }.into_any())
}

/// An array of one number.
fn filled<const N: usize>(py: Python<'_>, shape: [usize; N], number: f64) -> Any<'_>
where
    [usize; N]: numpy::ndarray::IntoDimension,
{
    Array::from_elem(shape, number).into_pyarray(py).into_any()
}
