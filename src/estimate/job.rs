//! One object being estimated: hypotheses, their refinement, and how they stand against chance.

use crate::error::NoPose;
use crate::estimate::hypothesise::{Hypothesise, usable_bbox};
use crate::estimate::options::{Options, Solver};
use crate::estimate::points::Points;
use crate::geometry::bbox::Bbox;
use crate::geometry::math::{sqrt, square};
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::model::observation::Observation;
use crate::model::shape_model::MAX_MODES;
use crate::refine::normal::State;
use crate::refine::objective::Objective;
use crate::refine::priors::Priors;
use crate::refine::schedule::{MAX_STAGES, Refinement, StageStatistics, refine, schedule};
use crate::search::false_alarms::Consensus;
use crate::search::noise::{Noise, NoiseModel};
use crate::search::ransac::{Candidate, Candidates, MAX_CANDIDATES, RansacStatistics};
use crate::search::score::{Scoring, cost};
use crate::simd::dispatch::VectorUnit;
use crate::simd::projection::Projection;

/// One object being estimated.
pub(crate) struct Job<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) options: &'a Options,
    pub(crate) view: &'a View,
    pub(crate) observation: &'a Observation<'a>,
    pub(crate) points: Points<'a>,
}

/// What a search found, refined.
pub(crate) struct Found {
    pub(crate) state: State,
    pub(crate) stages: [StageStatistics; MAX_STAGES],
    /// Truncated cost, priors included (pixels squared, halved), and that of the best pose that faces another way.
    pub(crate) cost: f64,
    pub(crate) runner_up: f64,
    pub(crate) solver: Solver,
    pub(crate) ransac: RansacStatistics,
    /// Of the keypoints, given the pose.
    pub(crate) noise: Noise,
    /// Log10 of the number of poses as good as this one to expect among random keypoints.
    pub(crate) log10_nfa: f64,
}

/// A refined pose and its truncated cost, priors included (pixels squared).
struct Refined {
    state: State,
    stages: [StageStatistics; MAX_STAGES],
    cost: f64,
    /// Of the keypoints at this pose, if it is the one they were measured at.
    noise: Option<Noise>,
}

/// Where a candidate was after its first stage, and its cost there (pixels squared, halved).
#[derive(Clone, Copy)]
struct Start {
    pose: Pose,
    cost: f64,
}

/// Residuals beyond so many standard deviations of the noise count the same when refined poses are compared.
const JUDGING_CUT: f64 = 3.0;
/// Poses whose forward axes differ by more than 30 degrees (cosine) face another way.
const OTHER_WAY: f64 = 0.866;
/// Poses whose forward axes differ by less than 3 degrees (cosine) after the first stage end in the same place.
const SAME_WAY: f64 = 0.9986;
/// A candidate that costs so many times the best one after the first stage does not win: of cars whose second
/// candidate ended elsewhere it did so in 2 of 415 cases.
const HOPELESS: f64 = 2.0;
/// A tilt prior of zero width is the upright pose: as narrow as keeps the equations well conditioned, radians.
const NARROWEST_TILT: f64 = 1e-5;

/// The solver's 3 % of the distance is as wide as a car at 60 m. On KITTI's cars, whose boxes hold what is visible, room
/// of one inlier threshold loses right answers, of three loses none.
const ROOM: f64 = 4.0;

/// What a second try has to be better by (log10 of false alarms): chance has 1.2 tries in all.
const SECOND_TRY: f64 = 0.7;
/// An object looks at least so large, as a share of its 2D box.
const SMALLEST_LOOK: f64 = 0.5;

/// What a refinement asks of the search.
struct Plan {
    candidates: usize,
    worst_ratio: f64,
    min_draws: usize,
    /// A pose with more false alarms than this (log10) is doubtful: where the solver is ours to choose, the search is
    /// done again without the box, a side of which may be wrong. `None`: never again.
    doubtful: Option<f64>,
    /// Largest depth of a hypothesis, metres.
    farthest: f64,
    /// How far the corners of the 3D box may be outside the sides of its 2D box, in inlier thresholds.
    room: f64,
}

impl Plan {
    fn of(refinement: Refinement) -> Self {
        match refinement {
            Refinement::Default => Self {
                candidates: 2,
                worst_ratio: 1.3,
                min_draws: 8,
                doubtful: Some(-6.0),
                farthest: f64::INFINITY,
                room: ROOM,
            },
            _ => Self {
                candidates: 1,
                worst_ratio: 1.0,
                min_draws: 1,
                doubtful: None,
                farthest: f64::INFINITY,
                room: f64::INFINITY,
            },
        }
    }
}

