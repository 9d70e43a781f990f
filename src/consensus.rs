//! Whether so much agreement could be chance: a pose that chance explains as well is not an answer.

use crate::math::{exp, log, square};
use crate::noise::{NoiseModel, bell_inverse, inlier_probability};

/// Noise, in guesses of it, at which a pose is tested, and its share of the test: fixed, so that chance cannot choose it.
const TESTED_NOISE: [(f64, f64); 3] = [(0.7, 0.15), (1.4, 0.6), (2.8, 0.25)];
/// Largest sample of a minimal solver.
const MOST_FITTED: usize = 3;
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
    /// Keypoints that make one.
    pub(crate) sample: usize,
}

impl Consensus<'_> {
    /// Log10 of the number of poses as good as this one to expect among random keypoints.
    ///
    /// Scores say beforehand which keypoints to believe, and so which hypotheses count: then the drawn keypoints alone
    /// were fitted to. Without scores, or where they promise too much, the share of inliers is found from the
    /// residuals (one of as many as there are keypoints), and two keypoints do not count: those drawn, or the one drawn
    /// and one more that the pose chose by its agreement.
    pub(crate) fn log10_nfa(&self, keypoints: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
        let (n, searched) = (self.keypoints as f64, self.hypotheses as f64);
        let found = |tests: f64| self.log10_false_alarms(self.share, 2, tests, keypoints.clone());
        match self.score_sum {
            None => found(searched * n),
            Some(sum) => {
                let tests = searched * sum / n / SHARE_OF_SCORES;
                let believed = self.log10_false_alarms(1.0, self.sample, tests, keypoints.clone());
                believed.min(found(searched * n / (1.0 - SHARE_OF_SCORES)))
            }
        }
    }

    /// Log10 of the expected number of poses as good as this one among `tests` hypotheses for keypoints uniform in the
    /// area (number of false alarms, as in a-contrario detection: Moisan and Stival, IJCV 2004).
    ///
    /// The likelihood ratio of the mixture against chance has expectation one under chance, and so has the mean over
    /// several noises; by Markov's inequality it exceeds `x` with probability at most `1 / x`.
    fn log10_false_alarms(
        &self,
        share: f64,
        fitted: usize,
        tests: f64,
        keypoints: impl Iterator<Item = (f64, f64)> + Clone,
    ) -> f64 {
        let evidence = TESTED_NOISE
            .map(|(noise, weight)| (weight, self.evidence(noise * self.model.guess, share, fitted, keypoints.clone())));
        let most = evidence.iter().map(|e| e.1).fold(f64::NEG_INFINITY, f64::max);
        let mean: f64 = evidence.iter().map(|(weight, e)| weight * exp(e - most)).sum();
        (log(tests / mean) - most) / core::f64::consts::LN_10
    }

    /// Logarithm of the likelihood ratio at one noise. The `fitted` keypoints that made the pose, taken as those that
    /// speak most for it, do not count; weights say how likely a keypoint is an inlier before it is looked at.
    fn evidence(&self, sigma: f64, share: f64, fitted: usize, keypoints: impl Iterator<Item = (f64, f64)>) -> f64 {
        let peak = self.model.area / (2.0 * core::f64::consts::PI * square(sigma));
        let half_precision = 0.5 / square(sigma);
        // The largest ratios, in increasing order.
        let mut best = [1.0; MOST_FITTED];
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
        sum + log(product) - log(best[MOST_FITTED - fitted..].iter().product())
    }
}
