//! One object: checks, search, refinement, and the statistics of the pose that is returned.

use crate::error::{InputError, NoPose};
use crate::estimate::job::{Found, Job};
use crate::estimate::options::{Options, Solver};
use crate::estimate::points::Points;
use crate::estimate::workspace::{Buffers, Workspace};
use crate::geometry::math::{exp, sqrt, square};
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::model::observation::Observation;
use crate::model::shape_model::MAX_MODES;
use crate::refine::covariance::{PoseCovariance, ShapeCovariance, covariance};
use crate::refine::schedule::{MAX_STAGES, StageStatistics};
use crate::search::ransac::RansacStatistics;
use crate::search::score::{Scoring, cost};
use crate::simd::dispatch::VectorUnit;
use crate::simd::lanes::LANES;
use crate::simd::projection::Projection;

/// The pose and shape of one object. Everything about residuals belongs to the pose returned.
///
/// ```
/// use groundpose::{Camera, Estimator, FixedWorkspace, Observation, Options, Pose, ShapeModel, Solver, Tilt, View};
///
/// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?;
/// let points = [
///     [-0.8, -0.3, 1.3], [0.8, -0.3, 1.3], [0.8, -0.3, -1.3], [-0.8, -0.3, -1.3],
///     [-0.5, -1.4, 0.3], [0.5, -1.4, 0.3], [0.5, -1.4, -1.3], [-0.5, -1.4, -1.3],
/// ];
/// let model = ShapeModel::rigid(&points, [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])?;
/// let truth = Pose::upright(&view, 0.7, [2.0, 1.5, 15.0].into());
/// let pixels = points.map(|x| view.camera.project(&truth.transform(x)).unwrap().map(f64::round));
/// let observation = Observation::new(&pixels, &model)?;
///
/// let estimator = Estimator::new(Options { inlier_threshold: Some(4.0), ..Options::default() })?;
/// let mut workspace = FixedWorkspace::<8>::new();
/// // As object 5 of a batch: its draws are its own.
/// let estimate = estimator.estimate_indexed(&view, &observation, &mut workspace, 5).expect("a pose");
/// assert_eq!((estimate.solver, estimate.inlier_count), (Solver::Up2p, 8));
/// assert!(estimate.reprojection_rmse < 1.0 && estimate.score < 0.05 && estimate.log10_nfa < -3.0);
/// // The depth and its standard deviation, metres.
/// let sigma = estimate.covariance.expect("asked for by default")[(5, 5)].sqrt();
/// assert!((estimate.pose.t.z - truth.t.z).abs() < 4.0 * sigma && sigma < 0.5);
/// # Ok::<(), groundpose::InputError>(())
/// ```
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
    /// The search that made the hypothesis.
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
/// use groundpose::{
///     Camera, Estimator, FixedWorkspace, NoPose, Observation, Options, Pose, ShapeModel, Tilt, View, Workspace,
/// };
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
/// # Ok::<(), groundpose::InputError>(())
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
    ///
    /// ```
    /// use groundpose::{Estimator, Options};
    ///
    /// let estimator = Estimator::new(Options { seed: 7, ..Options::default() })?;
    /// assert_eq!(estimator.options().seed, 7);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
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
        if view.camera.lens.is_none() {
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
        let mut job = Job { unit: VectorUnit::detect(), options: &self.options, view, observation, points };
        let found = job.run(index)?;
        describe(job, found)
    }
}

/// Everything that is said of the pose returned, from that pose.
fn describe(mut job: Job, found: Found) -> Result<Estimate, NoPose> {
    let (threshold, weight_sum) = (job.points.inlier_threshold, job.points.weight_sum);
    let (state, noise) = (found.state, found.noise);
    if !state.pose.is_rigid() {
        return Err(NoPose::Degenerate);
    }
    let inliers = store_residuals(&mut job.points);
    if inliers.count == 0 || !(found.log10_nfa <= job.options.max_log10_nfa) {
        return Err(NoPose::NoConsensus);
    }
    let projection = Projection::new(&job.view.camera, &state.pose);
    let score = cost(job.unit, job.points.blocks(), &projection, Scoring::Msac, square(threshold), f64::INFINITY);
    let covariances = if job.options.covariance {
        let (mut objective, _) = job.objective(noise.sigma);
        Some(covariance(&mut objective, &state, threshold).ok_or(NoPose::Degenerate)?)
    } else {
        None
    };
    let estimate = Estimate {
        pose: state.pose,
        yaw: state.pose.yaw(job.view),
        shape_coefficients: state.coefficients,
        inlier_threshold: threshold,
        inlier_count: inliers.count,
        reprojection_rmse: sqrt(inliers.squares / inliers.count as f64),
        score: score / weight_sum,
        log10_nfa: found.log10_nfa,
        noise_sigma: noise.sigma,
        covariance: covariances.map(|c| c.0),
        shape_covariance: covariances.map(|c| c.1),
        ambiguity: ambiguity(found.cost, found.runner_up, noise.sigma.max(0.25 * threshold)),
        ransac: found.ransac,
        solver: found.solver,
        stages: found.stages,
    };
    // Numbers so large or small that their squares are not numbers.
    if estimate.is_finite() { Ok(estimate) } else { Err(NoPose::Degenerate) }
}

/// Sums over the inliers of a pose.
#[derive(Default)]
struct Inliers {
    count: usize,
    squares: f64,
}

/// Residuals from the squares in the blocks into the caller's workspace; the sums over the inliers.
fn store_residuals(points: &mut Points) -> Inliers {
    let (threshold, count) = (points.inlier_threshold, points.count);
    let buffers = &mut points.buffers;
    let mut inliers = Inliers::default();
    for (k, &i) in buffers.visible[..count].iter().enumerate() {
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

/// Likelihood of the runner-up relative to the best, from their costs (pixels squared, halved).
fn ambiguity(best: f64, runner_up: f64, noise_sigma: f64) -> f64 {
    exp(-(runner_up - best).max(0.0) / square(noise_sigma))
}
