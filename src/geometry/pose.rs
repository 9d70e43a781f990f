//! Rigid motions `camera_from_object`.

use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};

use crate::geometry::math::{atan2, cos, sin};
use crate::geometry::view::View;

/// `X_camera = R X_object + t`, metres.
///
/// ```
/// use groundpose::{Camera, Pose, Tilt, View};
///
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
/// let view = View::new(camera, Tilt { pitch: -0.1, roll: 0.02 })?;
/// let pose = Pose::upright(&view, 0.5, [1.0, 1.5, 20.0].into());
/// assert!((pose.yaw(&view) - 0.5).abs() < 1e-12);
/// assert_eq!(pose.transform([0.0; 3]), pose.t);
///
/// // `exp(w) R` and `t + dt`; a rotation stays one.
/// let moved = pose.perturbed(&[0.0, 1e-3, 0.0, 0.0, 0.0, 0.5].into()).orthonormalized();
/// assert!((moved.yaw(&view) - 0.501).abs() < 1e-4 && moved.t.z == pose.t.z + 0.5);
/// assert!(moved.is_finite() && (moved.r.determinant() - 1.0).abs() < 1e-12);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rotation.
    pub r: Matrix3<f64>,
    /// Translation, metres.
    pub t: Vector3<f64>,
}

impl Pose {
    /// The pose of an upright object: yaw about the ground's normal and a translation in the
    /// ground frame (paper, eq. 3).
    #[must_use]
    pub fn upright(view: &View, yaw: f64, t_ground: Vector3<f64>) -> Self {
        Self::from_yaw(view, cos(yaw), sin(yaw), t_ground)
    }

    /// The same from the cosine and sine of the yaw: `R_y [0, 0, 1] = [sin, 0, cos]`.
    #[inline]
    pub(crate) fn from_yaw(view: &View, cosine: f64, sine: f64, t_ground: Vector3<f64>) -> Self {
        let r = &view.r_camera_from_ground;
        let (x, z) = (r.column(0), r.column(2));
        let columns = [x * cosine - z * sine, r.column(1).into_owned(), x * sine + z * cosine];
        Self { r: Matrix3::from_columns(&columns), t: r * t_ground }
    }

    /// Angle, in the bird's-eye view, between the object's forward axis and the camera's.
    #[must_use]
    pub fn yaw(&self, view: &View) -> f64 {
        let forward = view.r_camera_from_ground.tr_mul(&self.r.column(2));
        atan2(forward[0], forward[2])
    }

    /// A point of the object in the camera frame.
    #[must_use]
    pub fn transform(&self, point: [f64; 3]) -> Vector3<f64> {
        self.r * Vector3::from(point) + self.t
    }

    /// The pose moved by a rotation vector (on the left, radians) and a translation (metres).
    #[must_use]
    pub fn perturbed(&self, step: &Vector6<f64>) -> Self {
        let rotation = Rotation3::new(Vector3::new(step[0], step[1], step[2]));
        Self { r: rotation * self.r, t: self.t + Vector3::new(step[3], step[4], step[5]) }
    }

    /// The same pose with the rounding errors of many updates taken out of its rotation.
    #[must_use]
    pub fn orthonormalized(&self) -> Self {
        let x = self.r.column(0).normalize();
        let y = self.r.column(1) - x * x.dot(&self.r.column(1));
        let y = y.normalize();
        Self { r: Matrix3::from_columns(&[x, y, x.cross(&y)]), t: self.t }
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.r.iter().chain(self.t.iter()).all(|x| x.is_finite())
    }

    /// Whether every number is finite and `R` a rotation, up to rounding errors.
    pub(crate) fn is_rigid(&self) -> bool {
        let deviation = self.r.tr_mul(&self.r) - Matrix3::identity();
        self.is_finite() && deviation.amax() < 1e-9 && self.r.determinant() > 0.0
    }

    /// Cosine of the angle between the forward axes of two poses.
    #[inline]
    pub(crate) fn forward_cosine(&self, other: &Self) -> f64 {
        self.r.column(2).dot(&other.r.column(2))
    }
}
