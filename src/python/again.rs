//! Residuals and covariances of a large batch: not kept, but made when they are asked for, to the bit.

use nalgebra::Matrix3;
use numpy::PyArrayDyn;
use pyo3::prelude::*;

use super::fields::{NUMBERS, write_covariance, write_shape_covariance, write_shape_pose_covariance};
use super::observe::Inputs;
use super::outputs::{Size, store_residuals};
use super::points::{PointSlices, SharedPoints};
use super::values::{Values, read};
use crate::estimate::again::Found;
use crate::estimate::answers::Places;
use crate::estimate::estimator::Estimator;
use crate::estimate::options::Solver;
use crate::estimate::workspace::{GrowingWorkspace, Workspace};
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::model::shape_model::MAX_MODES;
use crate::refine::covariance::Covariances;
use crate::refine::normal::State;

/// Keypoints of a call from which on less is kept: there memory is a matter, and a call's own time is none.
const MANY: usize = 1 << 14;

/// The names of what is made, in the order of `Covariances`.
pub(super) const COVARIANCES: [&str; 3] = ["covariance", "shape_covariance", "shape_pose_covariance"];

/// What the rest is made from. Nobody writes to these arrays: who asks for one of them gets a copy.
pub(super) struct Kept {
    pub(super) size: Size,
    pub(super) keypoints_2d: SharedPoints,
    pub(super) bboxes: Py<PyArrayDyn<f64>>,
    pub(super) status: Vec<u8>,
    pub(super) solver: Vec<u8>,
    pub(super) r: Py<PyArrayDyn<f64>>,
    pub(super) t: Py<PyArrayDyn<f64>>,
    pub(super) thresholds: Py<PyArrayDyn<f64>>,
    pub(super) noise_sigma: Py<PyArrayDyn<f64>>,
    pub(super) coefficients: Py<PyArrayDyn<f64>>,
}

/// What was left out.
pub(super) struct Made {
    pub(super) residuals: Values<f64>,
    pub(super) inlier_mask: Values<bool>,
    pub(super) covariances: [Values<f64>; 3],
}

/// Rows of `Made` for some objects.
pub(super) struct MadeRows<'a> {
    keypoints: usize,
    modes: usize,
    objects: usize,
    residuals: &'a mut [f64],
    inlier_mask: &'a mut [bool],
    pose: &'a mut [[f64; 36]],
    shape: &'a mut [f64],
    between: &'a mut [f64],
}

/// What is read of the answers of all objects.
pub(super) struct Answered<'a> {
    keypoints_2d: PointSlices<'a>,
    status: &'a [u8],
    solver: &'a [u8],
    r: &'a [[f64; 9]],
    t: &'a [[f64; 3]],
    noise_sigma: &'a [f64],
    coefficients: &'a [f64],
    modes: usize,
}

/// Whether a call of so many objects keeps less. A wide lens has views of its own, which are not kept.
pub(super) fn is_compact(objects: usize, keypoints: usize, view: &View) -> bool {
    objects * keypoints >= MANY && !view.camera.lens.is_some_and(|lens| lens.is_wide())
}

impl Kept {
    /// Makes all of it: `work` is given what is read, what else is known of the objects, and the rows.
    pub(super) fn make(
        &self,
        py: Python<'_>,
        rest: Inputs,
        work: impl FnOnce(&Answered, &Inputs, MadeRows) -> PyResult<()>,
    ) -> PyResult<Made> {
        let size = self.size;
        let (points, bboxes) = (self.keypoints_2d.read(py)?, read(py, &self.bboxes)?);
        let (r, t) = (read(py, &self.r)?, read(py, &self.t)?);
        let (noise, coefficients) = (read(py, &self.noise_sigma)?, read(py, &self.coefficients)?);
        let thresholds = read(py, &self.thresholds)?;
        let answered = Answered {
            keypoints_2d: points.slices()?,
            status: &self.status,
            solver: &self.solver,
            r: r.as_slice()?.as_chunks().0,
            t: t.as_slice()?.as_chunks().0,
            noise_sigma: noise.as_slice()?,
            coefficients: coefficients.as_slice()?,
            modes: size.modes,
        };
        let bboxes = Some(bboxes.as_slice()?.as_chunks().0);
        let inputs = Inputs { bboxes, thresholds: Some(thresholds.as_slice()?), ..rest };
        let mut made = Made::new(py, size);
        made.written(py, size, |rows| work(&answered, &inputs, rows))?;
        Ok(made)
    }
}

