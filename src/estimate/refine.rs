//! Second step: every hypothesis to the pose and shape that fit all keypoints; the best of them.

use crate::estimate::object::{Memory, Object};
use crate::estimate::search::Hypotheses;
use crate::geometry::math::square;
use crate::geometry::pose::Pose;
use crate::model::shape_model::MAX_MODES;
use crate::refine::keypoints::Keypoints;
use crate::refine::normal::State;
use crate::refine::objective::Objective;
use crate::refine::priors::Priors;
use crate::refine::schedule::{MAX_STAGES, Refinement, StageStatistics, refine as run_stages, schedule};
use crate::search::noise::Noise;
use crate::search::ransac::{Candidate, MAX_CANDIDATES};
use crate::tuning::{HOPELESS, JUDGING_CUT, NARROWEST_TILT, OTHER_WAY, SAME_WAY};

/// The best of the refined hypotheses.
#[derive(Clone, Copy)]
pub(crate) struct Refined {
    pub(crate) state: State,
    pub(crate) stages: [StageStatistics; MAX_STAGES],
    /// Truncated cost, priors included (pixels squared, halved).
    pub(crate) cost: f64,
    /// The best pose that faces another way.
    pub(crate) runner_up: Option<RunnerUp>,
    /// Of the keypoints at this pose, if they were measured there.
    pub(crate) noise: Option<Noise>,
    /// Standard deviation, pixels, of the noise by which costs were compared.
    pub(crate) compared_by: f64,
}

/// A pose that lost, and its cost as that of [`Refined`].
#[derive(Clone, Copy)]
pub(crate) struct RunnerUp {
    pub(crate) state: State,
    pub(crate) cost: f64,
}

impl RunnerUp {
    /// The one that costs less.
    pub(crate) fn better(this: Option<Self>, other: Option<Self>) -> Option<Self> {
        match (this, other) {
            (Some(this), Some(other)) => Some(if other.cost < this.cost { other } else { this }),
            (this, other) => this.or(other),
        }
    }
}

/// Where a candidate was after its first stage, and its cost there (pixels squared, halved).
#[derive(Clone, Copy)]
struct Start {
    pose: Pose,
    cost: f64,
}

/// Refines hypotheses; none where there are none. All are compared by the same noise (pixels): the one given, or that of
/// the first.
pub(crate) fn refine(
    object: &Object,
    hypotheses: &Hypotheses,
    noise_sigma: Option<f64>,
    memory: &mut Memory,
) -> Option<Refined> {
    let mut starts = [None; MAX_CANDIDATES];
    let mut best: Option<Refined> = None;
    for (k, candidate) in hypotheses.candidates.iter().enumerate() {
        let (earlier, unused) = starts.split_at_mut(k);
        let compared_by = best.map_or(noise_sigma, |best| Some(best.compared_by));
        let refined = refine_one(object, candidate, compared_by, memory, earlier, &mut unused[0]);
        best = match (best, refined) {
            (Some(best), Some(refined)) => Some(better(best, refined)),
            (best, refined) => best.or(refined),
        };
    }
    best.map(|best| Refined { state: State { pose: best.state.pose.orthonormalized(), ..best.state }, ..best })
}

impl Refined {
    pub(crate) fn as_runner_up(&self) -> RunnerUp {
        RunnerUp { state: self.state, cost: self.cost }
    }
}

/// The one that costs less, with the other as its runner-up where it faces another way.
fn better(best: Refined, other: Refined) -> Refined {
    let other_way = best.state.pose.forward_cosine(&other.state.pose) < OTHER_WAY;
    let (is_other, runner_up) = (other.cost < best.cost, best.runner_up);
    let runner_up = match (other_way, is_other) {
        (false, _) => runner_up,
        (true, true) => Some(best.as_runner_up()),
        (true, false) => RunnerUp::better(runner_up, Some(other.as_runner_up())),
    };
    Refined { runner_up, ..if is_other { other } else { best } }
}

/// A refined candidate; none where it goes where an earlier one went. `start` becomes where it was after its first
/// stage; when it is hopeless there, that is all there is.
fn refine_one(
    object: &Object,
    candidate: &Candidate,
    compared_by: Option<f64>,
    memory: &mut Memory,
    earlier: &[Option<Start>],
    start: &mut Option<Start>,
) -> Option<Refined> {
    let refinement = object.options.refinement;
    let schedule = schedule(refinement, object.inlier_threshold, object.options.hre_thresholds);
    let mut objective = objective(object, memory.keypoints.lend(), object.noise.guess);
    let mut is_same = false;
    let slack = square(object.noise.guess);
    let (state, stages) = run_stages(&mut objective, memory.scratch, &candidate.pose, &schedule, |pose, cost| {
        *start = Some(Start { pose: *pose, cost });
        let earlier = earlier.iter().flatten();
        is_same = earlier.clone().any(|e| e.pose.forward_cosine(pose) > SAME_WAY);
        let least = earlier.map(|e| e.cost).fold(f64::INFINITY, f64::min);
        !is_same && !(cost > HOPELESS * least + slack)
    });
    if is_same {
        return None;
    }
    let noise = if compared_by.is_none() { Some(objective.estimate_noise(&state)) } else { None };
    let sigma = compared_by.or(noise.map(|noise| noise.sigma)).unwrap_or(f64::NAN);
    (objective.priors.noise_sigma, objective.priors.use_bbox) = (sigma, true);
    let cut = JUDGING_CUT * sigma;
    let cost = objective.truncated_cost(&state, cut, f64::INFINITY);
    let refined = Refined { state, stages, cost, runner_up: None, noise, compared_by: sigma };
    if refinement == Refinement::Default {
        // Never a pose that explains the data worse than the hypothesis it came from.
        let initial = State { pose: candidate.pose, coefficients: [0.0; MAX_MODES] };
        let initial_cost = objective.truncated_cost(&initial, cut, cost);
        if initial_cost < cost {
            return Some(Refined { state: initial, cost: initial_cost, noise: None, ..refined });
        }
    }
    Some(refined)
}

/// What is minimised, with priors weighed against this noise (pixels).
pub(crate) fn objective<'m>(object: &'m Object, keypoints: Keypoints<'m>, noise_sigma: f64) -> Objective<'m> {
    Objective { view: object.view, keypoints, priors: priors(object, noise_sigma), noise: object.noise }
}

/// Its priors.
pub(crate) fn priors(object: &Object, noise_sigma: f64) -> Priors {
    let (bbox, camera, options) = (&object.usable_bbox, &object.view.camera, object.options);
    let [left, top] = camera.centred([bbox.left, bbox.top]);
    let [right, bottom] = camera.centred([bbox.right, bbox.bottom]);
    Priors {
        noise_sigma,
        tilt_sigma: options.effective_tilt_sigma().max(NARROWEST_TILT),
        shape: options.effective_shape_prior(),
        bbox: [left, top, right, bottom],
        use_bbox: true,
        bbox_sigma: options.effective_bbox_sigma(object.inlier_threshold),
    }
}
