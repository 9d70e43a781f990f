//! Backward: what later frames say of earlier ones (Rauch, Tung, Striebel 1965).

use crate::track::model::{Belief, StateMatrix, symmetric};

/// A frame of the filter, as smoothing needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// Derivative of the prediction by the belief of the step before.
    pub(crate) by_before: StateMatrix,
    pub(crate) predicted: Belief,
    pub(crate) updated: Belief,
}

/// Beliefs given all steps, in order.
pub(crate) fn smoothed(steps: &[Step]) -> Vec<Belief> {
    let mut found: Vec<Belief> = steps.iter().map(|step| step.updated).collect();
    for k in (0..steps.len().saturating_sub(1)).rev() {
        let (now, next, later) = (&steps[k].updated, &steps[k + 1], found[k + 1]);
        // P F^T of the prediction's covariance, by its Cholesky factor.
        let Some(root) = next.predicted.covariance.cholesky() else { continue };
        let gain = root.solve(&(next.by_before * now.covariance)).transpose();
        let mean = now.mean + gain * (later.mean - next.predicted.mean);
        let covariance = now.covariance + gain * (later.covariance - next.predicted.covariance) * gain.transpose();
        found[k] = Belief { mean, covariance: symmetric(&covariance) };
    }
    found
}
