//! An object after its frame was solved.

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector3};

use crate::estimate::frame_object::{Contact, FrameObject, ObjectState};
use crate::estimate::frame_priors::FramePriors;
use crate::geometry::math::{exp, sqrt, square};
use crate::geometry::pose::Pose;
use crate::refine::covariance::PoseCovariance;

/// An object after its frame was solved.
///
/// ```
/// use groundpose::{FrameAnswer, PoseCovariance};
///
/// // What `solve_frame` writes to.
/// let answers = [FrameAnswer::default(); 32];
/// assert_eq!(answers[0].covariance, PoseCovariance::zeros());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FrameAnswer {
    /// `camera_from_object` of the object `exp(log_size)` times as large as it was taken to be.
    pub pose: Pose,
    /// Of the pose, what is not known of the frame and of the object's size included.
    pub covariance: PoseCovariance,
    /// Of `moved` and `log_size`.
    pub moved_covariance: SMatrix<f64, 7, 7>,
    /// Logarithm of the object's size in sizes of its model.
    pub log_size: f64,
    /// Its standard deviation.
    pub log_size_sigma: f64,
    /// How the pose was moved: rotation vector on the left and translation, before the scale.
    pub moved: SVector<f64, 6>,
    /// 1 for an object that agrees with its frame, towards 0 for one that does not.
    pub weight: f64,
    pub(crate) contact: Contact,
}

impl Default for FrameAnswer {
    fn default() -> Self {
        let pose = Pose { r: Matrix3::identity(), t: Vector3::zeros() };
        Self {
            pose,
            covariance: PoseCovariance::zeros(),
            moved_covariance: SMatrix::zeros(),
            log_size: 0.0,
            log_size_sigma: 0.0,
            moved: SVector::zeros(),
            weight: 0.0,
            contact: Contact::default(),
        }
    }
}

impl FrameAnswer {
    pub(crate) fn state(&self) -> ObjectState {
        let mut x = ObjectState::zeros();
        x.fixed_rows_mut::<6>(0).copy_from(&self.moved);
        x[6] = self.log_size;
        x
    }

    pub(crate) fn set_state(&mut self, x: &ObjectState) {
        self.moved.copy_from(&x.fixed_rows::<6>(0));
        self.log_size = x[6];
    }

    /// Pose and size with their covariance, after the last step; `frame`: covariance of what the object sees of the frame.
    pub(crate) fn describe(&mut self, object: &FrameObject, priors: &FramePriors, frame: &Matrix4<f64>) {
        let own = square(priors.scales[object.class].own_sigma);
        let joint = self.contact.object_covariance(&object.covariance, own, frame, self.contact_variance());
        let scale = exp(self.log_size);
        self.pose = object.pose.perturbed(&self.moved).orthonormalized();
        self.pose.t *= scale;
        let mut by_unknowns = SMatrix::<f64, 6, 7>::identity();
        for axis in 3..6 {
            by_unknowns[(axis, axis)] = scale;
            by_unknowns[(axis, 6)] = self.pose.t[axis - 3];
        }
        let covariance = by_unknowns * joint * by_unknowns.transpose();
        self.covariance = (covariance + covariance.transpose()) * 0.5;
        self.moved_covariance = joint;
        self.log_size_sigma = sqrt(joint[(6, 6)].max(0.0));
    }

    /// Of the contact, with its weight.
    pub(crate) fn contact_variance(&self) -> f64 {
        self.contact.variance / self.weight
    }
}
