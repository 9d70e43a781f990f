//! Results of a batch: one array a field, written row by row while its objects are estimated.

use std::sync::Arc;

use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::classes::ModelData;
use crate::estimate::alternative::Alternative;
use crate::estimate::batch::{Answer, Answers};
use crate::estimate::describe::Estimate;
use crate::estimate::probability::EVIDENCE;
use crate::refine::covariance::PoseCovariance;
use crate::refine::schedule::MAX_STAGES;

/// One output array of numbers: its name, its shape for one object, and how an estimate fills it.
struct Field<T> {
    name: &'static str,
    shape: fn(modes: usize) -> Vec<usize>,
    write: fn(&Estimate, &mut [T]),
}

const NUMBERS: [Field<f64>; 22] = [
    Field { name: "R", shape: |_| vec![3, 3], write: |e, out| out.copy_from_slice(e.pose.r.transpose().as_slice()) },
    Field { name: "t", shape: |_| vec![3], write: |e, out| out.copy_from_slice(e.pose.t.as_slice()) },
    Field { name: "yaw", shape: |_| vec![], write: |e, out| out[0] = e.yaw },
    Field { name: "reprojection_rmse", shape: |_| vec![], write: |e, out| out[0] = e.reprojection_rmse },
    Field { name: "score", shape: |_| vec![], write: |e, out| out[0] = e.score },
    Field { name: "inlier_threshold", shape: |_| vec![], write: |e, out| out[0] = e.inlier_threshold },
    Field { name: "noise_sigma", shape: |_| vec![], write: |e, out| out[0] = e.noise_sigma },
    Field { name: "confidence", shape: |_| vec![], write: |e, out| out[0] = e.ransac.confidence },
    Field { name: "log10_nfa", shape: |_| vec![], write: |e, out| out[0] = e.log10_nfa },
    Field { name: "ambiguity", shape: |_| vec![], write: |e, out| out[0] = e.ambiguity },
    Field { name: "probability", shape: |_| vec![], write: |e, out| out[0] = e.probability },
    Field { name: "evidence", shape: |_| vec![EVIDENCE], write: |e, out| out.copy_from_slice(&e.evidence) },
    Field {
        name: "alternative_R",
        shape: |_| vec![3, 3],
        write: |e, out| of_other(e, out, |other, out| out.copy_from_slice(other.pose.r.transpose().as_slice())),
    },
    Field {
        name: "alternative_t",
        shape: |_| vec![3],
        write: |e, out| of_other(e, out, |other, out| out.copy_from_slice(other.pose.t.as_slice())),
    },
    Field {
        name: "alternative_yaw",
        shape: |_| vec![],
        write: |e, out| of_other(e, out, |other, out| out[0] = other.yaw),
    },
    Field {
        name: "alternative_covariance",
        shape: |_| vec![6, 6],
        write: |e, out| of_other(e, out, |other, out| write_covariance(other.covariance.as_ref(), out)),
    },
    Field {
        name: "alternative_probability",
        shape: |_| vec![],
        write: |e, out| of_other(e, out, |other, out| out[0] = other.probability),
    },
    Field { name: "covariance", shape: |_| vec![6, 6], write: |e, out| write_covariance(e.covariance.as_ref(), out) },
    Field {
        name: "shape_coefficients",
        shape: |modes| vec![modes],
        write: |e, out| out.copy_from_slice(&e.shape_coefficients[..out.len()]),
    },
    Field { name: "shape_covariance", shape: |modes| vec![modes, modes], write: write_shape_covariance },
    Field {
        name: "shape_pose_covariance",
        shape: |modes| vec![modes, 6],
        write: |e, out| match &e.shape_pose_covariance {
            Some(between) => (0..out.len()).for_each(|k| out[k] = between[(k / 6, k % 6)]),
            None => out.fill(f64::NAN),
        },
    },
    Field {
        name: "stage_costs",
        shape: |_| vec![MAX_STAGES],
        write: |e, out| out.copy_from_slice(&e.stages.map(|s| s.cost)),
    },
];

