//! How one object touches the road: its own unknowns are taken out exactly, so that it becomes one measurement of the
//! frame.
//!
//! An object's unknowns are $`x = (\omega, \tau, s)`$: rotation vector on the left, translation and log size about its
//! own estimate, with $`x \sim N\bigl((0, 0, s_\text{class}), P\bigr)`$, $`P = \text{diag}(C, \sigma_\text{own}^2)`$. Its
//! bottom centre is $`c = e^s (t + \tau + e^{[\omega]} R\, b)`$ and its height above the road, as a logarithm,
//!
//! ```math
//! z = \log \frac{n \cdot c}{h}, \qquad
//! \sigma^2 = \Bigl( \frac{\sigma_\text{roughness}}{h} \Bigr)^2 + \Bigl( \frac{\sigma_\text{slope} \lVert c \rVert}{h} \Bigr)^2
//!     + \Bigl( \frac{\sigma_\text{curvature} \lVert c_\parallel \rVert^2}{2 h} \Bigr)^2
//! ```
//!
//! with $`c_\parallel`$ along the road.
//!
//! With $`J`$ the derivative of $`z`$ by $`x`$ the contact is a scalar measurement of variance $`\sigma^2 + J P J^T`$ of
//! the frame: the Schur complement of the object in the normal equations of everything, without a matrix to invert.

use nalgebra::{Matrix4, SMatrix, SVector, Vector3};

use crate::error::{Got, InputError, require};
use crate::estimate::frame_priors::{FramePriors, MAX_CLASSES};
use crate::geometry::math::{cos, exp, log, sin, square};
use crate::geometry::pose::Pose;
use crate::refine::covariance::PoseCovariance;
use crate::tuning::LOWEST_CONTACT;

/// Metres; beyond them squares of squares are no numbers.
const FARTHEST: f64 = 1e6;

/// Unknowns of an object: rotation vector, translation, log size.
pub(crate) type ObjectState = SVector<f64, 7>;
/// Derivatives by the unknowns of the frame that an object sees: pitch, roll, log height, log size of its class.
pub(crate) type FrameRow = SVector<f64, 4>;

/// What one object's own estimate says, for [`solve_frame`](crate::estimate::frame::solve_frame).
///
/// ```
/// use groundpose::{Camera, FrameObject, Pose, PoseCovariance, Tilt, View};
///
/// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?;
/// let pose = Pose::upright(&view, 0.3, [2.0, 1.5, 20.0].into());
/// let covariance = PoseCovariance::identity() * 1e-4;
/// // The model's origin is on the ground below its middle; class 0.
/// assert!(FrameObject::new(pose, covariance, [0.0; 3], 0).is_ok());
/// assert_eq!(FrameObject::new(pose, covariance * f64::NAN, [0.0; 3], 0).unwrap_err().argument, "covariance");
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FrameObject {
    pub(crate) pose: Pose,
    pub(crate) covariance: PoseCovariance,
    pub(crate) bottom_centre: Vector3<f64>,
    pub(crate) class: usize,
}

impl FrameObject {
    /// A pose with its covariance, where the middle of the object's bottom face is (object frame, metres), and the
    /// number of its class in [`FramePriors::scales`].
    ///
    /// # Errors
    /// A pose that is no rigid motion, numbers that are not finite, a negative variance, a class beyond the last.
    pub fn new(
        pose: Pose,
        covariance: PoseCovariance,
        bottom_centre: [f64; 3],
        class: usize,
    ) -> Result<Self, InputError> {
        let near = pose.is_rigid() && pose.t.amax() < FARTHEST;
        require(near, "pose", "a rigid motion of less than 1000 km", Got::Text("something else"))?;
        let usable = covariance.iter().all(|x| x.is_finite()) && covariance.diagonal().iter().all(|&x| x >= 0.0);
        require(usable, "covariance", "finite numbers with variances of 0 or more", Got::Text("others"))?;
        let finite = bottom_centre.iter().all(|x| x.is_finite());
        require(finite, "bottom_centre", "finite numbers", Got::Text("NaN or infinite"))?;
        require(class < MAX_CLASSES, "class", "less than MAX_CLASSES", Got::Count(class))?;
        Ok(Self { pose, covariance, bottom_centre: bottom_centre.into(), class })
    }
}

/// The road at some values of the unknowns.
pub(crate) struct Road {
    normal: Vector3<f64>,
    by_pitch: Vector3<f64>,
    by_roll: Vector3<f64>,
    pub(crate) height: f64,
}

