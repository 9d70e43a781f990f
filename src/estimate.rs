//! One object: checks, search, refinement, and the statistics of the pose that is returned.

use crate::camera::View;
use crate::covariance::{PoseCovariance, ShapeCovariance, covariance};
use crate::error::{InputError, NoPose};
use crate::hypothesise::{Hypothesise, usable_bbox};
use crate::lanes::LANES;
use crate::math::{sqrt, square};
use crate::noise::NoiseModel;
use crate::normal::State;
use crate::object::MAX_MODES;
use crate::objective::Objective;
use crate::observation::Observation;
use crate::options::{Options, Solver};
use crate::points::Points;
use crate::pose::Pose;
use crate::priors::Priors;
use crate::ransac::{Candidate, Candidates, RansacStatistics};
use crate::refine::{MAX_STAGES, Refinement, StageStatistics, refine, schedule};
use crate::residual::Projection;
use crate::score::{Scoring, cost};
use crate::simd::VectorUnit;
use crate::workspace::{Buffers, Workspace};

/// The pose and shape of one object. Everything about residuals belongs to the pose returned.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// `camera_from_object`.
    pub pose: Pose,
    /// Yaw about the ground's normal, radians; 0 = facing away from the camera.
    pub yaw: f64,
    /// Shape coefficients, as many as the model has modes; the rest zero.
    pub shape_coefficients: [f64; MAX_MODES],
    /// Threshold, in pixels, that tells inliers.
    pub inlier_threshold: f64,
    /// Keypoints within the threshold.
    pub inlier_count: usize,
    /// Root mean square of the inliers' reprojection errors, pixels.
    pub reprojection_rmse: f64,
    /// Weighted mean over the keypoints of `min(r^2 / threshold^2, 1)`: 0 is perfect, 1 explains nothing.
    pub score: f64,
    /// Log10 of the number of poses as good as this to expect among random keypoints (number of false alarms);
    /// an answer has at most the option's `max_log10_nfa`.
    pub log10_nfa: f64,
    /// Estimated standard deviation of a keypoint's coordinate, pixels.
    pub noise_sigma: f64,
    /// Covariance of the pose, if asked for.
    pub covariance: Option<PoseCovariance>,
    /// Covariance of the shape coefficients, if asked for.
    pub shape_covariance: Option<ShapeCovariance>,
    /// Relative likelihood, 0 to 1, of the best pose that faces another way: near 1, it could be either.
    pub ambiguity: f64,
    /// The search.
    pub ransac: RansacStatistics,
    /// The minimal solver that made the hypothesis.
    pub solver: Solver,
    /// The refinement, stage by stage.
    pub stages: [StageStatistics; MAX_STAGES],
}

impl Estimate {
    fn is_finite(&self) -> bool {
        let residuals = [self.reprojection_rmse, self.score, self.noise_sigma, self.log10_nfa, self.ambiguity];
        residuals.iter().chain(&self.shape_coefficients).all(|x| x.is_finite())
    }
}

/// Estimates poses with options that were checked once.
///
/// ```
/// use groundpose::camera::{Camera, Tilt, View};
/// use groundpose::error::NoPose;
/// use groundpose::estimate::Estimator;
/// use groundpose::object::ShapeModel;
/// use groundpose::observation::Observation;
/// use groundpose::options::Options;
/// use groundpose::pose::Pose;
/// use groundpose::workspace::{FixedWorkspace, Workspace};
///
/// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?;
/// let points = [
///     [-0.8, -0.3, 1.3], [0.8, -0.3, 1.3], [0.8, -0.3, -1.3], [-0.8, -0.3, -1.3],
///     [-0.5, -1.4, 0.3], [0.5, -1.4, 0.3], [0.5, -1.4, -1.3], [-0.5, -1.4, -1.3],
/// ];
/// let model = ShapeModel::rigid(&points, [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])?;
/// let truth = Pose::upright(&view, 0.7, [2.0, 1.5, 15.0].into());
/// let mut pixels = points.map(|x| view.camera.project(&truth.transform(x)).unwrap());
/// pixels[3] = [400.0, 300.0];
///
/// let estimator = Estimator::new(Options { inlier_threshold: Some(4.0), ..Options::default() })?;
/// let mut workspace = FixedWorkspace::<8>::new();
/// // No box is known, so the search uses two keypoints at a time.
/// let observation = Observation::new(&pixels, &model)?;
/// let estimate = estimator.estimate(&view, &observation, &mut workspace).expect("a pose");
/// assert!((estimate.pose.t - truth.t).norm() < 1e-3);
/// assert_eq!(estimate.inlier_count, 7);
/// assert!(workspace.residuals()[3] > 100.0);
///
/// let unseen = [[f64::NAN; 2]; 8];
/// let nothing = estimator.estimate(&view, &Observation::new(&unseen, &model)?, &mut workspace);
/// assert_eq!(nothing.unwrap_err(), NoPose::TooFewKeypoints);
/// # Ok::<(), groundpose::error::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Estimator {
    options: Options,
}

