//! From one calibrated image, the 6-DoF pose and shape of every vehicle on the ground.
//!
//! Something else finds the vehicles: for each of them a 2D box and some keypoints, a few of them wrong. This crate
//! knows the camera, roughly its tilt against the ground, and a 3D model of the keypoints, and answers with a pose, a
//! shape, and how sure it is, in tens of microseconds. One keypoint, two sides of the box and the tilt make a
//! hypothesis (P1P: Lee et al., "1-Point RANSAC-Based Method for Ground Object Pose Estimation", CVPR Workshops 2021), a finite search
//! finds the best one, and a robust fit refines it.
//!
//! # One object, no allocation
//!
//! ```
//! use groundpose::{Bbox, Camera, Estimator, FixedWorkspace, Observation, Options, ShapeModel, Tilt, View, Workspace};
//!
//! // A car, metres: wheels, headlights, rear lights, corners of the roof; origin on the ground below its middle.
//! const KEYPOINTS_3D: [[f64; 3]; 12] = [
//!     [-0.8, -0.3, 1.35], [0.8, -0.3, 1.35], [0.8, -0.3, -1.35], [-0.8, -0.3, -1.35],
//!     [-0.65, -0.7, 2.1], [0.65, -0.7, 2.1], [0.7, -0.9, -2.15], [-0.7, -0.9, -2.15],
//!     [-0.55, -1.45, 0.3], [0.55, -1.45, 0.3], [0.55, -1.4, -1.3], [-0.55, -1.4, -1.3],
//! ];
//! const BBOX_3D: [[f64; 3]; 2] = [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]];
//!
//! // What a detector saw, pixels. The ninth keypoint is wrong.
//! const KEYPOINTS_2D: [[f64; 2]; 12] = [
//!     [919.3, 560.1], [813.5, 565.4], [725.2, 552.5], [820.8, 547.6],
//!     [942.8, 533.3], [854.3, 537.5], [708.1, 509.2], [790.8, 507.7],
//!     [760.0, 590.0], [790.7, 473.6], [740.8, 476.7], [808.5, 477.3],
//! ];
//! const BBOX: [f64; 4] = [694.1, 470.1, 963.0, 597.8];
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
//! let view = View::new(camera, Tilt { pitch: -4.0_f64.to_radians(), roll: 0.0 })?;
//! let model = ShapeModel::rigid(&KEYPOINTS_3D, BBOX_3D)?;
//! let observation = Observation::new(&KEYPOINTS_2D, &model)?.with_bbox(Bbox::new(BBOX)?);
//!
//! let estimator = Estimator::new(Options::default())?;
//! let mut workspace = FixedWorkspace::<12>::new();
//! let estimate = estimator.estimate(&view, &observation, &mut workspace)?;
//!
//! assert!((estimate.yaw - 2.5).abs() < 0.05);
//! assert!((estimate.pose.t.z - 14.07).abs() < 0.3);
//! assert_eq!(estimate.inlier_count, 11);
//! assert!(workspace.residuals()[8] > estimate.inlier_threshold);
//! # Ok(())
//! # }
//! ```
//!
//! # Conventions
//!
//! | what | convention |
//! |---|---|
//! | camera | x right, y down, z forward; metres; pixel centres at integer coordinates (OpenCV) |
//! | ground frame | origin at the camera centre, y down along the ground's normal, z the camera's forward direction laid on the ground |
//! | tilt | `R_camera_from_ground = R_z(roll) R_x(-pitch)`; pitch > 0: the optical axis points above the horizon, which lies at `v = cy + fy tan(pitch)` |
//! | object | x right, y down, z forward (length along z); origin anywhere the model likes |
//! | yaw | about the ground's y axis, `R_y(yaw) [0, 0, 1] = [sin yaw, 0, cos yaw]`; 0 = facing away from the camera; KITTI's `rotation_y = yaw - pi / 2` |
//! | pose | `camera_from_object = (R, t)`: `X_camera = R X_object + t`; upright: `R = R_camera_from_ground R_y(yaw)` |
//! | 2D box | `left, top, right, bottom` in pixels; NaN = a side that is not known |
//! | keypoints | pixels `[u, v]`, NaN = not seen; metres `[x, y, z]` in the object frame |
//! | angles | radians; a name in degrees ends in `_deg` |
//!
//! # Three kinds of failure
//!
//! The caller's mistake is an [`InputError`] that names argument, expected and got. Data without an answer is a
//! [`NoPose`] with its reason. An [`EstimateError`] is one of the two. A panic would be a bug of this crate.
//!
//! # Features
//!
//! Features only add; none changes a number.
//!
//! | feature | what it adds |
//! |---|---|
//! | `std` (default) | `workspace::GrowingWorkspace`, vector units chosen at run time, `track::tracker::Tracker`, `crops` |
//! | `rayon` (default) | `Estimator::estimate_batch`: many objects on many cores, the same bits for any number |
//! | `synthetic` | `synthetic`: scenes with known truth |
//! | `python` | the Python module; of no use from Rust |
//!
//! Without default features the crate needs neither std nor an allocator.
#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(feature = "std")]
pub mod crops;
pub mod error;
pub mod estimate;
pub mod geometry;
pub mod minimal;
pub mod model;
#[cfg(feature = "python")]
mod python;
pub mod refine;
pub mod search;
mod simd;
#[cfg(feature = "synthetic")]
pub mod synthetic;
#[cfg(all(test, feature = "std"))]
mod tests;
pub mod track;
mod tuning;

pub use error::{EstimateError, Got, InputError, NoPose};
pub use estimate::alternative::Alternative;
#[cfg(feature = "rayon")]
pub use estimate::batch::OBJECTS_PER_TASK;
pub use estimate::camera_state::{CAMERA_NUMBERS, CameraState};
pub use estimate::describe::Estimate;
pub use estimate::estimator::Estimator;
pub use estimate::frame::{ClassScale, Frame, solve_frame};
pub use estimate::frame_answer::FrameAnswer;
pub use estimate::frame_object::FrameObject;
pub use estimate::frame_priors::{FramePriors, MAX_CLASSES, ScalePrior};
pub use estimate::frame_tilt::{FrameTilt, UpAxis, frame_tilt};
pub use estimate::options::{Options, Solver};
pub use estimate::probability::{EVIDENCE, Evidence, ProbabilityCoefficients};
#[cfg(feature = "std")]
pub use estimate::workspace::GrowingWorkspace;
pub use estimate::workspace::{Buffers, FixedWorkspace, Workspace};
pub use geometry::bbox::Bbox;
pub use geometry::camera::Camera;
pub use geometry::footprint::{Footprint, MAX_CORNERS};
pub use geometry::lens::Lens;
pub use geometry::pose::Pose;
pub use geometry::view::{Tilt, View};
pub use model::observation::{Observation, VIEWING_ANGLES};
pub use model::shape_model::{MAX_MODES, ShapeModel};
pub use refine::covariance::{PoseCovariance, ShapeCovariance, ShapePoseCovariance};
pub use refine::kernels::Kernel;
pub use refine::region::region_radius2;
pub use refine::schedule::{MAX_STAGES, Refinement, StageStatistics};
pub use search::ransac::{RansacStatistics, StopReason};
pub use search::score::Scoring;
pub use track::facing::Facing;
pub use track::filter::VehicleFilter;
pub use track::model::TRACK_NUMBERS;
pub use track::options::{CameraMotion, TrackOptions};
pub use track::row::TrackRow;
pub use track::sighting::{Reading, Sighting};
#[cfg(feature = "std")]
pub use track::tracker::Tracker;
