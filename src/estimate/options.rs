//! Options: every default in one place, checked once.

use crate::error::{Got, InputError, require};
use crate::estimate::probability::ProbabilityCoefficients;
use crate::minimal::p1p::Cases;
use crate::refine::covariance::SharedErrors;
use crate::refine::region::region_radius2;
use crate::refine::schedule::Refinement;
use crate::search::score::Scoring;
use crate::tuning::{
    HRE_THRESHOLDS, MAX_LOG10_NFA, MIN_PROBABILITY, OBJECT_TILT_SIGMA, PROBABILITY_WITH_SCORES,
    PROBABILITY_WITHOUT_SCORES, RELATIVE_BBOX_SIGMA, RELATIVE_THRESHOLD,
};

/// Which minimal solver makes the hypotheses.
///
/// ```
/// use groundpose::Solver;
///
/// assert_eq!(Solver::NAMES[Solver::P1pHeight as usize], "p1p_height");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Solver {
    /// P1P where both sides of the box are known; else P1P with the camera's height, else UP2P. In the default
    /// refinement UP2P has a second try where chance explains the answer nearly as well, and P3P a last one, without the
    /// ground, where neither the keypoints nor the box convince and the tilt prior is not given: the better one is kept.
    Auto = 0,
    /// RNSC-P1P: one keypoint, two box sides, tilt.
    P1p = 1,
    /// RNSC-P3P: three keypoints.
    P3p = 2,
    /// RNSC-UP2P: two keypoints, tilt.
    Up2p = 3,
    /// One keypoint, one box side, tilt, camera height.
    P1pHeight = 4,
}

