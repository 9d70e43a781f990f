//! Third step: how a pose stands against chance.

use crate::estimate::attempt::Attempt;
use crate::estimate::looks::Looks;
use crate::estimate::object::{Memory, Object};
use crate::estimate::options::Solver;
use crate::estimate::refine::{Refined, RunnerUp};
use crate::estimate::search::Hypotheses;
use crate::search::false_alarms::Consensus;
use crate::search::noise::Noise;
use crate::search::ransac::RansacStatistics;
use crate::tuning::{OTHER_WAY, THIRD_KEYPOINT};

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
    /// The projected 3D box beside the 2D box.
    pub(crate) looks: Looks,
}

impl Verified {
    /// What may not convince: log10 of false alarms, misfit of the box.
    pub(crate) fn doubts(&self) -> [f64; 2] {
        [self.log10_nfa, self.looks.misfit.unwrap_or(0.0)]
    }

    /// Whether keypoints and box speak more for it, a pose without the ground, than for one on the ground, and the
    /// keypoints alone at least as much.
    pub(crate) fn convinces_more_than(&self, on_ground: &Self) -> bool {
        let against = |pose: &Self| pose.log10_nfa + pose.looks.log10_against();
        self.log10_nfa < on_ground.log10_nfa + THIRD_KEYPOINT && against(self) < against(on_ground)
    }

    /// With another one as its runner-up where that faces another way.
    pub(crate) fn over(mut self, other: &Self) -> Self {
        let other_way = self.refined.state.pose.forward_cosine(&other.refined.state.pose) < OTHER_WAY;
        let other = if other_way { Some(other.refined.as_runner_up()) } else { other.refined.runner_up };
        self.refined.runner_up = RunnerUp::better(self.refined.runner_up, other);
        self
    }
}

/// The pose with its noise and its number of false alarms; none where its attempt may not find it.
pub(crate) fn verify(
    object: &Object,
    attempt: &Attempt,
    hypotheses: &Hypotheses,
    refined: Refined,
    memory: &mut Memory,
) -> Option<Verified> {
    let looks = Looks::of(object, &refined.state);
    if !attempt.allows(&refined.state.pose, looks.misfit.unwrap_or(0.0)) {
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
    Some(Verified { refined, solver, ransac, noise, log10_nfa, looks })
}

/// The one that chance explains less, with the other as its runner-up where it faces another way.
pub(crate) fn better(first: Option<Verified>, second: Option<Verified>) -> Option<Verified> {
    let (Some(first), Some(second)) = (first, second) else { return first.or(second) };
    let is_first = first.log10_nfa <= second.log10_nfa || second.log10_nfa.is_nan();
    Some(if is_first { first.over(&second) } else { second.over(&first) })
}