impl Estimator {
    /// An estimator with these options.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(options: Options) -> Result<Self, InputError> {
        options.check()?;
        Ok(Self { options })
    }

    /// The options.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The pose of one object; the draws depend on the seed alone. Allocates nothing but what `workspace` grows by.
    ///
    /// # Errors
    /// [`NoPose`]: the data has no answer.
    pub fn estimate(
        &self,
        view: &View,
        observation: &Observation,
        workspace: &mut impl Workspace,
    ) -> Result<Estimate, NoPose> {
        self.estimate_indexed(view, observation, workspace, 0)
    }

    /// As [`Estimator::estimate`], for object `index` of a batch: the draws depend on (seed, index).
    ///
    /// # Errors
    /// [`NoPose`]: the data has no answer.
    pub fn estimate_indexed(
        &self,
        view: &View,
        observation: &Observation,
        workspace: &mut impl Workspace,
        index: u64,
    ) -> Result<Estimate, NoPose> {
        let mut buffers = workspace.buffers(observation.keypoints_2d().len()).ok_or(NoPose::WorkspaceTooSmall)?;
        if view.camera.distortion.is_none() {
            return self.estimate_ideal(view, observation, buffers, index);
        }
        let pixels = core::mem::take(&mut buffers.pixels);
        for (pixel, &distorted) in pixels.iter_mut().zip(observation.keypoints_2d()) {
            *pixel = view.camera.undistort(distorted).unwrap_or([f64::NAN; 2]);
        }
        let bbox = observation.bbox().map(|bbox| view.undistort_bbox(view.uncut_bbox(bbox)));
        self.estimate_ideal(&view.ideal(), &observation.seen_ideally(pixels, bbox), buffers, index)
    }

    /// Without distortion.
    fn estimate_ideal(
        &self,
        view: &View,
        observation: &Observation,
        buffers: Buffers,
        index: u64,
    ) -> Result<Estimate, NoPose> {
        let points = Points::gather(&view.camera, observation, &self.options, buffers)?;
        Job { unit: VectorUnit::detect(), options: &self.options, view, observation, points }.run(index)
    }
}

/// One object being estimated.
struct Job<'a> {
    unit: VectorUnit,
    options: &'a Options,
    view: &'a View,
    observation: &'a Observation<'a>,
    points: Points<'a>,
}

/// A refined pose and its truncated cost, priors included (pixels squared).
struct Refined {
    state: State,
    stages: [StageStatistics; MAX_STAGES],
    cost: f64,
}

/// Residuals beyond so many standard deviations of the noise count the same when refined poses are compared.
const JUDGING_CUT: f64 = 3.0;
/// Poses whose forward axes differ by more than 30 degrees (cosine) face another way.
const OTHER_WAY: f64 = 0.866;
/// A tilt prior of zero width is the upright pose: as narrow as keeps the equations well conditioned, radians.
const NARROWEST_TILT: f64 = 1e-5;

/// What a refinement asks of the search.
struct Plan {
    candidates: usize,
    worst_ratio: f64,
    min_draws: usize,
}

impl Plan {
    fn of(refinement: Refinement) -> Self {
        match refinement {
            Refinement::Default => Self { candidates: 2, worst_ratio: 1.3, min_draws: 8 },
            _ => Self { candidates: 1, worst_ratio: 1.0, min_draws: 1 },
        }
    }
}

