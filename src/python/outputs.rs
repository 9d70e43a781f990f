//! Results of a batch: one array a field, written row by row while its objects are estimated.

use std::sync::{Mutex, PoisonError};

use numpy::{Element, PyArrayMethods};
use pyo3::prelude::*;

use super::fields::{COUNTS, Field, NUMBERS, OTHERS, Other};
use super::values::{Lent, Values};
use crate::estimate::answers::{Answer, Answers};
use crate::estimate::describe::Estimate;

/// Some objects' part of a column.
struct ColumnRows<'a, T: 'static> {
    field: &'static Field<Estimate, T>,
    size: usize,
    /// What stands for no answer.
    empty: T,
    values: &'a mut [T],
}

/// A column for each field.
fn columns<T: Copy + Default + Element>(
    py: Python<'_>,
    fields: &[Field<Estimate, T>],
    objects: usize,
    modes: usize,
) -> Vec<Values<T>> {
    fields.iter().map(|field| Values::new(py, objects * numbers((field.shape)(modes)))).collect()
}

fn lend_all<'a, 'py, T: Copy + Default + Element>(
    columns: &'a mut [Values<T>],
    py: Python<'py>,
) -> PyResult<Vec<Lent<'a, 'py, T>>> {
    columns.iter_mut().map(|column| column.lend(py)).collect()
}

/// How many numbers an array of a shape has.
fn numbers(shape: Vec<usize>) -> usize {
    shape.iter().product()
}

impl<'a, T: Copy> ColumnRows<'a, T> {
    fn all<'py>(
        fields: &'static [Field<Estimate, T>],
        modes: usize,
        lent: &'a mut [Lent<'_, 'py, T>],
        empty: T,
    ) -> PyResult<Vec<Self>>
    where
        T: Element,
    {
        let column = |(field, lent): (&'static Field<Estimate, T>, &'a mut Lent<'_, 'py, T>)| {
            Ok(Self { field, size: numbers((field.shape)(modes)), empty, values: lent.slice()? })
        };
        fields.iter().zip(lent).map(column).collect()
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
    objects: usize,
    keypoints: usize,
    modes: usize,
    keypoints_2d: Values<f64>,
    bboxes: Values<f64>,
    status: Values<u8>,
    stop_reason: Values<u8>,
    solver: Values<u8>,
    inlier_mask: Values<bool>,
    residuals: Values<f64>,
    numbers: Vec<Values<f64>>,
    counts: Vec<Values<i64>>,
    others: Mutex<Vec<Other>>,
}

/// All arrays while they are written.
pub(super) struct Writing<'a, 'py> {
    keypoints: usize,
    modes: usize,
    keypoints_2d: Lent<'a, 'py, f64>,
    bboxes: Lent<'a, 'py, f64>,
    status: Lent<'a, 'py, u8>,
    stop_reason: Lent<'a, 'py, u8>,
    solver: Lent<'a, 'py, u8>,
    inlier_mask: Lent<'a, 'py, bool>,
    residuals: Lent<'a, 'py, f64>,
    numbers: Vec<Lent<'a, 'py, f64>>,
    counts: Vec<Lent<'a, 'py, i64>>,
    others: &'a Mutex<Vec<Other>>,
}

/// The rows of some objects in all arrays.
pub(super) struct Rows<'a> {
    first: usize,
    keypoints: usize,
    keypoints_2d: &'a mut [[f64; 2]],
    bboxes: &'a mut [[f64; 4]],
    status: &'a mut [u8],
    stop_reason: &'a mut [u8],
    solver: &'a mut [u8],
    inlier_mask: &'a mut [bool],
    residuals: &'a mut [f64],
    numbers: Vec<ColumnRows<'a, f64>>,
    counts: Vec<ColumnRows<'a, i64>>,
    others: &'a Mutex<Vec<Other>>,
}

impl Rows<'_> {
    /// Copies what was given of object `k` of these; the copies are what is worked on.
    pub(super) fn keep(&mut self, k: usize, keypoints: &[[f64; 2]], bbox: [f64; 4]) -> &[[f64; 2]] {
        self.bboxes[k] = bbox;
        let copy = &mut self.keypoints_2d[k * self.keypoints..(k + 1) * self.keypoints];
        copy.copy_from_slice(keypoints);
        copy
    }
}