const COUNTS: [Field<i64>; 4] = [
    Field { name: "inlier_count", shape: |_| vec![], write: |e, out| out[0] = e.inlier_count as i64 },
    Field { name: "iterations", shape: |_| vec![], write: |e, out| out[0] = e.ransac.iterations as i64 },
    Field { name: "hypotheses", shape: |_| vec![], write: |e, out| out[0] = e.ransac.hypotheses as i64 },
    Field {
        name: "stage_iterations",
        shape: |_| vec![MAX_STAGES],
        write: |e, out| out.copy_from_slice(&e.stages.map(|s| s.iterations as i64)),
    },
];

/// Of the other reading, where there is one.
fn of_other(estimate: &Estimate, out: &mut [f64], write: impl Fn(&Alternative, &mut [f64])) {
    match &estimate.alternative {
        Some(other) => write(other, out),
        None => out.fill(f64::NAN),
    }
}

fn write_covariance(covariance: Option<&PoseCovariance>, out: &mut [f64]) {
    match covariance {
        Some(covariance) => out.copy_from_slice(covariance.as_slice()),
        None => out.fill(f64::NAN),
    }
}

fn write_shape_covariance(estimate: &Estimate, out: &mut [f64]) {
    let modes = out.len().isqrt();
    match &estimate.shape_covariance {
        Some(covariance) => (0..out.len()).for_each(|k| out[k] = covariance[(k / modes, k % modes)]),
        None => out.fill(f64::NAN),
    }
}

/// An array of results in the making.
struct Column<T: 'static> {
    field: &'static Field<T>,
    shape: Vec<usize>,
    size: usize,
    /// What stands for no answer.
    empty: T,
    values: Vec<T>,
}

/// Some objects' part of a column.
struct ColumnRows<'a, T: 'static> {
    field: &'static Field<T>,
    size: usize,
    empty: T,
    values: &'a mut [T],
}

impl<T: Copy + Default + numpy::Element> Column<T> {
    fn all(fields: &'static [Field<T>], objects: usize, modes: usize, empty: T) -> Vec<Self> {
        let column = |field: &'static Field<T>| {
            let shape = (field.shape)(modes);
            let size = shape.iter().product();
            // Zeros cost nothing before they are written to: every row is.
            let values = vec![T::default(); objects * size];
            Self { field, shape: [vec![objects], shape].concat(), size, empty, values }
        };
        fields.iter().map(column).collect()
    }

    fn rows(&mut self) -> ColumnRows<'_, T> {
        ColumnRows { field: self.field, size: self.size, empty: self.empty, values: &mut self.values }
    }

    fn add_to(self, dict: &Bound<'_, PyDict>) -> PyResult<()> {
        dict.set_item(self.field.name, self.values.into_pyarray(dict.py()).reshape(self.shape)?)
    }
}

impl<'a, T: Copy> ColumnRows<'a, T> {
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

/// Arrays of results.
pub(super) struct Outputs {
    objects: usize,
    keypoints: usize,
    status: Vec<u8>,
    stop_reason: Vec<u8>,
    solver: Vec<u8>,
    inlier_mask: Vec<bool>,
    residuals: Vec<f64>,
    numbers: Vec<Column<f64>>,
    counts: Vec<Column<i64>>,
}

/// The rows of some objects in all arrays.
pub(super) struct Rows<'a> {
    keypoints: usize,
    status: &'a mut [u8],
    stop_reason: &'a mut [u8],
    solver: &'a mut [u8],
    inlier_mask: &'a mut [bool],
    residuals: &'a mut [f64],
    numbers: Vec<ColumnRows<'a, f64>>,
    counts: Vec<ColumnRows<'a, i64>>,
}