impl Made {
    fn new(py: Python<'_>, size: Size) -> Self {
        let measured = size.of(vec![size.keypoints]);
        let field = |name| NUMBERS.iter().find(|field| field.name == name);
        let shape = |name| field(name).map_or(vec![], |field| (field.shape)(size.modes));
        Self {
            residuals: Values::new(py, &measured),
            inlier_mask: Values::new(py, &measured),
            covariances: COVARIANCES.map(|name| Values::new(py, &size.of(shape(name)))),
        }
    }

    fn written(&mut self, py: Python<'_>, size: Size, write: impl FnOnce(MadeRows) -> PyResult<()>) -> PyResult<()> {
        let (mut residuals, mut inlier_mask) = (self.residuals.lend(py)?, self.inlier_mask.lend(py)?);
        let [pose, shape, between] = &mut self.covariances;
        let (mut pose, mut shape, mut between) = (pose.lend(py)?, shape.lend(py)?, between.lend(py)?);
        write(MadeRows {
            keypoints: size.keypoints,
            modes: size.modes,
            objects: size.objects,
            residuals: residuals.slice()?,
            inlier_mask: inlier_mask.slice()?,
            pose: pose.slice()?.as_chunks_mut().0,
            shape: shape.slice()?,
            between: between.slice()?,
        })
    }
}

impl Places for MadeRows<'_> {
    fn len(&self) -> usize {
        self.objects
    }

    fn split_at(self, k: usize) -> (Self, Self) {
        let (residuals, residuals_of_others) = self.residuals.split_at_mut(k * self.keypoints);
        let (inlier_mask, inlier_mask_of_others) = self.inlier_mask.split_at_mut(k * self.keypoints);
        let (pose, pose_of_others) = self.pose.split_at_mut(k);
        let (shape, shape_of_others) = self.shape.split_at_mut(k * self.modes * self.modes);
        let (between, between_of_others) = self.between.split_at_mut(k * self.modes * 6);
        let these = MadeRows { objects: k, residuals, inlier_mask, pose, shape, between, ..self };
        let others = MadeRows {
            objects: self.objects - k,
            residuals: residuals_of_others,
            inlier_mask: inlier_mask_of_others,
            pose: pose_of_others,
            shape: shape_of_others,
            between: between_of_others,
            ..self
        };
        (these, others)
    }
}

impl MadeRows<'_> {
    fn store(&mut self, k: usize, found: Option<(&[f64], f64)>, covariances: Option<&Covariances>) {
        let row = k * self.keypoints..(k + 1) * self.keypoints;
        store_residuals(found, &mut self.residuals[row.clone()], &mut self.inlier_mask[row]);
        let (square, oblong) = (self.modes * self.modes, self.modes * 6);
        write_covariance(covariances.map(|c| &c.0), &mut self.pose[k]);
        write_shape_covariance(covariances.map(|c| &c.1), &mut self.shape[k * square..(k + 1) * square]);
        write_shape_pose_covariance(covariances.map(|c| &c.2), &mut self.between[k * oblong..(k + 1) * oblong]);
    }
}

impl Answered<'_> {
    /// What `estimator` would say again of the objects from `first` on, as long as `go_on` says so.
    pub(super) fn write(
        &self,
        (estimator, view, inputs): (&Estimator, &View, &Inputs),
        workspace: &mut GrowingWorkspace,
        first: usize,
        mut rows: MadeRows,
        go_on: &mut dyn FnMut() -> bool,
    ) {
        let mut room = Vec::new();
        for k in 0..rows.objects {
            if !go_on() {
                return;
            }
            let i = first + k;
            let keypoints = self.keypoints_2d.of(i * rows.keypoints..(i + 1) * rows.keypoints, &mut room);
            let covariances = self.found(i).and_then(|found| {
                let (points, modes) = inputs.size_of(i);
                let buffers = workspace.grown(points, modes);
                inputs.with(i, keypoints, |observation| estimator.again(view, observation, &found, buffers).ok())?
            });
            let threshold = inputs.thresholds.map_or(f64::NAN, |thresholds| thresholds[i]);
            let found = covariances.is_some().then(|| (workspace.residuals(), threshold));
            rows.store(k, found, covariances.flatten().as_ref());
        }
    }

    /// The answer of an object that has one.
    fn found(&self, i: usize) -> Option<Found> {
        if self.status[i] != 0 {
            return None;
        }
        let mut coefficients = [0.0; MAX_MODES];
        coefficients[..self.modes].copy_from_slice(&self.coefficients[i * self.modes..(i + 1) * self.modes]);
        let pose = Pose { r: Matrix3::from_row_slice(&self.r[i]), t: self.t[i].into() };
        let state = State { pose, coefficients };
        let by_three_keypoints = self.solver[i] == Solver::P3p as u8;
        Some(Found { state, noise_sigma: self.noise_sigma[i], by_three_keypoints })
    }
}
