//! The fields of results, as tables: names, shapes, and where their numbers come from.

use crate::estimate::alternative::Alternative;
use crate::estimate::describe::Estimate;
use crate::estimate::probability::EVIDENCE;
use crate::geometry::pose::Pose;
use crate::refine::covariance::{PoseCovariance, ShapeCovariance, ShapePoseCovariance};
use crate::refine::schedule::MAX_STAGES;

/// One output array of numbers: its name, its shape for one object, and how a source fills it.
pub(super) struct Field<S: 'static, T> {
    pub(super) name: &'static str,
    pub(super) shape: fn(modes: usize) -> Vec<usize>,
    pub(super) write: fn(&S, &mut [T]),
}

pub(super) const NUMBERS: [Field<Estimate, f64>; 17] = [
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
    Field { name: "covariance", shape: |_| vec![6, 6], write: |e, out| write_covariance(e.covariance.as_ref(), out) },
    Field {
        name: "shape_coefficients",
        shape: |modes| vec![modes],
        write: |e, out| out.copy_from_slice(&e.shape_coefficients[..out.len()]),
    },
    Field {
        name: "shape_covariance",
        shape: |modes| vec![modes, modes],
        write: |e, out| write_shape_covariance(e.shape_covariance.as_ref(), out),
    },
    Field {
        name: "shape_pose_covariance",
        shape: |modes| vec![modes, 6],
        write: |e, out| write_shape_pose_covariance(e.shape_pose_covariance.as_ref(), out),
    },
    Field {
        name: "stage_costs",
        shape: |_| vec![MAX_STAGES],
        write: |e, out| out.copy_from_slice(&e.stages.map(|s| s.cost)),
    },
];

/// Counts, as large as any is.
pub(super) const COUNTS: [Field<Estimate, u32>; 4] = [
    Field { name: "inlier_count", shape: |_| vec![], write: |e, out| out[0] = e.inlier_count as u32 },
    Field { name: "iterations", shape: |_| vec![], write: |e, out| out[0] = e.ransac.iterations as u32 },
    Field { name: "hypotheses", shape: |_| vec![], write: |e, out| out[0] = e.ransac.hypotheses as u32 },
    Field {
        name: "stage_iterations",
        shape: |_| vec![MAX_STAGES],
        write: |e, out| out.copy_from_slice(&e.stages.map(|s| s.iterations as u32)),
    },
];

/// Of `NUMBERS`: what many objects do not keep, because it follows from the answer.
pub(super) fn is_made_again(name: &str) -> bool {
    matches!(name, "covariance" | "shape_covariance" | "shape_pose_covariance")
}

/// Of `NUMBERS`: what those follow from.
pub(super) fn is_needed_again(name: &str) -> bool {
    matches!(name, "R" | "t" | "inlier_threshold" | "noise_sigma" | "shape_coefficients")
}

/// The other reading of an object.
pub(super) struct Other {
    pub(super) object: usize,
    pose: Pose,
    yaw: f64,
    covariance: Option<PoseCovariance>,
    probability: f64,
}

impl Other {
    pub(super) fn new(object: usize, other: &Alternative) -> Self {
        let &Alternative { pose, yaw, covariance, probability, .. } = other;
        Self { object, pose, yaw, covariance, probability }
    }
}

/// Few objects have another reading: these arrays are made when they are asked for.
pub(super) const OTHERS: [Field<Other, f64>; 5] = [
    Field {
        name: "alternative_R",
        shape: |_| vec![3, 3],
        write: |o, out| out.copy_from_slice(o.pose.r.transpose().as_slice()),
    },
    Field { name: "alternative_t", shape: |_| vec![3], write: |o, out| out.copy_from_slice(o.pose.t.as_slice()) },
    Field { name: "alternative_yaw", shape: |_| vec![], write: |o, out| out[0] = o.yaw },
    Field {
        name: "alternative_covariance",
        shape: |_| vec![6, 6],
        write: |o, out| write_covariance(o.covariance.as_ref(), out),
    },
    Field { name: "alternative_probability", shape: |_| vec![], write: |o, out| out[0] = o.probability },
];

pub(super) fn write_covariance(covariance: Option<&PoseCovariance>, out: &mut [f64]) {
    match covariance {
        Some(covariance) => out.copy_from_slice(covariance.as_slice()),
        None => out.fill(f64::NAN),
    }
}

pub(super) fn write_shape_covariance(covariance: Option<&ShapeCovariance>, out: &mut [f64]) {
    let modes = out.len().isqrt();
    match covariance {
        Some(covariance) => (0..out.len()).for_each(|k| out[k] = covariance[(k / modes, k % modes)]),
        None => out.fill(f64::NAN),
    }
}

pub(super) fn write_shape_pose_covariance(covariance: Option<&ShapePoseCovariance>, out: &mut [f64]) {
    match covariance {
        Some(between) => (0..out.len()).for_each(|k| out[k] = between[(k / 6, k % 6)]),
        None => out.fill(f64::NAN),
    }
}