impl Answers for Rows<'_> {
    fn len(&self) -> usize {
        self.status.len()
    }

    fn split_at(self, k: usize) -> (Self, Self) {
        let (keypoints_2d, keypoints_2d_of_others) = self.keypoints_2d.split_at_mut(k * self.keypoints);
        let (bboxes, bboxes_of_others) = self.bboxes.split_at_mut(k);
        let (status, status_of_others) = self.status.split_at_mut(k);
        let (stop_reason, stop_reason_of_others) = self.stop_reason.split_at_mut(k);
        let (solver, solver_of_others) = self.solver.split_at_mut(k);
        let (inlier_mask, inlier_mask_of_others) = self.inlier_mask.split_at_mut(k * self.keypoints);
        let (residuals, residuals_of_others) = self.residuals.split_at_mut(k * self.keypoints);
        let (numbers, numbers_of_others) = self.numbers.into_iter().map(|column| column.split_at(k)).unzip();
        let (counts, counts_of_others) = self.counts.into_iter().map(|column| column.split_at(k)).unzip();
        let these = Rows {
            first: self.first,
            keypoints: self.keypoints,
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
            keypoints: self.keypoints,
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

    fn store(&mut self, k: usize, answer: Answer, residuals: &[f64]) {
        self.numbers.iter_mut().for_each(|column| column.store(k, &answer));
        self.counts.iter_mut().for_each(|column| column.store(k, &answer));
        let row = k * self.keypoints..(k + 1) * self.keypoints;
        let (mask, out) = (&mut self.inlier_mask[row.clone()], &mut self.residuals[row]);
        match answer {
            Err(reason) => {
                out.fill(f64::NAN);
                self.status[k] = reason as u8;
            }
            Ok(estimate) => {
                let (own, beyond) = out.split_at_mut(residuals.len());
                own.copy_from_slice(residuals);
                beyond.fill(f64::NAN);
                for (mask, &residual) in mask.iter_mut().zip(&*out) {
                    *mask = residual <= estimate.inlier_threshold;
                }
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

impl Writing<'_, '_> {
    pub(super) fn rows(&mut self) -> PyResult<Rows<'_>> {
        Ok(Rows {
            first: 0,
            keypoints: self.keypoints,
            keypoints_2d: self.keypoints_2d.slice()?.as_chunks_mut().0,
            bboxes: self.bboxes.slice()?.as_chunks_mut().0,
            status: self.status.slice()?,
            stop_reason: self.stop_reason.slice()?,
            solver: self.solver.slice()?,
            inlier_mask: self.inlier_mask.slice()?,
            residuals: self.residuals.slice()?,
            numbers: ColumnRows::all(&NUMBERS, self.modes, &mut self.numbers, f64::NAN)?,
            counts: ColumnRows::all(&COUNTS, self.modes, &mut self.counts, 0)?,
            others: self.others,
        })
    }
}

impl Outputs {
    pub(super) fn new(py: Python<'_>, objects: usize, keypoints: usize, modes: usize) -> Self {
        Self {
            objects,
            keypoints,
            modes,
            keypoints_2d: Values::new(py, objects * keypoints * 2),
            bboxes: Values::new(py, objects * 4),
            status: Values::new(py, objects),
            stop_reason: Values::new(py, objects),
            solver: Values::new(py, objects),
            inlier_mask: Values::new(py, objects * keypoints),
            residuals: Values::new(py, objects * keypoints),
            numbers: columns(py, &NUMBERS, objects, modes),
            counts: columns(py, &COUNTS, objects, modes),
            others: Mutex::default(),
        }
    }

    pub(super) fn writing<'a, 'py>(&'a mut self, py: Python<'py>) -> PyResult<Writing<'a, 'py>> {
        Ok(Writing {
            keypoints: self.keypoints,
            modes: self.modes,
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
        let mut names = vec!["keypoints_2d", "bboxes", "status", "stop_reason", "solver", "inlier_mask", "residuals"];
        names.extend(NUMBERS.iter().map(|field| field.name));
        names.extend(COUNTS.iter().map(|field| field.name));
        names.extend(OTHERS.iter().map(|field| field.name));
        names
    }

    /// The array of a field; none of another name.
    pub(super) fn array<'py>(&mut self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let per_keypoint = vec![self.keypoints];
        match name {
            "keypoints_2d" => self.shaped(py, |o| &mut o.keypoints_2d, vec![self.keypoints, 2]),
            "bboxes" => self.shaped(py, |o| &mut o.bboxes, vec![4]),
            "status" => self.shaped(py, |o| &mut o.status, vec![]),
            "stop_reason" => self.shaped(py, |o| &mut o.stop_reason, vec![]),
            "solver" => self.shaped(py, |o| &mut o.solver, vec![]),
            "inlier_mask" => self.shaped(py, |o| &mut o.inlier_mask, per_keypoint),
            "residuals" => self.shaped(py, |o| &mut o.residuals, per_keypoint),
            _ => {
                if let Some(k) = NUMBERS.iter().position(|field| field.name == name) {
                    self.shaped(py, |o| &mut o.numbers[k], (NUMBERS[k].shape)(self.modes))
                } else if let Some(k) = COUNTS.iter().position(|field| field.name == name) {
                    self.shaped(py, |o| &mut o.counts[k], (COUNTS[k].shape)(self.modes))
                } else if let Some(field) = OTHERS.iter().find(|field| field.name == name) {
                    self.of_others(py, field).map(Some)
                } else {
                    Ok(None)
                }
            }
        }
    }

    /// Values as an array with a row for each object.
    fn shaped<'py, T: Element + Copy + Default>(
        &mut self,
        py: Python<'py>,
        values: impl FnOnce(&mut Self) -> &mut Values<T>,
        shape: Vec<usize>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let objects = self.objects;
        let array = values(self).array(py);
        Ok(Some(if shape.is_empty() {
            array.into_any()
        } else {
            array.reshape([vec![objects], shape].concat())?.into_any()
        }))
    }

    /// A field of the other readings; NaN where there is none.
    fn of_others<'py>(&self, py: Python<'py>, field: &Field<Other, f64>) -> PyResult<Bound<'py, PyAny>> {
        let shape = (field.shape)(self.modes);
        let size = numbers(shape.clone());
        let mut values = Values::new(py, self.objects * size);
        let mut lent = values.lend(py)?;
        let rows = lent.slice()?;
        rows.fill(f64::NAN);
        for other in self.others.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            (field.write)(other, &mut rows[other.object * size..(other.object + 1) * size]);
        }
        drop(lent);
        Ok(values.array(py).reshape([vec![self.objects], shape].concat())?.into_any())
    }
}
