//! P1P with the camera's height: for objects of whose box one side or none is known.
//!
//! An object on the ground has its keypoint $`X`$ at the known height $`h - (y_{bottom} - X_y)`$ below the camera
//! (y down), so the keypoint's ray $`k`$ ends there. One known side of the box then gives the yaw $`\psi`$: with the
//! offset $`d`$ from the keypoint to a corner and the normal $`n`$ of the plane through the side,
//!
//! ```math
//! l_C = \frac{h - y_{bottom} + X_y}{k_y}, \qquad n^T \bigl( l_C k + R_y(\psi) d \bigr) = 0 ,
//! ```
//!
//! two roots per corner.

use nalgebra::Vector3;

use super::MinimalSolver;
use super::p1p::{pose_at, solve_yaw, touching_heights};
use crate::geometry::bbox::Bbox;
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::model::observation::Observation;
use crate::tuning::FEASIBILITY_TOLERANCE;

/// A keypoint at nearly the camera's height has no depth: the smallest slope of its ray against the ground.
const SMALLEST_SLOPE: f64 = 1e-3;

/// The solver for one object in one view of known height.
///
/// The objects are those of the example of [`MinimalSolver`].
///
/// ```
/// # use groundpose::{Bbox, Camera, Observation, Pose, ShapeModel, Tilt, View};
/// # use groundpose::minimal::MinimalSolver;
/// # let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt { pitch: -0.2, roll: 0.0 })?;
/// # let bbox_3d = [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]];
/// # let points = [[-0.8, -0.3, 1.3], [0.5, -1.4, -1.3], [0.8, -0.3, -1.3]];
/// # let model = ShapeModel::rigid(&points, bbox_3d)?;
/// # let truth = Pose::upright(&view, 0.7, [2.0, 6.0, 15.0].into());
/// # let pixel = |x: [f64; 3]| view.camera.project(&truth.transform(x)).unwrap();
/// # let pixels = points.map(pixel);
/// # let corners = (0..8).map(|c| pixel(core::array::from_fn(|axis| bbox_3d[(c >> axis) & 1][axis])));
/// # let columns: Vec<f64> = corners.map(|corner| corner[0]).collect();
/// # let left = columns.iter().copied().fold(f64::INFINITY, f64::min);
/// # let right = columns.iter().copied().fold(f64::NEG_INFINITY, f64::max);
/// use groundpose::minimal::p1p_height::P1pHeight;
///
/// // The camera is 6 m above the ground; the left side of the box is enough.
/// let bbox = Bbox::new([left, f64::NAN, f64::NAN, f64::NAN])?;
/// let observation = Observation::new(&pixels, &model)?;
/// let solver = P1pHeight::new(&view, &observation, &bbox, 6.0);
/// let mut nearest = f64::INFINITY;
/// solver.solve([1], &mut |pose| nearest = nearest.min((pose.t - truth.t).norm()));
/// assert!(nearest < 1e-6, "the truth is one of the solutions");
/// # Ok::<(), groundpose::InputError>(())
/// ```
pub struct P1pHeight<'a> {
    view: &'a View,
    observation: &'a Observation<'a>,
    height: f64,
    planes: [Vector3<f64>; 2],
    known: [bool; 2],
    touching_y: [f64; 2],
}

impl<'a> P1pHeight<'a> {
    /// The solver for a box with at least one known vertical side and a camera `height` metres above the ground.
    #[must_use]
    pub fn new(view: &'a View, observation: &'a Observation<'a>, bbox: &Bbox, height: f64) -> Self {
        let known = [!bbox.left.is_nan(), !bbox.right.is_nan()];
        let planes = view.side_planes(bbox.left, bbox.right);
        let touching_y = touching_heights(&planes, observation.model());
        Self { view, observation, height, planes, known, touching_y }
    }
}

impl MinimalSolver<1> for P1pHeight<'_> {
    fn solve(&self, [index]: [usize; 1], emit: &mut impl FnMut(Pose)) {
        let model = self.observation.model();
        let ray = self.view.ground_ray(self.observation.keypoints_2d()[index]);
        let keypoint = model.mean()[index];
        let depth_below_camera = self.height - model.bbox_3d()[1][1] + keypoint[1];
        let distance = depth_below_camera / ray.y;
        if ray.y.abs() < SMALLEST_SLOPE || distance <= 0.0 {
            return;
        }
        for k in (0..2).filter(|&k| self.known[k]) {
            let plane = &self.planes[k];
            let g = distance * plane.dot(&ray) + plane.y * (self.touching_y[k] - keypoint[1]);
            // Signed distance of a corner from the plane for a yaw.
            let coefficients = |corner: [f64; 2]| {
                let (dx, dz) = (corner[0] - keypoint[0], corner[1] - keypoint[2]);
                (plane.x * dx + plane.z * dz, plane.x * dz - plane.z * dx)
            };
            for &corner in model.footprint().corners() {
                let (p, q) = coefficients(corner);
                for (cosine, sine) in solve_yaw(p, q, g).into_iter().flatten() {
                    let inside = model.footprint().corners().iter().all(|&other| {
                        let (p, q) = coefficients(other);
                        p * cosine + q * sine + g >= -FEASIBILITY_TOLERANCE * distance
                    });
                    if inside {
                        emit(pose_at(self.view, &ray, keypoint, cosine, sine, distance));
                    }
                }
            }
        }
    }
}
