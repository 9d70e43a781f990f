//! Last step: everything that is said of the pose returned, from that pose.

use crate::error::NoPose;
use crate::estimate::alternative::{Alternative, Doubt};
use crate::estimate::object::{Memory, Object};
use crate::estimate::options::Solver;
use crate::estimate::probability::{Evidence, Facts, probability};
use crate::estimate::refine::objective;
use crate::estimate::verify::Verified;
use crate::geometry::math::{sqrt, square};
use crate::geometry::pose::Pose;
use crate::model::shape_model::MAX_MODES;
use crate::refine::covariance::{Covariances, PoseCovariance, ShapeCovariance, ShapePoseCovariance, covariance};
use crate::refine::normal::State;
use crate::refine::schedule::{MAX_STAGES, StageStatistics};
use crate::search::ransac::RansacStatistics;
use crate::search::score::truncated;
use crate::simd::projection::Measured;

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
/// let estimate = estimator.estimate(&view, &observation, &mut workspace).expect("a pose");
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
    /// Covariance of the shape coefficients with the pose, if asked for.
    pub shape_pose_covariance: Option<ShapePoseCovariance>,
    /// With viewing angles of a network: probability that the object faces the other half of them. Else relative
    /// likelihood, 0 to 1, of the best pose that faces another way: near 1, it could be either.
    pub ambiguity: f64,
    /// Probability that this answer is right: yaw within 15 degrees, distance within 15 %.
    pub probability: f64,
    /// What speaks for it and against it.
    pub evidence: Evidence,
    /// The best pose that faces another way, where it is not too improbable.
    pub alternative: Option<Alternative>,
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
        residuals.iter().chain(&self.shape_coefficients).chain(&self.evidence).all(|x| x.is_finite())
    }
}

/// Describes a pose that stands against chance; the residuals go to the caller's workspace. A call of its own: the
/// covariances are no part of the stack under the search and the refinement.
///
/// # Errors
/// It does not, it has no numbers, or it is too improbable.
#[inline(never)]
pub(crate) fn describe(object: &Object, verified: &Verified, memory: &mut Memory) -> Result<Estimate, NoPose> {
    let Verified { refined, solver, ransac, noise, log10_nfa, .. } = verified;
    let (state, threshold) = (&refined.state, object.inlier_threshold);
    if !state.pose.is_rigid() {
        return Err(NoPose::Degenerate);
    }
    let visible = memory.keypoints.visible;
    let points = memory.keypoints.measure(state);
    let inliers = store_residuals(points, visible, threshold, memory.residuals);
    if inliers.count == 0 || !(*log10_nfa <= object.options.max_log10_nfa) {
        return Err(NoPose::NoConsensus);
    }
    let score = truncated(object.unit, points, square(threshold));
    let certain = certainty(object, verified, memory)?;
    let estimate = Estimate {
        pose: state.pose,
        yaw: state.pose.yaw(object.view),
        shape_coefficients: state.coefficients,
        inlier_threshold: threshold,
        inlier_count: inliers.count,
        reprojection_rmse: sqrt(inliers.squares / inliers.count as f64),
        score: score / object.weight_sum,
        log10_nfa: *log10_nfa,
        noise_sigma: noise.sigma,
        covariance: certain.covariances.map(|c| c.0),
        shape_covariance: certain.covariances.map(|c| c.1),
        shape_pose_covariance: certain.covariances.map(|c| c.2),
        ambiguity: certain.ambiguity,
        probability: certain.probability,
        evidence: certain.evidence,
        alternative: certain.alternative,
        ransac: *ransac,
        solver: *solver,
        stages: refined.stages,
    };
    // Numbers so large or small that their squares are not numbers.
    if estimate.is_finite() { Ok(estimate) } else { Err(NoPose::Degenerate) }
}

/// Sums over the inliers of a pose.
#[derive(Default)]
pub(crate) struct Inliers {
    count: usize,
    squares: f64,
}

/// Residuals into the caller's workspace; the sums over the inliers.
pub(crate) fn store_residuals(points: Measured, visible: &[u32], threshold: f64, residuals: &mut [f64]) -> Inliers {
    let mut inliers = Inliers::default();
    for (k, &i) in visible.iter().enumerate() {
        let r2 = points.squared(k);
        let r = sqrt(r2);
        residuals[i as usize] = r;
        if r <= threshold {
            inliers.count += 1;
            inliers.squares += r2;
        }
    }
    inliers
}

/// How sure a pose is.
struct Certainty {
    ambiguity: f64,
    evidence: Evidence,
    probability: f64,
    covariances: Option<Covariances>,
    alternative: Option<Alternative>,
}

/// # Errors
/// The pose is too improbable, or has no covariance although one is asked for.
#[inline(always)]
fn certainty(object: &Object, verified: &Verified, memory: &mut Memory) -> Result<Certainty, NoPose> {
    let (state, options) = (&verified.refined.state, object.options);
    let doubt = Doubt::of(object, verified);
    let visible = memory.keypoints.visible;
    let evidence = facts(object, verified, visible, doubt.ambiguity).evidence();
    let coefficients = options.effective_probability_coefficients(object.observation.has_scores());
    let probability = probability(&coefficients, &evidence);
    let least = options.effective_min_probability();
    if least > 0.0 && (verified.looks.too_small || !(probability >= least)) {
        return Err(NoPose::Improbable);
    }
    let mut objective = objective(object, memory.keypoints.lend(), verified.noise.sigma);
    let errors = options.shared_errors(object.size());
    let mut uncertainty = |state: &State| covariance(&mut objective, state, object.inlier_threshold, &errors);
    let covariances = if options.covariance { Some(uncertainty(state).ok_or(NoPose::Degenerate)?) } else { None };
    let own = covariances.as_ref().map(|c| &c.0);
    let ambiguity = doubt.ambiguity;
    let alternative = doubt.alternative(object, state, probability, own, &mut uncertainty);
    Ok(Certainty { ambiguity, evidence, probability, covariances, alternative })
}

/// What the evidence for a pose is made of.
fn facts<'a>(object: &'a Object, verified: &Verified, visible: &'a [u32], ambiguity: f64) -> Facts<'a> {
    Facts {
        observation: object.observation,
        visible,
        misfit: verified.looks.misfit,
        longer_side: object.size(),
        noise_sigma: verified.noise.sigma,
        inlier_fraction: verified.noise.inlier_fraction,
        log10_nfa: verified.log10_nfa,
        ambiguity,
    }
}