impl Solver {
    /// Names in order; the first stands for [`Solver::Auto`] among options and for "no solver ran" in results.
    pub const NAMES: [&'static str; 5] = ["none", "p1p", "p3p", "up2p", "p1p_height"];

    /// Keypoints that make a hypothesis.
    pub(crate) fn sample_size(self) -> usize {
        match self {
            Solver::Auto | Solver::P1p | Solver::P1pHeight => 1,
            Solver::Up2p => 2,
            Solver::P3p => 3,
        }
    }
}

/// How poses are estimated. `Options::default()` is the place of every default.
///
/// ```
/// use groundpose::{EVIDENCE, Options, Refinement, Solver};
///
/// // The paper's method with its thresholds in pixels.
/// let paper = Options {
///     solver: Solver::P1p,
///     refinement: Refinement::Hre,
///     inlier_threshold: Some(4.0),
///     ..Options::default()
/// };
/// assert!(paper.check().is_ok());
/// assert_eq!(paper.effective_tilt_sigma(), f64::INFINITY);
/// assert!(!paper.effective_shape_prior() && paper.effective_bbox_sigma(4.0).is_infinite());
///
/// // Ours, unless said otherwise: upright within 1.5 degrees, box sides within two thresholds, shapes of the class.
/// let ours = Options::default().with_seed(1);
/// assert_eq!(ours.effective_tilt_sigma(), Options::OBJECT_TILT_SIGMA);
/// assert_eq!((ours.effective_bbox_sigma(4.0), ours.effective_shape_prior()), (8.0, true));
/// // Keypoints of the caller err independently; those of a network do not, and have heavy tails.
/// let (factor, coefficients) = (ours.effective_keypoint_error_factor(), ours.effective_probability_coefficients(false));
/// assert_eq!((factor, coefficients.len()), (1.0, 1 + EVIDENCE));
/// let network = Options { keypoint_error_factor: Some(15.0), keypoint_error_dof: Some(5.6), min_probability: Some(0.5), ..ours };
/// assert_eq!((network.effective_keypoint_error_factor(), network.effective_min_probability()), (15.0, 0.5));
/// assert!(network.region_radius2(0.95, 6)? > ours.region_radius2(0.95, 6)?);
/// // For the tilt of a frame the poses must be free.
/// assert_eq!(ours.without_tilt().effective_tilt_sigma(), f64::INFINITY);
///
/// let error = Options { confidence: 99.0, ..paper }.check().unwrap_err();
/// assert_eq!(error.to_string(), "confidence: expected a probability between 0 and 1, got 99");
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Reprojection error in pixels up to which a keypoint is an inlier; `None`: from `relative_threshold`.
    pub inlier_threshold: Option<f64>,
    /// Inlier threshold as a fraction of the longer box side (paper, sec. 4.2.4).
    pub relative_threshold: f64,
    /// Wanted probability that some sample holds only inliers; the default refinement draws eight keypoints in any case.
    pub confidence: f64,
    /// Minimal solver.
    pub solver: Solver,
    /// Cases of P1P.
    pub cases: Cases,
    /// Score of a hypothesis.
    pub scoring: Scoring,
    /// Refinement of the best hypotheses.
    pub refinement: Refinement,
    /// `tau_1, tau_2, tau_3` of Algorithm 1 as multiples of the inlier threshold (paper, sec. 4.1.5: 4, 6, 12 px
    /// at a threshold of 4 px).
    pub hre_thresholds: [f64; 3],
    /// Standard deviation, radians, of an object's up axis about the ground's normal: infinite gives the paper's
    /// six degrees of freedom, small values an upright object. `None`: 1.5 degrees in the default refinement and
    /// infinite in the paper's.
    pub tilt_sigma: Option<f64>,
    /// Gaussian prior on shape coefficients. `None`: in the default refinement, not in the paper's.
    pub shape_prior: Option<bool>,
    /// Standard deviation, pixels, of the sides of the 2D box against the projected 3D box; infinite: the box only
    /// makes hypotheses. `None`: 2 times the inlier threshold in the default refinement and infinite in the paper's.
    pub bbox_sigma: Option<f64>,
    /// Whether to compute the covariance. A pose whose inliers leave a direction of it or of its shape free has none and
    /// is then refused as degenerate: without priors, a pose and M modes take at least (6 + M) / 2 inliers.
    pub covariance: bool,
    /// Most samples drawn.
    pub max_iterations: usize,
    /// Fewest visible keypoints of an answer.
    pub min_keypoints: usize,
    /// An answer must be better than chance: the largest log10 of the number of poses as good as it to expect among
    /// random keypoints. Infinite: never refuse. See [`crate::estimate::describe::Estimate::log10_nfa`].
    pub max_log10_nfa: f64,
    /// How much larger the variance of the keypoints' common error is than their residuals show ([`crate::refine::covariance`]):
    /// 1 for independent errors, 7 to 20 for those of a network. `None`: 1.
    pub keypoint_error_factor: Option<f64>,
    /// Degrees of freedom of Student's t of the errors of a pose: few are heavy tails, see [`Options::region_radius2`].
    /// `None`: infinite, Gaussian errors.
    pub keypoint_error_dof: Option<f64>,
    /// Standard deviation of a shift that all keypoints of an object share, in each direction of the image, as a fraction
    /// of the longer side of the 2D box. `None`: 0.
    pub keypoint_error_shift: Option<f64>,
    /// Standard deviation, radians, of a turn about the ground's normal that all keypoints of an object share. `None`: 0.
    pub keypoint_error_turn: Option<f64>,
    /// Coefficients of the probability that an answer is right: a bias, and one for each number of
    /// [`crate::estimate::probability::Evidence`]. `None`: those for keypoints of the caller, with scores or without.
    pub probability_coefficients: Option<ProbabilityCoefficients>,
    /// Bias and slope that make the logit of a true ambiguity from that of the viewing-angle probabilities of a network.
    /// `None`: 0 and 1, as the network says.
    pub ambiguity_coefficients: Option<[f64; 2]>,
    /// Least probability of an answer; 0: never refuse, not even a pose that looks far smaller than its box. `None`: 0.15,
    /// for keypoints of the caller, in the default refinement, and 0 in the paper's.
    pub min_probability: Option<f64>,
    /// Whether keypoint scores weigh the residuals (they always order the draws).
    pub score_weights: bool,
    /// Seed of the draws.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            inlier_threshold: None,
            relative_threshold: RELATIVE_THRESHOLD,
            confidence: 0.99,
            solver: Solver::Auto,
            cases: Cases::All,
            scoring: Scoring::Msac,
            refinement: Refinement::Default,
            hre_thresholds: HRE_THRESHOLDS,
            tilt_sigma: None,
            shape_prior: None,
            bbox_sigma: None,
            covariance: true,
            max_iterations: 10_000,
            min_keypoints: 4,
            max_log10_nfa: MAX_LOG10_NFA,
            keypoint_error_factor: None,
            keypoint_error_dof: None,
            keypoint_error_shift: None,
            keypoint_error_turn: None,
            probability_coefficients: None,
            ambiguity_coefficients: None,
            min_probability: None,
            score_weights: true,
            seed: 0,
        }
    }
}

impl Options {
    /// Standard deviation, radians, of an object's up axis about the ground's normal: 1.5 degrees.
    pub const OBJECT_TILT_SIGMA: f64 = OBJECT_TILT_SIGMA;

    /// The same options for poses that the nominal tilt does not pull, with covariances: what `frame_tilt::UpAxis` needs.
    #[must_use]
    pub fn without_tilt(mut self) -> Self {
        self.tilt_sigma = Some(f64::INFINITY);
        self.covariance = true;
        self
    }

    /// The same options with another seed.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Standard deviation of the tilt prior that applies.
    #[must_use]
    pub fn effective_tilt_sigma(&self) -> f64 {
        self.tilt_sigma.unwrap_or(match self.refinement {
            Refinement::Default => Self::OBJECT_TILT_SIGMA,
            _ => f64::INFINITY,
        })
    }

    /// Standard deviation, pixels, of the box sides that applies at an inlier threshold.
    #[must_use]
    pub fn effective_bbox_sigma(&self, inlier_threshold: f64) -> f64 {
        self.bbox_sigma.unwrap_or(match self.refinement {
            Refinement::Default => RELATIVE_BBOX_SIGMA * inlier_threshold,
            _ => f64::INFINITY,
        })
    }