impl Job<'_> {
    fn run(mut self, index: u64) -> Result<Estimate, NoPose> {
        let plan = Plan::of(self.options.refinement);
        let mut candidates = Candidates::new(plan.candidates, plan.worst_ratio);
        let (options, view, observation) = (self.options, self.view, self.observation);
        let search = Hypothesise { unit: self.unit, options, view, observation, min_draws: plan.min_draws };
        let (solver, ransac) = search.run(&mut self.points, index, &mut candidates);
        let (best, runner_up) = self.refine_all(&candidates).ok_or(NoPose::NoHypothesis)?;
        self.finish(best, runner_up, solver, ransac)
    }

    /// What is minimised, with priors weighed against this noise (pixels), and scratch memory.
    fn objective(&mut self, noise_sigma: f64) -> (Objective<'_>, &mut [f64]) {
        let (bbox, camera, options) = (usable_bbox(self.view, self.observation), &self.view.camera, self.options);
        let threshold = self.points.inlier_threshold;
        let priors = Priors {
            noise_sigma,
            tilt_sigma: options.effective_tilt_sigma().max(NARROWEST_TILT),
            shape: options.effective_shape_prior(),
            bbox: [bbox.left - camera.cx, bbox.top - camera.cy, bbox.right - camera.cx, bbox.bottom - camera.cy],
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
    fn refine_all(&mut self, candidates: &Candidates) -> Option<(Refined, f64)> {
        let mut best: Option<Refined> = None;
        let mut runner_up = f64::INFINITY;
        let mut noise_sigma = None;
        for candidate in candidates.iter() {
            let refined = self.refine_one(candidate, &mut noise_sigma);
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

    fn refine_one(&mut self, candidate: &Candidate, noise_sigma: &mut Option<f64>) -> Refined {
        let threshold = self.points.inlier_threshold;
        let refinement = self.options.refinement;
        let stages = schedule(refinement, threshold, self.options.hre_thresholds);
        let (mut objective, scratch) = self.objective(0.5 * threshold);
        let initial = State { pose: candidate.pose, coefficients: [0.0; MAX_MODES] };
        let (state, stages) = refine(&mut objective, scratch, &candidate.pose, &stages);
        let noise = *noise_sigma.get_or_insert_with(|| objective.estimate_noise(&state.pose).sigma);
        objective.priors.noise_sigma = noise;
        objective.priors.use_bbox = true;
        let cut = JUDGING_CUT * noise;
        let cost = truncated_cost(&mut objective, &state, cut);
        if refinement == Refinement::Default {
            // Never a pose that explains the data worse than the hypothesis it came from.
            let initial_cost = truncated_cost(&mut objective, &initial, cut);
            if initial_cost < cost {
                return Refined { state: initial, stages, cost: initial_cost };
            }
        }
        Refined { state, stages, cost }
    }

    /// Everything that is said of the pose returned, from that pose.
    fn finish(
        mut self,
        refined: Refined,
        runner_up: f64,
        solver: Solver,
        ransac: RansacStatistics,
    ) -> Result<Estimate, NoPose> {
        let threshold = self.points.inlier_threshold;
        let state = State { pose: refined.state.pose.orthonormalized(), ..refined.state };
        if !state.pose.is_rigid() {
            return Err(NoPose::Degenerate);
        }
        let (n, weight_sum) = (self.points.count, self.points.weight_sum);
        let are_scores = self.observation.has_scores() && self.options.score_weights;
        let (mut objective, _) = self.objective(0.5 * threshold);
        objective.set_shape(&state.coefficients);
        let noise = objective.estimate_noise(&state.pose);
        let score_sum = are_scores.then_some(weight_sum);
        let log10_nfa =
            objective.noise.consensus(noise, n, score_sum, ransac.hypotheses).log10_nfa(objective.measured());
        let inliers = self.store_residuals();
        if inliers.count == 0 || !(log10_nfa <= self.options.max_log10_nfa) {
            return Err(NoPose::NoConsensus);
        }
        let projection = Projection::new(&self.view.camera, &state.pose);
        let score = cost(self.unit, self.points.blocks(), &projection, Scoring::Msac, square(threshold), f64::INFINITY);
        let covariances = if self.options.covariance {
            let (mut objective, _) = self.objective(noise.sigma);
            Some(covariance(&mut objective, &state, threshold).ok_or(NoPose::Degenerate)?)
        } else {
            None
        };
        let estimate = Estimate {
            pose: state.pose,
            yaw: state.pose.yaw(self.view),
            shape_coefficients: state.coefficients,
            inlier_threshold: threshold,
            inlier_count: inliers.count,
            reprojection_rmse: sqrt(inliers.squares / inliers.count as f64),
            score: score / weight_sum,
            log10_nfa,
            noise_sigma: noise.sigma,
            covariance: covariances.map(|c| c.0),
            shape_covariance: covariances.map(|c| c.1),
            ambiguity: ambiguity(refined.cost, runner_up, noise.sigma.max(0.25 * threshold)),
            ransac,
            solver,
            stages: refined.stages,
        };
        // Numbers so large or small that their squares are not numbers.
        if estimate.is_finite() { Ok(estimate) } else { Err(NoPose::Degenerate) }
    }

    /// Residuals from the squares in the blocks into the caller's workspace; the sums over the inliers.
    fn store_residuals(&mut self) -> Inliers {
        let threshold = self.points.inlier_threshold;
        let buffers = &mut self.points.buffers;
        let mut inliers = Inliers::default();
        for (k, &i) in buffers.visible[..self.points.count].iter().enumerate() {
            let r2 = buffers.blocks[k / LANES].r2.0[k % LANES];
            let r = sqrt(r2);
            buffers.residuals[i as usize] = r;
            if r <= threshold {
                inliers.count += 1;
                inliers.squares += r2;
            }
        }
        inliers
    }
}

/// Sums over the inliers of a pose.
#[derive(Default)]
struct Inliers {
    count: usize,
    squares: f64,
}

/// Likelihood of the runner-up relative to the best, from their costs (pixels squared, halved).
fn ambiguity(best: f64, runner_up: f64, noise_sigma: f64) -> f64 {
    libm::exp(-(runner_up - best).max(0.0) / square(noise_sigma))
}

/// Truncated squared error of a state, priors included (pixels squared, halved); sets the blocks to its shape.
fn truncated_cost(objective: &mut Objective, state: &State, threshold: f64) -> f64 {
    objective.set_shape(&state.coefficients);
    let projection = Projection::new(&objective.view.camera, &state.pose);
    let tau2 = square(threshold);
    let points = cost(objective.unit, objective.blocks, &projection, Scoring::Msac, tau2, f64::INFINITY);
    0.5 * tau2 * points + objective.prior_cost(state)
}
