//! How noisy the keypoints are, from the residuals of a pose, and whether chance explains them as well.

use crate::math::{log, square};

/// Two-dimensional residuals as a mixture: Gaussian inliers of unknown variance, and outliers uniform in an area.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NoiseModel {
    /// Guess of the standard deviation of a coordinate, pixels.
    pub(crate) guess: f64,
    /// Where outliers fall, pixels squared.
    pub(crate) area: f64,
}

/// Standard deviation of a coordinate, pixels, and the probability that a keypoint of weight one is an inlier.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise {
    pub(crate) sigma: f64,
    pub(crate) share: f64,
}

/// Keypoints' worth of the guess.
const GUESS_WEIGHT: f64 = 3.0;
/// Smallest and largest noise, in guesses.
const BOUNDS: [f64; 2] = [0.04, 4.0];
/// Keypoints' worth of freedom that the pose was fitted with.
const FITTED: f64 = 2.0;
/// Rounds of expectation and maximisation; the estimate has two digits after that.
const ROUNDS: usize = 5;
/// Beyond this `r^2 / (2 variance)` a keypoint is an outlier without a look at the exponential.
const FAR: f64 = 50.0;
/// The share of inliers stays away from certainty.
const SHARES: [f64; 2] = [0.02, 0.98];

/// Probability that a keypoint is an inlier, before it is looked at: in proportion to its weight.
fn inlier_probability(share: f64, weight: f64) -> f64 {
    (share * weight).clamp(SHARES[0], SHARES[1])
}

impl NoiseModel {
    /// Noise by expectation maximisation over (squared residual, weight) pairs.
    pub(crate) fn estimate(&self, keypoints: impl Iterator<Item = (f64, f64)> + Clone) -> Noise {
        let [lowest, highest] = BOUNDS.map(|b| square(b * self.guess));
        let (mut variance, mut share) = (square(self.guess), 0.5);
        for _ in 0..ROUNDS {
            let (mut inliers, mut sum, mut total, mut weights) = (0.0, 0.0, 0.0, 0.0);
            let flatness = 2.0 * core::f64::consts::PI * variance / self.area;
            for (r2, weight) in keypoints.clone() {
                let x = 0.5 * r2 / variance;
                let prior = inlier_probability(share, weight);
                // p(inlier | r) by Bayes' rule
                let p = if x < FAR { 1.0 / (1.0 + (1.0 - prior) / prior * flatness * libm::exp(x)) } else { 0.0 };
                inliers += p;
                weights += weight * p;
                // A residual behind the camera is infinite: 0 * infinity.
                sum += if p > 0.0 { weight * p * r2 } else { 0.0 };
                total += weight;
            }
            share = inliers / total;
            let scale = inliers / weights.max(f64::MIN_POSITIVE);
            let free = (inliers - FITTED).max(0.5);
            let squares = 0.5 * sum * scale + GUESS_WEIGHT * square(self.guess);
            variance = (squares / (free + GUESS_WEIGHT)).clamp(lowest, highest);
        }
        Noise { sigma: crate::math::sqrt(variance), share }
    }

    /// Log10 of the expected number of poses as good as this one among `tests` hypotheses for random keypoints,
    /// uniform in the area (number of false alarms, as in a-contrario detection).
    ///
    /// The likelihood ratio of the mixture against chance has expectation one under chance, so by Markov's
    /// inequality it exceeds `x` with probability at most `1 / x`. The `fitted` keypoints of the sample that made
    /// the pose, taken as those that speak most for it, do not count; weights say how likely a keypoint is an inlier before it is looked at.
    pub(crate) fn log10_false_alarms(
        &self,
        noise: Noise,
        keypoints: impl Iterator<Item = (f64, f64)> + Clone,
        tests: f64,
        fitted: usize,
    ) -> f64 {
        let peak = self.area / (2.0 * core::f64::consts::PI * square(noise.sigma));
        let mut best = [0.0; 3];
        let mut sum = 0.0;
        for (r2, weight) in keypoints {
            let p = inlier_probability(noise.share, weight);
            let x = 0.5 * r2 / square(noise.sigma);
            let term = if x < FAR { log(1.0 - p + p * peak * libm::exp(-x)) } else { log(1.0 - p) };
            sum += term;
            // The largest terms so far, in increasing order.
            if term > best[0] {
                best[0] = term;
                best.sort_unstable_by(f64::total_cmp);
            }
        }
        let evidence = sum - best[3 - fitted..].iter().sum::<f64>();
        (log(tests) - evidence) / core::f64::consts::LN_10
    }
}
