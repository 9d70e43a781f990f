//! The probability that an answer is right: its yaw within 15 degrees, its distance within 15 %.
//!
//! A logistic model on what speaks for and against it, $`1 / (1 + \exp(-c_0 - \sum_k c_k e_k))`$ with the evidence
//! $`e`$ of [`Evidence`]. Its coefficients are fitted on answers whose truth is known: those in
//! `src/tuning.rs` for keypoints of the caller, a network's own for those of a network.

use crate::geometry::math::{exp, log};
use crate::model::observation::Observation;
use crate::tuning::{
    AMBIGUITY_LIMITS, FALSE_ALARM_LIMITS, LEAST_MISFIT, SCORE_LIMITS, TYPICAL_MISFIT, TYPICAL_NOISE,
    VEHICLE_LOGIT_LIMIT,
};

/// How many numbers [`Evidence`] has.
///
/// ```
/// assert_eq!(groundpose::EVIDENCE, 6);
/// ```
pub const EVIDENCE: usize = 6;

/// What speaks for an answer and against it: score level, misfit of the box, noise, false alarms, vehicle, ambiguity.
///
/// | number | what it is | unknown |
/// |---|---|---|
/// | score level | logit of the mean score of the visible keypoints | without scores: of the fraction of inliers |
/// | misfit | log of the rms of the box sides, projected minus given, against 2 % of the longer side | 0 |
/// | noise | log of the keypoints' noise against 1 % of the longer side | |
/// | false alarms | a tenth of their log10 | |
/// | vehicle | logit of the probability that there is a vehicle at all | 0 |
/// | ambiguity | its logit | |
///
/// ```
/// use groundpose::{EVIDENCE, Evidence};
///
/// let evidence: Evidence = [1.5, 0.2, -0.3, -1.2, 4.0, -6.9];
/// assert_eq!(evidence.len(), EVIDENCE);
/// ```
pub type Evidence = [f64; EVIDENCE];

/// Coefficients of the model: a bias, and one for each number of [`Evidence`].
///
/// ```
/// use groundpose::{EVIDENCE, Options, ProbabilityCoefficients};
///
/// // Every answer is as likely right as wrong.
/// let ignorant: ProbabilityCoefficients = [0.0; 1 + EVIDENCE];
/// assert!(Options { probability_coefficients: Some(ignorant), ..Options::default() }.check().is_ok());
/// ```
pub type ProbabilityCoefficients = [f64; 7];

/// What the evidence is made of.
pub(crate) struct Facts<'a> {
    pub(crate) observation: &'a Observation<'a>,
    pub(crate) visible: &'a [u32],
    /// Of the 2D box, as a fraction of its longer side.
    pub(crate) misfit: Option<f64>,
    /// Pixels: the longer side of the 2D box, or what stands for it.
    pub(crate) longer_side: f64,
    /// Estimated standard deviation of a keypoint's coordinate, pixels, and fraction of inliers.
    pub(crate) noise_sigma: f64,
    pub(crate) inlier_fraction: f64,
    pub(crate) log10_nfa: f64,
    pub(crate) ambiguity: f64,
}

impl Facts<'_> {
    pub(crate) fn evidence(&self) -> Evidence {
        let [least, most] = FALSE_ALARM_LIMITS;
        [
            logit(self.score_level(), SCORE_LIMITS),
            self.misfit.map_or(0.0, |misfit| log(misfit.max(LEAST_MISFIT) / TYPICAL_MISFIT)),
            log(self.noise_sigma / self.longer_side / TYPICAL_NOISE),
            self.log10_nfa.clamp(least, most) / 10.0,
            self.observation.vehicle_probability().map_or(0.0, |p| {
                logit(p, [f64::MIN_POSITIVE, 1.0 - f64::EPSILON]).clamp(-VEHICLE_LOGIT_LIMIT, VEHICLE_LOGIT_LIMIT)
            }),
            logit(self.ambiguity, AMBIGUITY_LIMITS),
        ]
    }

    /// Mean score of the visible keypoints, on the scale on which they were given.
    fn score_level(&self) -> f64 {
        if !self.observation.has_scores() {
            return self.inlier_fraction;
        }
        let sum: f64 = self.visible.iter().map(|&i| self.observation.score(i as usize)).sum();
        sum / self.visible.len() as f64
    }
}

/// `1 / (1 + exp(-c . (1, evidence)))`.
pub(crate) fn probability(coefficients: &ProbabilityCoefficients, evidence: &Evidence) -> f64 {
    let [bias, each @ ..] = coefficients;
    let logit = bias + each.iter().zip(evidence).map(|(c, e)| c * e).sum::<f64>();
    1.0 / (1.0 + exp(-logit))
}

/// `ln(p / (1 - p))` of a probability kept within limits.
pub(crate) fn logit(p: f64, [least, most]: [f64; 2]) -> f64 {
    let p = p.clamp(least, most);
    log(p / (1.0 - p))
}
