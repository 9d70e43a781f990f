//! How noisy the keypoints are, from the residuals of a pose, and whether chance explains them as well.

use crate::math::{log, sqrt, square};

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
/// Tukey's `c` in units of the residual at which inlier and outlier are as likely: the weight there is 0.24, the best
/// compromise between few outliers (wider is better) and many (narrower).
const TUKEY_PER_EVEN: f64 = 1.4;
/// Narrowest and widest Tukey scale, in standard deviations of the noise.
const SCALES: [f64; 2] = [3.5, 9.0];
/// The share of inliers stays away from certainty.
const SHARES: [f64; 2] = [0.02, 0.98];

/// `(1 + x / 16)^16`, for `exp(x)`: inliers with the tails of Student's t with 30 degrees of freedom, and no call of
/// a library in the loop.
#[inline(always)]
fn bell_inverse(x: f64) -> f64 {
    square(square(square(square(1.0 + 0.0625 * x))))
}

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
            let (half_precision, flatness) = (0.5 / variance, 2.0 * core::f64::consts::PI * variance / self.area);
            for (r2, weight) in keypoints.clone() {
                let prior = inlier_probability(share, weight);
                // p(inlier | r) by Bayes' rule; infinite residuals (behind the camera) have none
                let odds = (1.0 - prior) * flatness * bell_inverse(r2 * half_precision);
                let p = prior / (prior + odds);
                inliers += p;
                weights += weight * p;
                sum += if p > 0.0 { weight * p * r2 } else { 0.0 };
                total += weight;
            }
            share = inliers / total;
            let scale = inliers / weights.max(f64::MIN_POSITIVE);
            let free = (inliers - FITTED).max(0.5);
            let squares = 0.5 * sum * scale + GUESS_WEIGHT * square(self.guess);
            variance = (squares / (free + GUESS_WEIGHT)).clamp(lowest, highest);
        }
        Noise { sigma: sqrt(variance), share }
    }

    /// Tukey's `c` for a mixture: it follows the residual at which a keypoint is as likely an inlier as an outlier.
    pub(crate) fn tukey_scale(&self, noise: Noise) -> f64 {
        let share = inlier_probability(noise.share, 1.0);
        let peak = self.area / (2.0 * core::f64::consts::PI * square(noise.sigma));
        let even = 2.0 * log((share / (1.0 - share) * peak).max(1.0));
        noise.sigma * (TUKEY_PER_EVEN * sqrt(even)).clamp(SCALES[0], SCALES[1])
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
        let half_precision = 0.5 / square(noise.sigma);
        // The largest ratios, in increasing order.
        let mut best = [1.0; 3];
        let (mut sum, mut product) = (0.0, 1.0);
        for (r2, weight) in keypoints {
            let p = inlier_probability(noise.share, weight);
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
        let evidence = sum - log(best[3 - fitted..].iter().product::<f64>());
        (log(tests) - evidence) / core::f64::consts::LN_10
    }
}