    /// Whether the shape prior applies.
    #[must_use]
    pub fn effective_shape_prior(&self) -> bool {
        self.shape_prior.unwrap_or(self.refinement == Refinement::Default)
    }

    /// The factor that applies.
    #[must_use]
    pub fn effective_keypoint_error_factor(&self) -> f64 {
        self.keypoint_error_factor.unwrap_or(1.0)
    }

    /// How the keypoints' errors widen the covariance of an object whose box has this longer side, pixels.
    pub(crate) fn shared_errors(&self, longer_side: f64) -> SharedErrors {
        SharedErrors {
            factor: self.effective_keypoint_error_factor(),
            shift: self.keypoint_error_shift.unwrap_or(0.0) * longer_side,
            turn: self.keypoint_error_turn.unwrap_or(0.0),
        }
    }

    /// Squared Mahalanobis distance, against the covariance of a pose or of so many `dimensions` of it, within which the
    /// truth lies with the probability `level`: [`crate::refine::region::region_radius2`] with these options' tails.
    ///
    /// # Errors
    /// Those of that function.
    pub fn region_radius2(&self, level: f64, dimensions: usize) -> Result<f64, InputError> {
        region_radius2(level, dimensions, self.keypoint_error_dof.unwrap_or(f64::INFINITY))
    }

    /// The coefficients that apply to keypoints with or without scores.
    #[must_use]
    pub fn effective_probability_coefficients(&self, has_scores: bool) -> ProbabilityCoefficients {
        let callers = if has_scores { PROBABILITY_WITH_SCORES } else { PROBABILITY_WITHOUT_SCORES };
        self.probability_coefficients.unwrap_or(callers)
    }

    /// The least probability that applies.
    #[must_use]
    pub fn effective_min_probability(&self) -> f64 {
        self.min_probability.unwrap_or(match self.refinement {
            Refinement::Default => MIN_PROBABILITY,
            _ => 0.0,
        })
    }

    /// # Errors
    /// Any value outside its range.
    pub fn check(&self) -> Result<(), InputError> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if let Some(threshold) = self.inlier_threshold {
            let expected = "a positive number of pixels, or none";
            require(positive(threshold), "inlier_threshold", expected, Got::Number(threshold))?;
        }
        let r = self.relative_threshold;
        require(positive(r), "relative_threshold", "a positive fraction of the longer box side", Got::Number(r))?;
        let c = self.confidence;
        require(c > 0.0 && c < 1.0, "confidence", "a probability between 0 and 1", Got::Number(c))?;
        let [t1, t2, t3] = self.hre_thresholds;
        let ordered = positive(t1) && t1 < t2 && t2 < t3 && t3.is_finite();
        let expected = "three increasing positive multiples of the inlier threshold";
        require(ordered, "hre_thresholds", expected, Got::Pair(t1, t3))?;
        if let Some(sigma) = self.tilt_sigma {
            let expected = "radians >= 0 (infinite: no prior), or none";
            require(sigma >= 0.0, "tilt_sigma", expected, Got::Number(sigma))?;
        }
        if let Some(sigma) = self.bbox_sigma {
            require(sigma > 0.0, "bbox_sigma", "pixels > 0 (infinite: not used), or none", Got::Number(sigma))?;
        }
        require(self.max_iterations > 0, "max_iterations", "at least 1", Got::Count(0))?;
        let n = self.max_log10_nfa;
        require(!n.is_nan(), "max_log10_nfa", "a number, or infinity to never refuse", Got::Number(n))?;
        if let Some(factor) = self.keypoint_error_factor {
            let expected = "a number of at least 1, or none";
            require(factor.is_finite() && factor >= 1.0, "keypoint_error_factor", expected, Got::Number(factor))?;
        }
        if let Some(dof) = self.keypoint_error_dof {
            let expected = "a number above 2 (infinite: Gaussian errors), or none";
            require(dof > 2.0, "keypoint_error_dof", expected, Got::Number(dof))?;
        }
        for (name, sigma) in
            [("keypoint_error_shift", self.keypoint_error_shift), ("keypoint_error_turn", self.keypoint_error_turn)]
        {
            let sigma = sigma.unwrap_or(0.0);
            let expected = "a standard deviation of 0 or more, or none";
            require(sigma.is_finite() && sigma >= 0.0, name, expected, Got::Number(sigma))?;
        }
        for c in self.ambiguity_coefficients.into_iter().flatten() {
            require(c.is_finite(), "ambiguity_coefficients", "two finite numbers, or none", Got::Number(c))?;
        }
        for c in self.probability_coefficients.into_iter().flatten() {
            require(c.is_finite(), "probability_coefficients", "seven finite numbers, or none", Got::Number(c))?;
        }
        if let Some(p) = self.min_probability {
            let expected = "a probability, 0 (never refuse) to 1, or none";
            require((0.0..=1.0).contains(&p), "min_probability", expected, Got::Number(p))?;
        }
        let m = self.min_keypoints;
        require(m >= 3, "min_keypoints", "at least 3: fewer do not determine a pose", Got::Count(m))?;
        Ok(())
    }
}
