//! From the keypoints of one object to its pose: search, refine, verify, describe.
//!
//! A step takes what is known of the object and what the step before returned. [`Memory`] is room to work in: no step
//! reads what another left there.

use crate::error::NoPose;
use crate::estimate::attempt::Attempt;
use crate::estimate::describe::{Estimate, describe};
use crate::estimate::object::{Memory, Object};
use crate::estimate::refine::refine;
use crate::estimate::search::search;
use crate::estimate::verify::{Verified, better, verify};

/// The pose of one object.
///
/// # Errors
/// The data has no answer.
pub(crate) fn estimate(object: &Object, memory: &mut Memory) -> Result<Estimate, NoPose> {
    let mut answer = |attempt: &Attempt, noise_sigma: Option<f64>| -> Option<Verified> {
        // Poses from few keypoints, by a solver and random draws; those that most keypoints agree with.
        let hypotheses = search(object, attempt, memory);
        // Each to the pose and shape that fit all keypoints, robustly; the best.
        let refined = refine(object, &hypotheses, noise_sigma, memory)?;
        // How it stands against chance.
        verify(object, attempt, &hypotheses, refined, memory)
    };
    let attempt = Attempt::first(object);
    let first = answer(&attempt, None);
    // Where chance explains it nearly as well, without the box: all poses are compared by the same noise.
    let second = attempt.second(object, first.as_ref().map(|first| first.log10_nfa)).and_then(|attempt| {
        let noise_sigma = first.as_ref().map(|first| first.refined.compared_by);
        answer(&attempt, noise_sigma)
    });
    let best = better(first, second).ok_or(NoPose::NoHypothesis)?;
    // What is said of it: residuals, score, covariances, ambiguity.
    describe(object, &best, memory)
}