impl<'a> Job<'a> {
    /// The best pose; afterwards the blocks hold its shape and squared residuals. Object `index` of a batch has draws
    /// of its own.
    pub(crate) fn run(&mut self, index: u64) -> Result<Found, NoPose> {
        let plan = Plan::of(self.options.refinement);
        let (solver, bbox) = self.hypothesise(&plan).choose_solver();
        let mut noise_sigma = None;
        let first = self.search(&plan, solver, &bbox, index, &mut noise_sigma);
        let used_the_box = self.options.solver == Solver::Auto && solver != Solver::Up2p;
        let is_settled = |limit| first.as_ref().is_some_and(|found| found.log10_nfa <= limit);
        if !used_the_box || plan.doubtful.is_none_or(is_settled) {
            return first.ok_or(NoPose::NoHypothesis);
        }
        // The blocks hold the shape of the first.
        self.objective(0.0).0.set_shape(&[0.0; MAX_MODES]);
        let plan = Plan { farthest: self.farthest(&bbox), ..plan };
        let second = self.search(&plan, Solver::Up2p, &bbox, index, &mut noise_sigma);
        // The refinement may have moved it.
        let second = second.filter(|found| found.state.pose.t.z <= plan.farthest);
        let second = second.map(|found| Found { log10_nfa: found.log10_nfa + SECOND_TRY, ..found });
        // The blocks hold the second: the first is judged again before it is described.
        match (first, second) {
            (Some(first), Some(second)) => Ok(self.better(first, second)),
            (Some(first), None) => Ok(self.judge_again(first)),
            (None, second) => second.ok_or(NoPose::NoHypothesis),
        }
    }

    /// Depth, metres, beyond which the object could not look as large as its 2D box says. A detector that finds
    /// nothing puts many keypoints in one place: they agree on an object far away.
    fn farthest(&self, bbox: &Bbox) -> f64 {
        let Some(longer_side) = bbox.longer_side() else { return f64::INFINITY };
        let [min, max] = *self.observation.model().bbox_3d();
        let diagonal = sqrt((0..3).map(|axis| square(max[axis] - min[axis])).sum());
        let camera = &self.view.camera;
        camera.fx.max(camera.fy) * diagonal / (SMALLEST_LOOK * longer_side)
    }

    /// The one that chance explains less, with the other as its runner-up where it faces another way.
    fn better(&mut self, first: Found, second: Found) -> Found {
        let is_first = first.log10_nfa <= second.log10_nfa || second.log10_nfa.is_nan();
        let (mut best, other) = if is_first { (first, second) } else { (second, first) };
        let other_way = best.state.pose.forward_cosine(&other.state.pose) < OTHER_WAY;
        best.runner_up = best.runner_up.min(if other_way { other.cost } else { other.runner_up });
        if is_first { self.judge_again(best) } else { best }
    }

    /// The blocks hold its shape and squared residuals once more.
    fn judge_again(&mut self, found: Found) -> Found {
        let noise = found.noise;
        self.judge(found, Some(noise))
    }

