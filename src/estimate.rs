//! One object: checks, search, refinement, and the statistics of the pose that is returned.

use nalgebra::{SMatrix, Vector3};

use crate::camera::View;
use crate::error::{InputError, NoPose};
use crate::lanes::LANES;
use crate::lm::{Objective, State, cholesky, padded_modes, solve_cholesky};
use crate::loss::Kernel;
use crate::math::{sqrt, square};
use crate::minimal::p1p::P1p;
use crate::minimal::p1p_height::P1pHeight;
use crate::minimal::p3p::P3p;
use crate::minimal::up2p::Up2p;
use crate::noise::{Noise, NoiseModel};
use crate::object::{Bbox, MAX_MODES};
use crate::observation::Observation;
use crate::options::{Options, Solver};
use crate::pose::Pose;
use crate::priors::Priors;
use crate::ransac::{Candidate, Candidates, RansacStatistics, Search};
use crate::refine::{MAX_STAGES, Refinement, StageStatistics, refine, schedule};
use crate::residual::Projection;
use crate::sampler::Stream;
use crate::score;
use crate::simd::VectorUnit;
use crate::workspace::{Buffers, Workspace};

/// Covariance of a pose: rotation vector on the left (camera frame, radians), then translation (metres).
pub type PoseCovariance = SMatrix<f64, 6, 6>;
/// Covariance of the shape coefficients, in the leading rows and columns.
pub type ShapeCovariance = SMatrix<f64, MAX_MODES, MAX_MODES>;

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

/// Estimates poses with options that were checked once.
#[derive(Clone, Copy, Debug)]
pub struct Estimator {
    options: Options,
}

/// Extent of the keypoints below which they are one point, pixels or metres.
const SMALLEST_EXTENT: f64 = 1e-6;
/// Distance from a line, as a share of its length, below which points are collinear.
const COLLINEAR: f64 = 1e-6;
/// Noise, in inlier thresholds, at which a pose is tested against chance: fixed, so that chance cannot choose it.
const TESTED_NOISE: f64 = 0.7;
/// Columns this close to the image border are cut by it.
const BORDER_PX: f64 = 1.5;

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
        let buffers = workspace.buffers(observation.keypoints_2d().len()).ok_or(NoPose::WorkspaceTooSmall)?;
        Job::new(&self.options, view, observation, buffers)?.run(index)
    }
}

/// One object being estimated.
struct Job<'a> {
    unit: VectorUnit,
    options: &'a Options,
    view: &'a View,
    observation: &'a Observation<'a>,
    buffers: Buffers<'a>,
    visible_count: usize,
    inlier_threshold: f64,
    /// Where an outlier falls, pixels squared.
    outlier_area: f64,
    weight_sum: f64,
}

/// A refined pose and its truncated cost, priors included (pixels squared).
struct Refined {
    state: State,
    stages: [StageStatistics; MAX_STAGES],
    cost: f64,
}

impl<'a> Job<'a> {
    fn new(
        options: &'a Options,
        view: &'a View,
        observation: &'a Observation<'a>,
        buffers: Buffers<'a>,
    ) -> Result<Self, NoPose> {
        let mut job = Self {
            unit: VectorUnit::detect(),
            options,
            view,
            observation,
            buffers,
            visible_count: 0,
            inlier_threshold: 0.0,
            outlier_area: 0.0,
            weight_sum: 0.0,
        };
        job.gather();
        if job.visible_count < options.min_keypoints {
            return Err(NoPose::TooFewKeypoints);
        }
        job.check_spread()?;
        job.inlier_threshold = job.threshold();
        job.outlier_area = job.outlier_area();
        Ok(job)
    }

