//! UP2P: pose of an upright object from two keypoints and the tilt; no box needed.
//!
//! With rays $`k_1`$, $`k_2`$ of two keypoints $`X_1`$, $`X_2`$ in the ground frame, distances $`l_1`$, $`l_2`$ along them
//! and the yaw $`\psi`$,
//!
//! ```math
//! l_2 k_2 - l_1 k_1 = R_y(\psi) (X_2 - X_1) .
//! ```
//!
//! The y component is linear in the distances, the length in the bird's-eye view quadratic: two solutions.

use nalgebra::Vector3;

use super::MinimalSolver;
use super::p1p::pose_at;
use crate::geometry::math::quadratic_roots;
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::model::observation::Observation;

/// Keypoints closer than this (metres, bird's-eye view) do not define a yaw.
const SMALLEST_BASELINE: f64 = 1e-6;
/// Both rays nearer to the horizontal than this have no depth.
const SMALLEST_SLOPE: f64 = 1e-9;

/// The solver for one object in one view.
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
/// use groundpose::minimal::up2p::Up2p;
///
/// let observation = Observation::new(&pixels, &model)?;
/// let solver = Up2p::new(&view, &observation);
/// let mut nearest = f64::INFINITY;
/// solver.solve([0, 1], &mut |pose| nearest = nearest.min((pose.t - truth.t).norm()));
/// assert!(nearest < 1e-6, "the truth is one of the solutions");
/// # Ok::<(), groundpose::InputError>(())
/// ```
pub struct Up2p<'a> {
    view: &'a View,
    observation: &'a Observation<'a>,
}

impl<'a> Up2p<'a> {
    /// The solver.
    #[must_use]
    pub fn new(view: &'a View, observation: &'a Observation<'a>) -> Self {
        Self { view, observation }
    }
}

/// Poses from two model points and their rays in the ground frame, of length one in the bird's-eye view.
pub(crate) fn solve_up2p(view: &View, points: [[f64; 3]; 2], rays: [Vector3<f64>; 2], emit: &mut impl FnMut(Pose)) {
    let difference = Vector3::from(points[1]) - Vector3::from(points[0]);
    let baseline_squared = difference.x * difference.x + difference.z * difference.z;
    // The distance that is eliminated belongs to the steeper ray: a = the other, b = this.
    let (a, b, sign) = if rays[0].y.abs() > rays[1].y.abs() { (1, 0, 1.0) } else { (0, 1, -1.0) };
    let (ka, kb) = (rays[a], rays[b]);
    if baseline_squared < SMALLEST_BASELINE * SMALLEST_BASELINE || kb.y.abs() < SMALLEST_SLOPE {
        return;
    }
    // sign (l_a k_a - l_b k_b) = R D; y: l_b = (l_a k_a.y - sign D.y) / k_b.y = slope l_a + offset
    let slope = ka.y / kb.y;
    let offset = -sign * difference.y / kb.y;
    // Bird's-eye view: |l_a (k_a - slope k_b) - offset k_b|^2 = |D|^2
    let (vx, vz) = (ka.x - slope * kb.x, ka.z - slope * kb.z);
    let (wx, wz) = (-offset * kb.x, -offset * kb.z);
    let quadratic = (vx * vx + vz * vz, 2.0 * (vx * wx + vz * wz), wx * wx + wz * wz - baseline_squared);
    for distance in quadratic_roots(quadratic.0, quadratic.1, quadratic.2) {
        if distance <= 0.0 || slope * distance + offset <= 0.0 {
            continue;
        }
        let (ex, ez) = (sign * (distance * vx + wx), sign * (distance * vz + wz));
        // R(yaw) (D.x, D.z) = (ex, ez), up to the common factor |D|^2
        let cosine = difference.x * ex + difference.z * ez;
        let sine = difference.z * ex - difference.x * ez;
        emit(pose_at(view, &ka, points[a], cosine, sine, distance));
    }
}

impl MinimalSolver<2> for Up2p<'_> {
    fn solve(&self, sample: [usize; 2], emit: &mut impl FnMut(Pose)) {
        let model = self.observation.model().mean();
        let rays = sample.map(|i| self.view.ground_ray(self.observation.keypoints_2d()[i]));
        solve_up2p(self.view, sample.map(|i| model[i]), rays, emit);
    }
}
