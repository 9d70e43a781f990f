//! From the keypoints of one object to its pose: search, refine, verify, describe.
//!
//! A step takes what is known of the object and what the step before returned. [`Memory`] is room to work in: no step
//! reads what another left there.

use crate::error::NoPose;
use crate::estimate::attempt::Attempt;
use crate::estimate::describe::{Estimate, describe};
use crate::estimate::object::{Memory, Object};
use crate::estimate::options::Options;
use crate::estimate::refine::refine;
use crate::estimate::search::search;
use crate::estimate::verify::{Verified, better, verify};
use crate::estimate::workspace::Buffers;
use crate::geometry::view::View;
use crate::model::observation::Observation;

/// The pose of what is seen through an ideal lens. A call of its own: whatever lens it comes through, this is on the stack
/// once.
///
/// # Errors
/// The data has no answer.
#[inline(never)]
pub(crate) fn estimate_ideal(
    view: &View,
    observation: &Observation,
    options: &Options,
    index: u64,
    buffers: Buffers,
) -> Result<Estimate, NoPose> {
    let (object, mut memory) = Object::gather(view, observation, options, index, buffers)?;
    estimate(&object, &mut memory)
}

/// The pose of one object.
///
/// # Errors
/// The data has no answer.
fn estimate(object: &Object, memory: &mut Memory) -> Result<Estimate, NoPose> {
    let attempt = Attempt::first(object);
    let first = answer(object, &attempt, None, memory);
    // Where chance explains it nearly as well, without the box: all poses are compared by the same noise.
    let second = attempt.second(object, first.as_ref().map(|first| first.log10_nfa)).and_then(|attempt| {
        let noise_sigma = first.as_ref().map(|first| first.refined.compared_by);
        answer(object, &attempt, noise_sigma, memory)
    });
    let best = if second.is_none() { first } else { better(first, second) };
    match attempt.last(object, best.as_ref().map(Verified::doubts)) {
        // What is said of it: residuals, score, covariances, ambiguity.
        None => describe(object, best.as_ref().ok_or(NoPose::NoHypothesis)?, memory),
        // Where neither the keypoints nor the box convince, without the ground.
        Some((attempt, options)) => {
            without_ground(&Object { options: &options, ..*object }, object, &attempt, best.as_ref(), memory)
        }
    }
}

/// The pose of one attempt.
fn answer(object: &Object, attempt: &Attempt, noise_sigma: Option<f64>, memory: &mut Memory) -> Option<Verified> {
    // Poses from few keypoints, by a solver and random draws; those that most keypoints agree with.
    let hypotheses = search(object, attempt, memory);
    // Each to the pose and shape that fit all keypoints, robustly; the best.
    let refined = refine(object, &hypotheses, noise_sigma, memory)?;
    // How it stands against chance.
    verify(object, attempt, &hypotheses, refined, memory)
}

/// What an attempt finds for an object that is `free` of the ground, where it convinces more than what was found `on_ground`.
/// A call of its own: it is rare.
#[inline(never)]
fn without_ground(
    free: &Object,
    on_ground: &Object,
    attempt: &Attempt,
    found: Option<&Verified>,
    memory: &mut Memory,
) -> Result<Estimate, NoPose> {
    let noise_sigma = found.map(|found| found.refined.compared_by);
    let last = answer(free, attempt, noise_sigma, memory);
    match (last, found) {
        (Some(last), None) => describe(free, &last, memory),
        (Some(last), Some(found)) if last.convinces_more_than(found) => describe(free, &last.over(found), memory),
        (_, found) => describe(on_ground, found.ok_or(NoPose::NoHypothesis)?, memory),
    }
}
