//! Estimates a frame of vehicles from a table and passes their poses to a callback. It uses neither std nor a heap, so
//! the same code runs on a microcontroller.
#![no_std]

#[allow(clippy::approx_constant, reason = "some lengths are near a constant of nature")]
pub mod classes;
pub mod frame;

use groundpose::{
    Bbox, Camera, Estimate, EstimateError, Estimator, InputError, NoPose, Observation, Options, ShapeModel, Tilt, View,
    Workspace,
};

use classes::Class;
use frame::Detection;

/// The part of an estimate that a tracker or a planner needs.
#[derive(Clone, Copy, Debug)]
pub struct VehiclePose {
    /// Radians; 0 = facing away from the camera.
    pub yaw: f64,
    /// Origin of the vehicle in the camera frame, metres.
    pub t: [f64; 3],
    /// Variance of the depth, metres squared; NaN if the keypoints do not determine it.
    pub depth_variance: f64,
    /// Number of keypoints that agree with the pose.
    pub inliers: usize,
}

impl From<&Estimate> for VehiclePose {
    fn from(estimate: &Estimate) -> Self {
        Self {
            yaw: estimate.yaw,
            t: estimate.pose.t.into(),
            depth_variance: estimate.covariance.map_or(f64::NAN, |covariance| covariance[(5, 5)]),
            inliers: estimate.inlier_count,
        }
    }
}

/// The model of a class; it borrows the class's tables.
fn model(class: &Class) -> Result<ShapeModel<'_>, InputError> {
    ShapeModel::rigid(class.mean, class.bbox_3d)?
        .with_modes(class.basis, class.eigenvalues)?
        .with_bbox_basis(class.bbox_basis)
}

/// Estimates every detection of a frame and hands each result to `write`, with its place in the frame.
///
/// # Errors
/// The library refuses the table: a mistake of the program, found in its first frame.
pub fn estimate_frame(
    view: &View,
    detections: &[Detection],
    workspace: &mut impl Workspace,
    mut write: impl FnMut(usize, Result<VehiclePose, NoPose>),
) -> Result<(), InputError> {
    let estimator = Estimator::new(Options::default())?;
    for (index, detection) in detections.iter().enumerate() {
        let model = model(detection.class)?;
        let observation = Observation::new(detection.keypoints_2d, &model)?
            .with_bbox(Bbox::new(detection.bbox)?)
            .with_scores(detection.scores)?;
        match estimator.estimate_indexed(view, &observation, workspace, index as u64) {
            Ok(estimate) => write(index, Ok(VehiclePose::from(&estimate))),
            Err(EstimateError::NoPose(reason)) => write(index, Err(reason)),
            Err(EstimateError::Input(mistake)) => return Err(mistake),
        }
    }
    Ok(())
}

/// The view of the frame in the table.
///
/// # Errors
/// The numbers do not describe a camera.
pub fn view() -> Result<View, InputError> {
    let [fx, fy, cx, cy] = frame::CAMERA;
    View::new(Camera::new(fx, fy, cx, cy)?, Tilt { pitch: frame::PITCH, roll: 0.0 })
}