    fn hypothesise(&self, plan: &Plan) -> Hypothesise<'a> {
        let (options, view, observation) = (self.options, self.view, self.observation);
        let Plan { min_draws, farthest, room, .. } = *plan;
        Hypothesise { unit: self.unit, options, view, observation, min_draws, farthest, room }
    }

    /// The best pose from the hypotheses of one solver. The first search finds the noise by which all are compared.
    fn search(
        &mut self,
        plan: &Plan,
        solver: Solver,
        bbox: &Bbox,
        index: u64,
        noise_sigma: &mut Option<f64>,
    ) -> Option<Found> {
        let mut candidates = Candidates::new(plan.candidates, plan.worst_ratio);
        let ransac = self.hypothesise(plan).run(solver, bbox, &mut self.points, index, &mut candidates);
        let (Refined { state, stages, cost, noise }, runner_up) = self.refine_all(&candidates, noise_sigma)?;
        let state = State { pose: state.pose.orthonormalized(), ..state };
        let unknown = Noise { sigma: f64::NAN, share: f64::NAN };
        let found = Found { state, stages, cost, runner_up, solver, ransac, noise: unknown, log10_nfa: f64::NAN };
        Some(self.judge(found, noise))
    }

    /// The same with its noise, unless it is known already, and its number of false alarms; the blocks hold its shape
    /// and squared residuals.
    fn judge(&mut self, found: Found, noise: Option<Noise>) -> Found {
        let (n, weight_sum) = (self.points.count, self.points.weight_sum);
        let are_scores = self.observation.has_scores() && self.options.score_weights;
        let (mut objective, _) = self.objective(0.5 * self.points.inlier_threshold);
        objective.set_shape(&found.state.coefficients);
        objective.measure(&found.state.pose);
        let noise = noise.unwrap_or_else(|| objective.noise.estimate(objective.unit, objective.blocks));
        let consensus = Consensus {
            unit: objective.unit,
            model: &objective.noise,
            share: noise.share,
            keypoints: n,
            score_sum: are_scores.then_some(weight_sum),
            hypotheses: found.ransac.hypotheses,
            sample: found.solver.sample_size(),
        };
        let log10_nfa = consensus.log10_nfa(objective.blocks);
        Found { noise, log10_nfa, ..found }
    }

    /// What is minimised, with priors weighed against this noise (pixels), and scratch memory.
    pub(crate) fn objective(&mut self, noise_sigma: f64) -> (Objective<'_>, &mut [f64]) {
        let (bbox, camera, options) = (usable_bbox(self.view, self.observation), &self.view.camera, self.options);
        let threshold = self.points.inlier_threshold;
        let [left, top] = camera.centred([bbox.left, bbox.top]);
        let [right, bottom] = camera.centred([bbox.right, bbox.bottom]);
        let priors = Priors {
            noise_sigma,
            tilt_sigma: options.effective_tilt_sigma().max(NARROWEST_TILT),
            shape: options.effective_shape_prior(),
            bbox: [left, top, right, bottom],
            use_bbox: true,
            bbox_sigma: options.effective_bbox_sigma(threshold),
        };
        let (count, blocks) = (self.points.count, self.points.blocks().len());
        let buffers = &mut self.points.buffers;
        let objective = Objective {
            unit: self.unit,
            view: self.view,
            model: self.observation.model(),
            visible: &buffers.visible[..count],
            blocks: &mut buffers.blocks[..blocks],
            priors,
            noise: NoiseModel { guess: 0.5 * threshold, area: self.points.outlier_area },
        };
        (objective, &mut buffers.scratch[..count])
    }

    /// Refines every candidate; the best, and the cost of the best one that faces another way. All are judged by the
    /// same noise: that of the first.
    fn refine_all(&mut self, candidates: &Candidates, noise_sigma: &mut Option<f64>) -> Option<(Refined, f64)> {
        let mut starts = [None; MAX_CANDIDATES];
        let mut best: Option<Refined> = None;
        let mut runner_up = f64::INFINITY;
        for (k, candidate) in candidates.iter().enumerate() {
            let (starts, unused) = starts.split_at_mut(k);
            let Some(refined) = self.refine_one(candidate, noise_sigma, starts, &mut unused[0]) else { continue };
            let Some(current) = &best else {
                best = Some(refined);
                continue;
            };
            let other_way = current.state.pose.forward_cosine(&refined.state.pose) < OTHER_WAY;
            if refined.cost < current.cost {
                runner_up = if other_way { current.cost } else { runner_up };
                best = Some(refined);
            } else if other_way {
                runner_up = runner_up.min(refined.cost);
            }
        }
        best.map(|b| (b, runner_up))
    }

    /// A refined candidate; none where it goes where an earlier one went. `start` becomes where it was after its first
    /// stage; when it is hopeless there, that is all there is.
    fn refine_one(
        &mut self,
        candidate: &Candidate,
        noise_sigma: &mut Option<f64>,
        earlier: &[Option<Start>],
        start: &mut Option<Start>,
    ) -> Option<Refined> {
        let threshold = self.points.inlier_threshold;
        let refinement = self.options.refinement;
        let schedule = schedule(refinement, threshold, self.options.hre_thresholds);
        let (mut objective, scratch) = self.objective(0.5 * threshold);
        let mut is_same = false;
        let slack = square(objective.noise.guess);
        let (state, stages) = refine(&mut objective, scratch, &candidate.pose, &schedule, |pose, cost| {
            *start = Some(Start { pose: *pose, cost });
            let earlier = earlier.iter().flatten();
            is_same = earlier.clone().any(|e| e.pose.forward_cosine(pose) > SAME_WAY);
            let least = earlier.map(|e| e.cost).fold(f64::INFINITY, f64::min);
            !is_same && !(cost > HOPELESS * least + slack)
        });
        if is_same {
            return None;
        }
        let noise = match noise_sigma {
            Some(_) => None,
            None => Some(objective.estimate_noise(&state.pose)),
        };
        let sigma = *noise_sigma.get_or_insert(noise.map_or(f64::NAN, |noise| noise.sigma));
        objective.priors.noise_sigma = sigma;
        objective.priors.use_bbox = true;
        let cut = JUDGING_CUT * sigma;
        let cost = truncated_cost(&mut objective, &state, cut, f64::INFINITY);
        if refinement == Refinement::Default {
            // Never a pose that explains the data worse than the hypothesis it came from.
            let initial = State { pose: candidate.pose, coefficients: [0.0; MAX_MODES] };
            let initial_cost = truncated_cost(&mut objective, &initial, cut, cost);
            if initial_cost < cost {
                return Some(Refined { state: initial, stages, cost: initial_cost, noise: None });
            }
        }
        Some(Refined { state, stages, cost, noise })
    }
}

/// Truncated squared error of a state, priors included (pixels squared, halved), or infinity where the keypoints alone
/// cost `bound`; sets the blocks to its shape.
fn truncated_cost(objective: &mut Objective, state: &State, threshold: f64, bound: f64) -> f64 {
    objective.set_shape(&state.coefficients);
    let projection = Projection::new(&objective.view.camera, &state.pose);
    let tau2 = square(threshold);
    let scale = 0.5 * tau2;
    let points = cost(objective.unit, objective.blocks, &projection, Scoring::Msac, tau2, bound / scale);
    if points.is_finite() { scale * points + objective.prior_cost(state) } else { f64::INFINITY }
}
