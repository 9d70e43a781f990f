//! Minimal solvers: poses from the fewest points. One file each, one interface for all.

pub mod p1p;
pub mod p1p_height;
pub mod p3p;
pub mod up2p;

use crate::geometry::pose::Pose;

/// A solver that makes pose hypotheses from `SIZE` keypoints.
///
/// ```
/// use groundpose::{Bbox, Camera, Observation, Pose, ShapeModel, Tilt, View};
/// use groundpose::minimal::MinimalSolver;
/// use groundpose::minimal::p1p::{Cases, P1p};
/// use groundpose::minimal::p1p_height::P1pHeight;
/// use groundpose::minimal::p3p::P3p;
/// use groundpose::minimal::up2p::Up2p;
///
/// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt { pitch: -0.2, roll: 0.0 })?;
/// let bbox_3d = [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]];
/// let points = [[-0.8, -0.3, 1.3], [0.5, -1.4, -1.3], [0.8, -0.3, -1.3]];
/// let model = ShapeModel::rigid(&points, bbox_3d)?;
///
/// // Exact pixels of a car on the ground below a camera 6 m high.
/// let truth = Pose::upright(&view, 0.7, [2.0, 6.0, 15.0].into());
/// let pixel = |x: [f64; 3]| view.camera.project(&truth.transform(x)).unwrap();
/// let pixels = points.map(pixel);
/// let corners = (0..8).map(|c| pixel(core::array::from_fn(|axis| bbox_3d[(c >> axis) & 1][axis])));
/// let columns = corners.map(|corner| corner[0]);
/// let left = columns.clone().fold(f64::INFINITY, f64::min);
/// let right = columns.fold(f64::NEG_INFINITY, f64::max);
/// let bbox = Bbox::new([left, f64::NAN, right, f64::NAN])?;
/// let observation = Observation::new(&pixels, &model)?;
///
/// // Every solver calls back with all its solutions; the truth is one of them.
/// fn nearest<const N: usize>(solver: &impl MinimalSolver<N>, sample: [usize; N], truth: &Pose) -> f64 {
///     let mut nearest = f64::INFINITY;
///     solver.solve(sample, &mut |pose| nearest = nearest.min((pose.t - truth.t).norm()));
///     nearest
/// }
/// assert!(nearest(&P1p::new(&view, &observation, &bbox, Cases::All), [1], &truth) < 1e-9);
/// assert!(nearest(&P1pHeight::new(&view, &observation, &bbox, 6.0), [1], &truth) < 1e-9);
/// assert!(nearest(&Up2p::new(&view, &observation), [0, 1], &truth) < 1e-9);
/// assert!(nearest(&P3p::new(&view.camera, &observation), [0, 1, 2], &truth) < 1e-6);
/// # Ok::<(), groundpose::InputError>(())
/// ```
pub trait MinimalSolver<const SIZE: usize> {
    /// Calls `emit` with every pose that the sampled keypoints (indices into the model) allow.
    fn solve(&self, sample: [usize; SIZE], emit: &mut impl FnMut(Pose));
}
