//! Third step: how a pose stands against chance.

use crate::estimate::attempt::Attempt;
use crate::estimate::object::{Memory, Object};
use crate::estimate::options::Solver;
use crate::estimate::refine::{Refined, RunnerUp};
use crate::estimate::search::Hypotheses;
use crate::search::false_alarms::Consensus;
use crate::search::noise::Noise;
use crate::search::ransac::RansacStatistics;
use crate::tuning::OTHER_WAY;

/// A refined pose and what speaks for it.
#[derive(Clone, Copy)]
pub(crate) struct Verified {
    pub(crate) refined: Refined,
    pub(crate) solver: Solver,
    pub(crate) ransac: RansacStatistics,
    /// Of the keypoints, given the pose.
    pub(crate) noise: Noise,
    /// Log10 of the number of poses as good as this one to expect among random keypoints.
    pub(crate) log10_nfa: f64,
}

/// The pose with its noise and its number of false alarms; none where its attempt may not find it.
pub(crate) fn verify(
    object: &Object,
    attempt: &Attempt,
    hypotheses: &Hypotheses,
    refined: Refined,
    memory: &mut Memory,
) -> Option<Verified> {
    if !attempt.allows(&refined.state.pose) {
        return None;
    }
    let &Hypotheses { solver, ransac, .. } = hypotheses;
    let points = memory.keypoints.measure(&refined.state);
    let noise = refined.noise.unwrap_or_else(|| object.noise.estimate(object.unit, points));
    let are_scores = object.observation.has_scores() && object.options.score_weights;
    let consensus = Consensus {
        unit: object.unit,
        model: &object.noise,
        inlier_fraction: noise.inlier_fraction,
        keypoints: memory.order.len(),
        score_sum: are_scores.then_some(object.weight_sum),
        hypotheses: ransac.hypotheses,
        sample: solver.sample_size(),
    };
    let log10_nfa = consensus.log10_nfa(points) + attempt.price;
    Some(Verified { refined, solver, ransac, noise, log10_nfa })
}

/// The one that chance explains less, with the other as its runner-up where it faces another way.
pub(crate) fn better(first: Option<Verified>, second: Option<Verified>) -> Option<Verified> {
    let (Some(first), Some(second)) = (first, second) else { return first.or(second) };
    let is_first = first.log10_nfa <= second.log10_nfa || second.log10_nfa.is_nan();
    let (mut best, other) = if is_first { (first, second.refined) } else { (second, first.refined) };
    let other_way = best.refined.state.pose.forward_cosine(&other.state.pose) < OTHER_WAY;
    let others = if other_way { Some(other.as_runner_up()) } else { other.runner_up };
    best.refined.runner_up = RunnerUp::better(best.refined.runner_up, others);
    Some(best)
}
