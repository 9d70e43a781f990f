//! Whether so much agreement could be chance: a pose that chance explains as well is not an answer.

use crate::math::{log, square};
use crate::noise::{Noise, NoiseModel, bell_inverse, inlier_probability};

/// Noise, in guesses of it, at which a pose is tested: fixed, so that chance cannot choose it.
const TESTED_NOISE: f64 = 1.4;
/// Share of the test that goes to believing the scores as they are; the rest to finding the share of inliers.
const SHARE_OF_SCORES: f64 = 0.9;

/// What a search found, to be tested against chance.
pub(crate) struct Consensus<'a> {
    pub(crate) model: &'a NoiseModel,
    /// Share of inliers found at the pose.
    pub(crate) share: f64,
    pub(crate) keypoints: usize,
    /// Sum of the weights, when they come from scores.
    pub(crate) score_sum: Option<f64>,
    /// Hypotheses of the search.
    pub(crate) hypotheses: usize,
}

impl Consensus<'_> {
    /// Log10 of the number of poses as good as this one to expect among random keypoints.
    ///
    /// Scores say beforehand which keypoints to believe, and so which hypotheses count: then the drawn keypoint alone
    /// was fitted to. Without scores, or where they promise too much, the share of inliers is found from the
    /// residuals (one of as many as there are keypoints), and the pose chose one more keypoint by its agreement.
    pub(crate) fn log10_nfa(&self, keypoints: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
        let (n, searched) = (self.keypoints as f64, self.hypotheses as f64);
        let found = |tests: f64| self.log10_false_alarms(self.share, 2, tests, keypoints.clone());
        match self.score_sum {
            None => found(searched * n),
            Some(sum) => {
                let believed = self.log10_false_alarms(1.0, 1, searched * sum / n / SHARE_OF_SCORES, keypoints.clone());
                believed.min(found(searched * n / (1.0 - SHARE_OF_SCORES)))
            }
        }
    }

    /// Log10 of the expected number of poses as good as this one among `tests` hypotheses for keypoints uniform in the
    /// area (number of false alarms, as in a-contrario detection: Moisan and Stival, IJCV 2004).
    ///
    /// The likelihood ratio of the mixture against chance has expectation one under chance, so by Markov's inequality
    /// it exceeds `x` with probability at most `1 / x`. The `fitted` keypoints that made the pose, taken as those that
    /// speak most for it, do not count; weights say how likely a keypoint is an inlier before it is looked at.
    fn log10_false_alarms(
        &self,
        share: f64,
        fitted: usize,
        tests: f64,
        keypoints: impl Iterator<Item = (f64, f64)>,
    ) -> f64 {
        let sigma = TESTED_NOISE * self.model.guess;
        let peak = self.model.area / (2.0 * core::f64::consts::PI * square(sigma));
        let half_precision = 0.5 / square(sigma);
        // The largest ratios, in increasing order.
        let mut best = [1.0; 2];
        let (mut sum, mut product) = (0.0, 1.0);
        for (r2, weight) in keypoints {
            let p = inlier_probability(share, weight);
            let ratio = 1.0 - p + p * peak / bell_inverse(r2 * half_precision);
            product *= ratio;
            // One logarithm for many ratios, before their product leaves the range of numbers.
            if !(1e-200..1e200).contains(&product) {
                sum += log(product);
                product = 1.0;
            }
            if ratio > best[0] {
                best[0] = ratio;
                best.sort_unstable_by(f64::total_cmp);
            }
        }
        sum += log(product);
        let evidence = sum - log(best[best.len() - fitted..].iter().product());
        (log(tests) - evidence) / core::f64::consts::LN_10
    }
}

impl NoiseModel {
    /// The test of a pose with this noise.
    pub(crate) fn consensus(
        &self,
        noise: Noise,
        keypoints: usize,
        score_sum: Option<f64>,
        hypotheses: usize,
    ) -> Consensus<'_> {
        Consensus { model: self, share: noise.share, keypoints, score_sum, hypotheses }
    }
}
