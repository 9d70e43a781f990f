//! Whether an object could face another way, and the pose that it would have then.

use nalgebra::{Matrix6, Vector3};

use crate::estimate::object::Object;
use crate::estimate::probability::logit;
use crate::estimate::refine::RunnerUp;
use crate::estimate::verify::Verified;
use crate::geometry::math::{atan2, cos, exp, square};
use crate::geometry::pose::Pose;
use crate::model::observation::VIEWING_ANGLES;
use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::refine::covariance::{Covariances, PoseCovariance};
use crate::refine::normal::State;
use crate::tuning::{AMBIGUITY_NOISE, LEAST_ALTERNATIVE, NETWORK_AMBIGUITY_LIMITS};

/// The best pose that faces another way, where it is not too improbable.
///
/// ```
/// use groundpose::{Alternative, Pose};
///
/// // The more probable of the two readings is the estimate's own pose.
/// fn likelier<'a>(pose: &'a Pose, probability: f64, other: Option<&'a Alternative>) -> &'a Pose {
///     other.filter(|other| other.probability > probability).map_or(pose, |other| &other.pose)
/// }
/// let pose = Pose { r: nalgebra::Matrix3::identity(), t: [0.0, 1.5, 20.0].into() };
/// assert_eq!(likelier(&pose, 0.9, None), &pose);
/// ```
#[derive(Clone, Debug)]
pub struct Alternative {
    /// `camera_from_object`.
    pub pose: Pose,
    /// Yaw about the ground's normal, radians.
    pub yaw: f64,
    /// Shape coefficients, as many as the model has modes; the rest zero.
    pub shape_coefficients: [f64; MAX_MODES],
    /// Covariance of the pose, if asked for.
    pub covariance: Option<PoseCovariance>,
    /// Probability that this pose is right and the estimate's is not.
    pub probability: f64,
}

/// The other reading, where its probability is worth telling: `other` against `this`, `right` that the estimate is right.
fn probability(other: f64, this: f64, right: f64) -> Option<f64> {
    let probability = (right * other / this.max(f64::MIN_POSITIVE)).min(1.0 - right);
    (probability > LEAST_ALTERNATIVE).then_some(probability)
}

/// Whether it could face another way.
pub(crate) struct Doubt {
    pub(crate) ambiguity: f64,
    /// How likely this reading is, in the unit of the ambiguity.
    this: f64,
    /// The other reading where the search met it: a pose of its own, with the keypoints as inliers.
    found: Option<State>,
}

impl Doubt {
    /// By the network's viewing angles where there are some, else by the best pose that faces another way.
    pub(crate) fn of(object: &Object, verified: &Verified) -> Self {
        let (refined, model) = (&verified.refined, object.observation.model());
        if let Some(angles) = object.observation.viewing_angles() {
            let said = turned_probability(angles, &refined.state, model);
            let ambiguity = object.options.ambiguity_coefficients.map_or(said, |c| calibrated(said, c));
            let is_away = |other: &RunnerUp| other.state.pose.forward_cosine(&refined.state.pose) < 0.0;
            let found = refined.runner_up.filter(is_away).map(|other| other.state);
            return Self { ambiguity, this: 1.0 - ambiguity, found };
        }
        let Some(other) = refined.runner_up else { return Self { ambiguity: 0.0, this: 1.0, found: None } };
        let noise_sigma = verified.noise.sigma.max(AMBIGUITY_NOISE * object.inlier_threshold);
        let ambiguity = relative_likelihood(refined.cost, other.cost, noise_sigma);
        Self { ambiguity, this: 1.0, found: Some(other.state) }
    }

    /// The other reading, where it is probable enough: the pose that was met or, where only the network doubts the side
    /// from which the object is seen, the pose turned round in its place. `right` is the probability that `state` is
    /// right, `own` its covariance. A call of its own, as that of the estimate.
    #[inline(never)]
    pub(crate) fn alternative(
        self,
        object: &Object,
        state: &State,
        right: f64,
        own: Option<&PoseCovariance>,
        uncertainty: &mut impl FnMut(&State) -> Option<Covariances>,
    ) -> Option<Alternative> {
        let probability = probability(self.ambiguity, self.this, right)?;
        let (other, covariance) = match self.found {
            Some(other) => (other, own.and_then(|_| uncertainty(&other)).map(|c| c.0)),
            None => {
                let model = object.observation.model();
                let other = turned(state, model);
                (other, own.map(|own| turned_covariance(own, state, &other, model)))
            }
        };
        let (pose, shape_coefficients) = (other.pose.orthonormalized(), other.coefficients);
        let yaw = pose.yaw(object.view);
        Some(Alternative { pose, yaw, shape_coefficients, covariance, probability })
    }
}

/// A probability from what the network says, by a line through the logits.
fn calibrated(said: f64, [bias, slope]: [f64; 2]) -> f64 {
    1.0 / (1.0 + exp(-bias - slope * logit(said, NETWORK_AMBIGUITY_LIMITS)))
}

/// Likelihood of the runner-up relative to the best, from their costs (pixels squared, halved).
fn relative_likelihood(best: f64, runner_up: f64, noise_sigma: f64) -> f64 {
    exp(-(runner_up - best).max(0.0) / square(noise_sigma))
}

/// Turned by half a turn about the vertical through the middle of the 3D box.
pub(crate) fn turned(state: &State, model: &ShapeModel) -> State {
    let middle = middle(state, model);
    let Pose { r, t } = state.pose;
    let mut turned = r;
    for axis in [0, 2] {
        turned.column_mut(axis).neg_mut();
    }
    State { pose: Pose { r: turned, t: t + r * middle - turned * middle }, ..*state }
}

/// The covariance of a pose turned round by [`turned`] from that of the pose: its middle and its rotation err alike.
pub(crate) fn turned_covariance(
    covariance: &PoseCovariance,
    from: &State,
    to: &State,
    model: &ShapeModel,
) -> PoseCovariance {
    let middle = middle(from, model);
    // A rotation vector w moves the middle by w x (R m) and the origin by w x (R m) - w x (R' m), besides the translation.
    let lever: Vector3<f64> = from.pose.r * middle - to.pose.r * middle;
    let mut jacobian = Matrix6::identity();
    jacobian.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-lever).cross_matrix());
    jacobian * covariance * jacobian.transpose()
}

fn middle(state: &State, model: &ShapeModel) -> Vector3<f64> {
    let [min, max] = model.bbox_3d_of(&state.coefficients);
    Vector3::from(core::array::from_fn(|axis| 0.5 * (min[axis] + max[axis])))
}

/// Probability of the viewing angles in the half turned away from a pose.
pub(crate) fn turned_probability(angles: &[f64; VIEWING_ANGLES], state: &State, model: &ShapeModel) -> f64 {
    let Pose { r, .. } = state.pose;
    let [min, max] = model.bbox_3d_of(&state.coefficients);
    let bottom = state.pose.transform([0.5 * (min[0] + max[0]), max[1], 0.5 * (min[2] + max[2])]);
    let rotation_y = atan2(r[(0, 2)], r[(2, 2)]) - core::f64::consts::FRAC_PI_2;
    let alpha = rotation_y - atan2(bottom.x, bottom.z);
    let bin = 2.0 * core::f64::consts::PI / VIEWING_ANGLES as f64;
    let is_away = |b: usize| cos(b as f64 * bin - alpha) < 0.0;
    angles.iter().enumerate().filter(|&(b, _)| is_away(b)).map(|(_, p)| p).sum()
}
