//! Backward: what later frames say of earlier ones (Rauch, Tung, Striebel 1965).

use crate::track::model::{Belief, StateMatrix, symmetric};
use crate::track::standing;

/// A frame of the filter, as smoothing needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// Derivative of the prediction by the belief of the step before.
    pub(crate) by_before: StateMatrix,
    pub(crate) predicted: Belief,
    pub(crate) updated: Belief,
    pub(crate) standing: bool,
}

/// Beliefs given all steps, in order, and whether the vehicle stands: one that stands later stood before, as far back as
/// nothing says that it moved. `moving_sigma`: of its velocity where it moves.
pub(crate) fn smoothed(steps: &[Step], moving_sigma: f64) -> Vec<(Belief, bool)> {
    let mut found: Vec<(Belief, bool)> = steps.iter().map(|step| (step.updated, step.standing)).collect();
    for k in (0..steps.len().saturating_sub(1)).rev() {
        let (now, next, (later, stands_later)) = (&steps[k].updated, &steps[k + 1], found[k + 1]);
        // P F^T of the prediction's covariance, by its Cholesky factor.
        let Some(root) = next.predicted.covariance.cholesky() else { continue };
        let gain = root.solve(&(next.by_before * now.covariance)).transpose();
        let mean = now.mean + gain * (later.mean - next.predicted.mean);
        let covariance = now.covariance + gain * (later.covariance - next.predicted.covariance) * gain.transpose();
        let mut belief = Belief { mean, covariance: symmetric(&covariance) };
        let stood = !steps[k].standing && stands_later && standing::is_likely(&belief, moving_sigma);
        if stood {
            standing::hold_still(&mut belief);
        }
        found[k] = (belief, steps[k].standing || stood);
    }
    found
}
