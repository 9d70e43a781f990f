//! Whether a vehicle stands, and what that says of it.

use nalgebra::{Matrix2, Vector2};

use crate::geometry::math::{log, square};
use crate::track::model::{ACCELERATION, Belief, TURNING, VX, VZ};

/// Logarithm of the Bayes factor from which a vehicle stands.
const LEAST_FACTOR: f64 = 5.0;
/// Largest standard deviation of its speed then, m/s: slower vehicles than this are few.
const MOST_SIGMA: f64 = 1.5;
/// Squared statistical distance of its velocity from none: most vehicles that stand are nearer.
const MOST_AGAINST: f64 = 3.0;
/// Of a vehicle that stands: speed m/s, yaw rate rad/s.
const STILL: (f64, f64) = (0.05, 0.01);

/// Against any velocity, of this standard deviation.
pub(crate) fn is_likely(belief: &Belief, moving_sigma: f64) -> bool {
    let v = Vector2::new(belief.mean[VX], belief.mean[VZ]);
    let still = belief.covariance.fixed_view::<2, 2>(VX, VX) + Matrix2::identity() * square(STILL.0);
    let moving = still + Matrix2::identity() * square(moving_sigma);
    let (Some(near), Some(far)) = (still.try_inverse(), moving.try_inverse()) else { return false };
    let against = v.dot(&(near * v));
    let factor = 0.5 * (log(moving.determinant() / still.determinant()) - against + v.dot(&(far * v)));
    against < MOST_AGAINST && factor > LEAST_FACTOR && still.trace() < square(MOST_SIGMA)
}

/// It has no speed.
pub(crate) fn hold_still(belief: &mut Belief) {
    for (k, sigma) in [(VX, STILL.0), (VZ, STILL.0), (TURNING, STILL.1), (ACCELERATION, STILL.0)] {
        belief.update_one(&[(k, 1.0)], -belief.mean[k], square(sigma));
    }
}
