//! How noisy the keypoints are, from the residuals of a pose.

use crate::geometry::math::{log, sqrt, square};
use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{Unit, Vector};
use crate::simd::projection::Measured;
use crate::tuning::{
    INLIER_FRACTIONS, NOISE_FEWEST, NOISE_FITTED, NOISE_GUESS_WEIGHT, NOISE_LIMITS, NOISE_ROUNDS, NOISE_START_FRACTION,
    TUKEY_LIMITS, TUKEY_PER_EVEN,
};

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
    pub(crate) inlier_fraction: f64,
}

/// Sums over keypoints, each counted with the probability that it is an inlier.
struct Expected {
    inliers: f64,
    inlier_weights: f64,
    /// Weighted squared residuals.
    squares: f64,
    /// Of all keypoints.
    weights: f64,
}

/// `(1 + x / 16)^16`, for `exp(x)`: inliers with the tails of Student's t with 30 degrees of freedom, and no call of
/// a library in the loop.
#[inline(always)]
pub(crate) fn bell_inverse_lanes<U: Unit>(unit: U, x: U::Vector) -> U::Vector {
    let y = unit.splat(1.0) + x * 0.0625;
    let y = y * y;
    let y = y * y;
    let y = y * y;
    y * y
}

/// [`inlier_probability`] of many keypoints.
#[inline(always)]
pub(crate) fn inlier_probability_lanes<U: Unit>(unit: U, inlier_fraction: f64, weight: U::Vector) -> U::Vector {
    (weight * inlier_fraction).max(unit.splat(INLIER_FRACTIONS[0])).min(unit.splat(INLIER_FRACTIONS[1]))
}

/// Probability that a keypoint is an inlier, before it is looked at: in proportion to its weight.
fn inlier_probability(inlier_fraction: f64, weight: f64) -> f64 {
    (inlier_fraction * weight).clamp(INLIER_FRACTIONS[0], INLIER_FRACTIONS[1])
}

impl NoiseModel {
    /// Noise by expectation maximisation over the squared residuals of points.
    pub(crate) fn estimate(&self, unit: VectorUnit, points: Measured) -> Noise {
        let [lowest, highest] = NOISE_LIMITS.map(|b| square(b * self.guess));
        let mut noise = Noise { sigma: self.guess, inlier_fraction: NOISE_START_FRACTION };
        for _ in 0..NOISE_ROUNDS {
            let sums = unit.run(Expectation { model: self, noise, points });
            let scale = sums.inliers / sums.inlier_weights.max(f64::MIN_POSITIVE);
            let squares = 0.5 * sums.squares * scale + NOISE_GUESS_WEIGHT * square(self.guess);
            let free = (sums.inliers - NOISE_FITTED).max(NOISE_FEWEST) + NOISE_GUESS_WEIGHT;
            noise = Noise {
                sigma: sqrt((squares / free).clamp(lowest, highest)),
                inlier_fraction: sums.inliers / sums.weights,
            };
        }
        noise
    }

    /// Tukey's `c` for a mixture: it follows the residual at which a keypoint is as likely an inlier as an outlier.
    pub(crate) fn tukey_scale(&self, noise: Noise) -> f64 {
        let inlier_fraction = inlier_probability(noise.inlier_fraction, 1.0);
        let peak = self.area / (2.0 * core::f64::consts::PI * square(noise.sigma));
        let even = 2.0 * log((inlier_fraction / (1.0 - inlier_fraction) * peak).max(1.0));
        noise.sigma * (TUKEY_PER_EVEN * sqrt(even)).clamp(TUKEY_LIMITS[0], TUKEY_LIMITS[1])
    }
}

/// Expected inliers, and sums over them.
struct Expectation<'a> {
    model: &'a NoiseModel,
    noise: Noise,
    points: Measured<'a>,
}

impl HotLoop for Expectation<'_> {
    type Output = Expected;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> Expected {
        let variance = square(self.noise.sigma);
        let (half_precision, flatness) = (0.5 / variance, 2.0 * core::f64::consts::PI * variance / self.model.area);
        let (zero, one) = (unit.zero(), unit.splat(1.0));
        let (mut inliers, mut inlier_weights, mut squares, mut weights) = (zero, zero, zero, zero);
        for (r2, weight) in self.points.each() {
            let (r2, weight) = (unit.load(r2), unit.load(weight));
            let prior = inlier_probability_lanes(unit, self.noise.inlier_fraction, weight);
            // p(inlier | r) by Bayes' rule; an infinite residual (behind the camera) has none
            let odds = (one - prior) * (bell_inverse_lanes(unit, r2 * half_precision) * flatness);
            let p = (prior / (prior + odds)).where_positive(weight, zero);
            inliers += p;
            inlier_weights += weight * p;
            squares += (weight * p * r2).where_positive(p, zero);
            weights += weight;
        }
        Expected {
            inliers: inliers.sum(),
            inlier_weights: inlier_weights.sum(),
            squares: squares.sum(),
            weights: weights.sum(),
        }
    }
}