impl Answers for Rows<'_> {
    fn len(&self) -> usize {
        self.status.len()
    }

    fn split_at(self, k: usize) -> (Self, Self) {
        let (status, status_of_others) = self.status.split_at_mut(k);
        let (stop_reason, stop_reason_of_others) = self.stop_reason.split_at_mut(k);
        let (solver, solver_of_others) = self.solver.split_at_mut(k);
        let (inlier_mask, inlier_mask_of_others) = self.inlier_mask.split_at_mut(k * self.keypoints);
        let (residuals, residuals_of_others) = self.residuals.split_at_mut(k * self.keypoints);
        let (numbers, numbers_of_others) = self.numbers.into_iter().map(|column| column.split_at(k)).unzip();
        let (counts, counts_of_others) = self.counts.into_iter().map(|column| column.split_at(k)).unzip();
        let these =
            Rows { keypoints: self.keypoints, status, stop_reason, solver, inlier_mask, residuals, numbers, counts };
        let others = Rows {
            keypoints: self.keypoints,
            status: status_of_others,
            stop_reason: stop_reason_of_others,
            solver: solver_of_others,
            inlier_mask: inlier_mask_of_others,
            residuals: residuals_of_others,
            numbers: numbers_of_others,
            counts: counts_of_others,
        };
        (these, others)
    }

    fn store(&mut self, k: usize, answer: Answer, residuals: &[f64]) {
        self.numbers.iter_mut().for_each(|column| column.store(k, &answer));
        self.counts.iter_mut().for_each(|column| column.store(k, &answer));
        let row = k * self.keypoints..(k + 1) * self.keypoints;
        let (mask, out) = (&mut self.inlier_mask[row.clone()], &mut self.residuals[row]);
        out.fill(f64::NAN);
        match answer {
            Err(reason) => self.status[k] = reason as u8,
            Ok(estimate) => {
                out[..residuals.len()].copy_from_slice(residuals);
                for (mask, &residual) in mask.iter_mut().zip(&*out) {
                    *mask = residual <= estimate.inlier_threshold;
                }
                self.stop_reason[k] = estimate.ransac.stop_reason as u8;
                self.solver[k] = estimate.solver as u8;
            }
        }
    }
}

impl Outputs {
    pub(super) fn new(objects: usize, keypoints: usize, models: &[Arc<ModelData>]) -> Self {
        let modes = models.iter().map(|m| m.modes()).max().unwrap_or(0);
        Self {
            objects,
            keypoints,
            status: vec![0; objects],
            stop_reason: vec![0; objects],
            solver: vec![0; objects],
            inlier_mask: vec![false; objects * keypoints],
            residuals: vec![0.0; objects * keypoints],
            numbers: Column::all(&NUMBERS, objects, modes, f64::NAN),
            counts: Column::all(&COUNTS, objects, modes, 0),
        }
    }

    pub(super) fn rows(&mut self) -> Rows<'_> {
        Rows {
            keypoints: self.keypoints,
            status: &mut self.status,
            stop_reason: &mut self.stop_reason,
            solver: &mut self.solver,
            inlier_mask: &mut self.inlier_mask,
            residuals: &mut self.residuals,
            numbers: self.numbers.iter_mut().map(Column::rows).collect(),
            counts: self.counts.iter_mut().map(Column::rows).collect(),
        }
    }

    pub(super) fn add_to(self, dict: &Bound<'_, PyDict>) -> PyResult<()> {
        let py = dict.py();
        let per_keypoint = [self.objects, self.keypoints];
        for (name, values) in [("status", self.status), ("stop_reason", self.stop_reason), ("solver", self.solver)] {
            dict.set_item(name, values.into_pyarray(py))?;
        }
        self.numbers.into_iter().try_for_each(|column| column.add_to(dict))?;
        self.counts.into_iter().try_for_each(|column| column.add_to(dict))?;
        dict.set_item("inlier_mask", self.inlier_mask.into_pyarray(py).reshape(per_keypoint)?)?;
        dict.set_item("residuals", self.residuals.into_pyarray(py).reshape(per_keypoint)?)
    }
}