    /// Visible keypoints into blocks; scores into weights of at most one.
    fn gather(&mut self) {
        let (observation, camera) = (self.observation, &self.view.camera);
        self.buffers.residuals.fill(f64::NAN);
        let visible = (0..observation.keypoints_2d().len()).filter(|&i| observation.is_visible(i));
        let highest = visible.clone().map(|i| observation.score(i)).fold(0.0, f64::max);
        let mut n = 0;
        for i in visible {
            let [u, v] = observation.keypoints_2d()[i];
            let [x, y, z] = observation.model().mean()[i];
            let weight = if self.options.score_weights { observation.score(i) / highest } else { 1.0 };
            let (block, lane) = (&mut self.buffers.blocks[n / LANES], n % LANES);
            (block.u.0[lane], block.v.0[lane]) = (u - camera.cx, v - camera.cy);
            (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = (x, y, z);
            block.weight.0[lane] = weight;
            self.weight_sum += weight;
            self.buffers.visible[n] = i as u32;
            n += 1;
        }
        for k in n..n.next_multiple_of(LANES) {
            // An empty lane repeats the first point with weight zero, so that it is never singular.
            let first = self.buffers.blocks[0];
            let (block, lane) = (&mut self.buffers.blocks[k / LANES], k % LANES);
            (block.u.0[lane], block.v.0[lane]) = (first.u.0[0], first.v.0[0]);
            (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = (first.x.0[0], first.y.0[0], first.z.0[0]);
            block.weight.0[lane] = 0.0;
        }
        self.visible_count = n;
    }

    fn visible(&self) -> &[u32] {
        &self.buffers.visible[..self.visible_count]
    }

    fn block_count(&self) -> usize {
        self.visible_count.div_ceil(LANES)
    }

    /// One point, or points on one line, in the image or on the model, have no pose.
    fn check_spread(&self) -> Result<(), NoPose> {
        let pixel = |i: u32| {
            let [u, v] = self.observation.keypoints_2d()[i as usize];
            Vector3::new(u, v, 0.0)
        };
        let point = |i: u32| Vector3::from(self.observation.model().mean()[i as usize]);
        if is_collinear(self.visible(), pixel) || is_collinear(self.visible(), point) {
            return Err(NoPose::Degenerate);
        }
        Ok(())
    }

    /// Inlier threshold in pixels: the object's own, the option's, or relative to the longer side of the box
    /// (without a box, of the extent of the middle 80 % of the keypoints).
    fn threshold(&mut self) -> f64 {
        if let Some(threshold) = self.observation.inlier_threshold().or(self.options.inlier_threshold) {
            return threshold;
        }
        let longer = self.observation.bbox().and_then(|b| b.longer_side()).unwrap_or_else(|| {
            let extent = self.keypoint_extent();
            extent[0].max(extent[1])
        });
        self.options.relative_threshold * longer
    }

    /// Width and height, pixels, of the middle 80 % of the visible keypoints, scaled up to all of them.
    fn keypoint_extent(&mut self) -> [f64; 2] {
        let n = self.visible_count;
        [0, 1].map(|axis| {
            let values = &mut self.buffers.scratch[..n];
            for (value, &i) in values.iter_mut().zip(&self.buffers.visible[..n]) {
                *value = self.observation.keypoints_2d()[i as usize][axis];
            }
            values.sort_unstable_by(f64::total_cmp);
            (values[n - 1 - n / 10] - values[n / 10]) * (n as f64 / (n - 2 * (n / 10)) as f64)
        })
    }

    /// Area in which an outlier falls, pixels squared.
    fn outlier_area(&mut self) -> f64 {
        let sides = self.observation.bbox().map(|b| (b.right - b.left) * (b.bottom - b.top));
        sides.filter(|area| !area.is_nan()).unwrap_or_else(|| {
            let [width, height] = self.keypoint_extent();
            width * height
        })
    }

    fn run(mut self, index: u64) -> Result<Estimate, NoPose> {
        let plan = Plan::of(self.options.refinement);
        let mut candidates = Candidates::new(plan.candidates, plan.worst_ratio);
        let (solver, ransac) = self.search(index, plan.min_draws, &mut candidates);
        let (best, runner_up) = self.refine_all(&candidates).ok_or(NoPose::NoHypothesis)?;
        self.finish(best, runner_up, solver, ransac)
    }

    /// The solver that the known box sides allow.
    fn choose_solver(&self) -> Solver {
        if self.options.solver != Solver::Auto {
            return self.options.solver;
        }
        let bbox = self.usable_bbox();
        match (bbox.left.is_nan(), bbox.right.is_nan(), self.view.height) {
            (false, false, _) => Solver::P1p,
            (true, true, _) | (_, _, None) => Solver::Up2p,
            _ => Solver::P1pHeight,
        }
    }

    /// The box without the sides that the image border cuts.
    fn usable_bbox(&self) -> Bbox {
        let nan = f64::NAN;
        let mut bbox = self.observation.bbox().unwrap_or(Bbox { left: nan, top: nan, right: nan, bottom: nan });
        if let Some([width, height]) = self.view.camera.image_size {
            let unless = |is_cut: bool, side: f64| if is_cut { nan } else { side };
            bbox.left = unless(bbox.left <= BORDER_PX, bbox.left);
            bbox.top = unless(bbox.top <= BORDER_PX, bbox.top);
            bbox.right = unless(bbox.right >= width - 1.0 - BORDER_PX, bbox.right);
            bbox.bottom = unless(bbox.bottom >= height - 1.0 - BORDER_PX, bbox.bottom);
        }
        bbox
    }

    fn search(&mut self, index: u64, min_draws: usize, candidates: &mut Candidates) -> (Solver, RansacStatistics) {
        let solver = self.choose_solver();
        let bbox = if self.options.solver == Solver::Auto { self.usable_bbox() } else { self.given_bbox() };
        let mut stream = Stream::new(self.options.seed, index);
        let n = self.visible_count;
        let order = &mut self.buffers.order[..n];
        for (k, o) in order.iter_mut().enumerate() {
            *o = k as u32;
        }
        stream.shuffle(order);
        let (observation, visible) = (self.observation, &self.buffers.visible[..n]);
        if observation.has_scores() {
            let score = |&k: &u32| observation.score(visible[k as usize] as usize);
            // Positions differ after the shuffle, so ties keep their random order.
            order.sort_unstable_by(|a, b| score(b).total_cmp(&score(a)));
        }
        let search = Search {
            unit: self.unit,
            camera: &self.view.camera,
            blocks: &self.buffers.blocks[..n.div_ceil(LANES)],
            visible,
            scoring: self.options.scoring,
            inlier_threshold: self.inlier_threshold,
            confidence: self.options.confidence,
            max_iterations: self.options.max_iterations,
            min_draws,
        };
        let statistics = match (solver, self.view.height) {
            (Solver::P1p, _) => {
                search.one_point(&P1p::new(self.view, observation, &bbox, self.options.cases), order, candidates)
            }
            (Solver::P1pHeight, Some(height)) => {
                search.one_point(&P1pHeight::new(self.view, observation, &bbox, height), order, candidates)
            }
            (Solver::P3p, _) => search.many_points(&P3p::new(&self.view.camera, observation), &mut stream, candidates),
            _ => search.many_points(&Up2p::new(self.view, observation), &mut stream, candidates),
        };
        (solver, statistics)
    }

    fn given_bbox(&self) -> Bbox {
        let nan = f64::NAN;
        self.observation.bbox().unwrap_or(Bbox { left: nan, top: nan, right: nan, bottom: nan })
    }

    /// Priors against a keypoint noise in pixels.
    fn priors(&self, noise_sigma: f64) -> Priors {
        // A prior of zero width is the upright pose: as narrow as keeps the equations well conditioned.
        const NARROWEST_TILT: f64 = 1e-5;
        Priors {
            tilt_sigma: self.options.effective_tilt_sigma().max(NARROWEST_TILT),
            shape: self.options.effective_shape_prior(),
            noise_sigma,
            bbox: self.bbox_from_centre(),
            use_bbox: true,
            bbox_sigma: self.options.effective_bbox_sigma(self.inlier_threshold),
        }
    }

    fn bbox_from_centre(&self) -> [f64; 4] {
        let (bbox, camera) = (self.usable_bbox(), &self.view.camera);
        [bbox.left - camera.cx, bbox.top - camera.cy, bbox.right - camera.cx, bbox.bottom - camera.cy]
    }

    fn objective(&mut self, noise_sigma: f64) -> (Objective<'_>, &mut [f64]) {
        let priors = self.priors(noise_sigma);
        let threshold = self.inlier_threshold;
        let noise = NoiseModel { guess: 0.5 * threshold, area: self.outlier_area };
        let blocks = self.block_count();
        let objective = Objective {
            unit: self.unit,
            view: self.view,
            model: self.observation.model(),
            visible: &self.buffers.visible[..self.visible_count],
            blocks: &mut self.buffers.blocks[..blocks],
            priors,
            noise,
        };
        (objective, self.buffers.scratch)
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
        let threshold = self.inlier_threshold;
        let refinement = self.options.refinement;
        let stages = schedule(refinement, threshold, self.options.hre_thresholds);
        let (mut objective, scratch) = self.objective(0.5 * threshold);
        let initial = State { pose: candidate.pose, coefficients: [0.0; MAX_MODES] };
        let (state, stages) = refine(&mut objective, scratch, &candidate.pose, &stages);
        let noise = *noise_sigma.get_or_insert_with(|| objective.estimate_noise(&state.pose, scratch).sigma);
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

    fn finish(
        mut self,
        refined: Refined,
        runner_up: f64,
        solver: Solver,
        ransac: RansacStatistics,
    ) -> Result<Estimate, NoPose> {
        let threshold = self.inlier_threshold;
        let state = State { pose: refined.state.pose.orthonormalized(), ..refined.state };
        if !state.pose.is_finite() {
            return Err(NoPose::Degenerate);
        }
        let inliers = self.measure(&state);
        let (n, weight_sum, has_scores) = (self.visible_count, self.weight_sum, self.observation.has_scores());
        let (objective, scratch) = self.objective(0.5 * threshold);
        let noise = objective.estimate_noise(&state.pose, scratch);
        let squared = scratch[..n].iter().enumerate();
        let keypoints = squared.map(|(k, &r2)| (r2, objective.weight(k)));
        // Scores say beforehand which keypoints to believe, and so which hypotheses count. Without them the share of
        // inliers is one of as many as there are keypoints, and the pose chose one more keypoint by its agreement.
        let searched = ransac.hypotheses as f64;
        let (share, tests, fitted) =
            if has_scores { (1.0, searched * weight_sum / n as f64, 1) } else { (noise.share, searched * n as f64, 2) };
        let tested = Noise { sigma: TESTED_NOISE * threshold, share };
        let log10_nfa = objective.noise.log10_false_alarms(tested, keypoints, tests, fitted);
        let noise_sigma = noise.sigma;
        if inliers.count == 0 || log10_nfa > self.options.max_log10_nfa {
            return Err(NoPose::NoConsensus);
        }
        let projection = Projection::new(&self.view.camera, &state.pose);
        let blocks = &self.buffers.blocks[..self.block_count()];
        let score = score::cost(self.unit, blocks, &projection, score::Scoring::Msac, square(threshold), f64::INFINITY);
        let (covariance, shape_covariance) = if self.options.covariance {
            let (pose, shape) = self.covariance(&state, noise_sigma).ok_or(NoPose::Degenerate)?;
            (Some(pose), Some(shape))
        } else {
            (None, None)
        };
        Ok(Estimate {
            pose: state.pose,
            yaw: state.pose.yaw(self.view),
            shape_coefficients: state.coefficients,
            inlier_threshold: threshold,
            inlier_count: inliers.count,
            reprojection_rmse: sqrt(inliers.squares / inliers.count as f64),
            score: score / self.weight_sum,
            log10_nfa,
            noise_sigma,
            covariance,
            shape_covariance,
            ambiguity: libm::exp(-(runner_up - refined.cost).max(0.0) / square(noise_sigma.max(0.25 * threshold))),
            ransac,
            solver,
            stages: refined.stages,
        })
    }

    /// Residuals of the pose that is returned, into the workspace, and the sums over its inliers.
    fn measure(&mut self, state: &State) -> Inliers {
        let threshold = self.inlier_threshold;
        let (mut objective, scratch) = self.objective(0.5 * threshold);
        if !objective.model.eigenvalues().is_empty() {
            objective.set_shape(&state.coefficients);
        }
        let n = objective.visible.len();
        objective.squared_residuals(&state.pose, &mut scratch[..n]);
        let mut inliers = Inliers::default();
        for k in 0..n {
            let r2 = self.buffers.scratch[k];
            let r = sqrt(r2);
            self.buffers.residuals[self.buffers.visible[k] as usize] = r;
            if r <= threshold {
                inliers.count += 1;
                inliers.squares += r2;
            }
        }
        inliers
    }

    /// Inverse of the normal equations over the inliers, priors included, times the noise variance.
    fn covariance(&mut self, state: &State, noise_sigma: f64) -> Option<(PoseCovariance, ShapeCovariance)> {
        let threshold = self.inlier_threshold;
        let (mut objective, _) = self.objective(noise_sigma);
        objective.activate_within(&state.pose, threshold);
        match padded_modes(objective.model.eigenvalues().len()) {
            0 => inverse_normal::<6>(&objective, state, noise_sigma),
            5 => inverse_normal::<11>(&objective, state, noise_sigma),
            _ => inverse_normal::<{ 6 + MAX_MODES }>(&objective, state, noise_sigma),
        }
    }
}

/// Residuals beyond so many standard deviations of the noise count the same when refined poses are compared.
const JUDGING_CUT: f64 = 3.0;
/// Poses whose forward axes differ by more than 30 degrees (cosine) face another way.
const OTHER_WAY: f64 = 0.866;

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

/// Sums over the inliers of a pose.
#[derive(Default)]
struct Inliers {
    count: usize,
    squares: f64,
}

/// Truncated squared error of a state, priors included (pixels squared, halved); sets the blocks to its shape.
fn truncated_cost(objective: &mut Objective, state: &State, threshold: f64) -> f64 {
    if !objective.model.eigenvalues().is_empty() {
        objective.set_shape(&state.coefficients);
    }
    let projection = Projection::new(&objective.view.camera, &state.pose);
    let tau2 = square(threshold);
    let cost = score::cost(objective.unit, objective.blocks, &projection, score::Scoring::Msac, tau2, f64::INFINITY);
    0.5 * tau2 * cost + objective.prior_cost(state)
}

fn inverse_normal<const D: usize>(
    objective: &Objective,
    state: &State,
    noise_sigma: f64,
) -> Option<(PoseCovariance, ShapeCovariance)> {
    let mut h = objective.linearise::<D>(state, Kernel::LeastSquares).h;
    cholesky(&mut h)?;
    let (mut pose, mut shape) = (PoseCovariance::zeros(), ShapeCovariance::zeros());
    let modes = objective.model.eigenvalues().len();
    for column in 0..6 + modes {
        let mut x = [0.0; D];
        x[column] = square(noise_sigma);
        solve_cholesky(&h, &mut x);
        if column < 6 {
            pose.column_mut(column).copy_from_slice(&x[..6]);
        } else {
            for m in 0..modes {
                shape[(m, column - 6)] = x[6 + m];
            }
        }
    }
    Some((pose, shape))
}

/// Whether points are one point or lie on one line.
fn is_collinear(indices: &[u32], position: impl Fn(u32) -> Vector3<f64>) -> bool {
    let first = position(indices[0]);
    let (mut axis, mut extent2) = (Vector3::zeros(), 0.0);
    for &i in indices {
        let d = position(i) - first;
        if d.norm_squared() > extent2 {
            (axis, extent2) = (d, d.norm_squared());
        }
    }
    let limit = square(COLLINEAR * extent2);
    extent2 <= square(SMALLEST_EXTENT)
        || indices.iter().all(|&i| (position(i) - first).cross(&axis).norm_squared() <= limit)
}