impl Road {
    /// Down along the normal, in the camera frame: `R_z(roll) R_x(-pitch) [0, 1, 0]`.
    pub(crate) fn new(pitch: f64, roll: f64, height: f64) -> Self {
        let (sp, cp, sr, cr) = (sin(pitch), cos(pitch), sin(roll), cos(roll));
        Self {
            normal: Vector3::new(-sr * cp, cr * cp, -sp),
            by_pitch: Vector3::new(sr * sp, -cr * sp, -cp),
            by_roll: Vector3::new(-cr * cp, -sr * cp, 0.0),
            height,
        }
    }

    /// How far a point is below the camera along the normal.
    pub(crate) fn below(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point)
    }

    /// Variance of the road under a point about the plane, square metres.
    fn unevenness(&self, point: &Vector3<f64>, priors: &FramePriors) -> f64 {
        let squared = point.norm_squared();
        let bend = 0.5 * priors.curvature * (squared - square(self.below(point)));
        square(priors.roughness) + square(priors.slope) * squared + square(bend)
    }
}

/// The contact of an object, linearised, as a measurement of the frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Contact {
    /// What it says at the frame's present values when the object is where its own estimate says.
    pub(crate) innovation: f64,
    /// Its derivatives by the frame's unknowns.
    pub(crate) row: FrameRow,
    /// Variance of the innovation for a known frame.
    pub(crate) variance: f64,
    /// `P J^T`: how the object follows the contact.
    gain: ObjectState,
}

impl FrameObject {
    /// Its bottom centre moved by its unknowns, and the lever arm of the rotation.
    fn bottom(&self, x: &ObjectState) -> (Vector3<f64>, Vector3<f64>) {
        let moved = self.pose.perturbed(&x.fixed_rows::<6>(0).into_owned());
        let arm = moved.r * self.bottom_centre;
        let scale = exp(x[6]);
        ((moved.t + arm) * scale, arm * scale)
    }

    /// Log size and where its own estimate has the bottom centre, for a size of its class.
    pub(crate) fn start(log_size: f64) -> ObjectState {
        let mut x = ObjectState::zeros();
        x[6] = log_size;
        x
    }

    /// How far its own estimate has the bottom centre below the camera.
    pub(crate) fn below(&self, road: &Road, log_size: f64) -> f64 {
        road.below(&self.bottom(&Self::start(log_size)).0)
    }

    /// The contact about `x`, with `log_size` of its class.
    pub(crate) fn contact(&self, x: &ObjectState, log_size: f64, road: &Road, priors: &FramePriors) -> Contact {
        let (bottom, arm) = self.bottom(x);
        // Above the horizon there is no logarithm: as far off as it can be said to be.
        let below = road.below(&bottom).max(LOWEST_CONTACT * road.height);
        let mut by_object = ObjectState::zeros();
        by_object.fixed_rows_mut::<3>(0).copy_from(&(arm.cross(&road.normal) / below));
        by_object.fixed_rows_mut::<3>(3).copy_from(&(road.normal * (exp(x[6]) / below)));
        by_object[6] = road.below(&bottom) / below;
        let by_frame = FrameRow::new(
            road.by_pitch.dot(&bottom) / below,
            road.by_roll.dot(&bottom) / below,
            -1.0,
            // The object's own estimate moves with its class.
            by_object[6],
        );
        let mut gain = ObjectState::zeros();
        let by_pose = by_object.fixed_rows::<6>(0);
        gain.fixed_rows_mut::<6>(0).copy_from(&(self.covariance * by_pose));
        gain[6] = square(priors.scales[self.class].own_sigma) * by_object[6];
        Contact {
            innovation: log(below / road.height) + by_object.dot(&(Self::start(log_size) - x)),
            row: by_frame,
            variance: road.unevenness(&bottom, priors) / square(road.height) + by_object.dot(&gain),
            gain,
        }
    }
}

impl Contact {
    /// The object's unknowns after the frame moved by `step`; `variance`: of the contact with its weight.
    pub(crate) fn object_after(&self, step: &FrameRow, log_size: f64, variance: f64) -> ObjectState {
        FrameObject::start(log_size) - self.gain * ((self.innovation + self.row.dot(step)) / variance)
    }

    /// Covariance of the object's unknowns, the frame's uncertainty included; `frame` is that of the unknowns it sees.
    pub(crate) fn object_covariance(
        &self,
        covariance: &PoseCovariance,
        own_variance: f64,
        frame: &Matrix4<f64>,
        variance: f64,
    ) -> SMatrix<f64, 7, 7> {
        let mut own = SMatrix::<f64, 7, 7>::zeros();
        own.fixed_view_mut::<6, 6>(0, 0).copy_from(covariance);
        own[(6, 6)] = own_variance;
        let mut follows = -(self.gain / variance) * self.row.transpose();
        follows[(6, 3)] += 1.0;
        own - self.gain * (self.gain.transpose() / variance) + follows * frame * follows.transpose()
    }
}
