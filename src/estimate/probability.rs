//! The probability that an answer is right: its yaw within 15 degrees, its distance within 15 %.
//!
//! A logistic model on what speaks for and against it, $`1 / (1 + \exp(-c_0 - \sum_k c_k e_k))`$ with the evidence
//! $`e`$ of [`Evidence`]. Its coefficients are fitted on answers whose truth is known: [`CALLERS_PROBABILITY`] for
//! keypoints of the caller, a network's own for those of a network.

use crate::geometry::bbox::Bbox;
use crate::geometry::math::{exp, log, sqrt, square};
use crate::model::observation::Observation;
use crate::refine::box_sides::Sides;
use crate::simd::lanes::LANES;
use crate::tuning::{
    AMBIGUITY_LIMITS, FALSE_ALARM_LIMITS, LEAST_MISFIT, SCORE_LIMITS, SMALLEST_LOOK, TYPICAL_MISFIT, TYPICAL_NOISE,
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
    /// Sides of the projected 3D box against the usable ones of the 2D box, if there are any.
    pub(crate) sides: Option<Sides>,
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
            self.misfit().map_or(0.0, |misfit| log(misfit.max(LEAST_MISFIT) / TYPICAL_MISFIT)),
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

    /// Root mean square over the known sides, as a fraction of the longer side.
    fn misfit(&self) -> Option<f64> {
        let sides = self.sides.as_ref()?;
        let (residuals, known) = (sides.residuals(), sides.block.weight.0);
        let count: f64 = known.iter().sum();
        let squares: f64 = (0..LANES).map(|side| known[side] * square(residuals[side])).sum();
        (count > 0.0).then(|| sqrt(squares / count) / self.longer_side)
    }

    /// Whether the projected 3D box looks far smaller than the given 2D box, along all directions that are known.
    pub(crate) fn looks_too_small(&self, usable: &Bbox) -> bool {
        let Some(sides) = &self.sides else { return false };
        let [left, top, right, bottom] = sides.residuals();
        let looks = [(usable.right - usable.left, right - left), (usable.bottom - usable.top, bottom - top)];
        // NaN: a side is unknown
        let known = || looks.iter().filter(|(given, _)| !given.is_nan());
        known().next().is_some() && known().all(|(given, longer_by)| given + longer_by < SMALLEST_LOOK * given)
    }
}

/// `1 / (1 + exp(-c . (1, evidence)))`.
pub(crate) fn probability(coefficients: &ProbabilityCoefficients, evidence: &Evidence) -> f64 {
    let [bias, each @ ..] = coefficients;
    let logit = bias + each.iter().zip(evidence).map(|(c, e)| c * e).sum::<f64>();
    1.0 / (1.0 + exp(-logit))
}

/// `ln(p / (1 - p))` of a probability kept within limits.
fn logit(p: f64, [least, most]: [f64; 2]) -> f64 {
    let p = p.clamp(least, most);
    log(p / (1.0 - p))
}
