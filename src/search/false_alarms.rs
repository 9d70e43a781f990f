//! Whether so much agreement could be chance: a pose that chance explains as well is not an answer.
//!
//! By chance a keypoint is uniform in the area $`A`$; at a pose it is an inlier with probability $`p_i`$ and noise
//! $`\sigma`$, or else by chance. $`T`$ tests of hypotheses, over which the keypoints $`i`$ that did not make the pose
//! give evidence by their residuals $`r_i`$, find
//!
//! ```math
//! \text{NFA} = \frac{T}{\sum_k w_k E(\sigma_k)}, \qquad
//! E(\sigma) = \prod_i \Bigl( 1 - p_i + p_i \frac{A}{2 \pi \sigma^2} \, b\bigl( r_i^2 / (2 \sigma^2) \bigr) \Bigr)
//! ```
//!
//! poses as good as this one; $`b(x)`$ falls as $`e^{-x}`$ with heavier tails.

use crate::geometry::math::{exp, log, square};
use crate::search::noise::{NoiseModel, bell_inverse_lanes, inlier_probability_lanes};
use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{Lanes, Unit, Vector};
use crate::simd::projection::Measured;
use crate::tuning::{BELIEF_IN_SCORES, TESTED_NOISE};

/// Largest sample of a minimal solver.
const MOST_FITTED: usize = 3;

/// What a search found, to be tested against chance.
pub(crate) struct Consensus<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) model: &'a NoiseModel,
    /// Fraction of inliers found at the pose.
    pub(crate) inlier_fraction: f64,
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
    /// were fitted to. Without scores, or where they promise too much, the fraction of inliers is found from the
    /// residuals (one of as many as there are keypoints), and two keypoints do not count: those drawn, or the one drawn
    /// and one more that the pose chose by its agreement.
    pub(crate) fn log10_nfa(&self, points: Measured) -> f64 {
        let (n, searched) = (self.keypoints as f64, self.hypotheses as f64);
        let found = |tests: f64| self.log10_false_alarms(self.inlier_fraction, 2, tests, points);
        match self.score_sum {
            None => found(searched * n),
            Some(sum) => {
                let tests = searched * sum / n / BELIEF_IN_SCORES;
                let believed = self.log10_false_alarms(1.0, self.sample, tests, points);
                believed.min(found(searched * n / (1.0 - BELIEF_IN_SCORES)))
            }
        }
    }

    /// Log10 of the expected number of poses as good as this one among `tests` hypotheses for keypoints uniform in the
    /// area (number of false alarms, as in a-contrario detection: Moisan and Stival, IJCV 2004).
    ///
    /// The likelihood ratio of the mixture against chance has expectation one under chance, and so has the mean over
    /// several noises; by Markov's inequality it exceeds `x` with probability at most `1 / x`.
    fn log10_false_alarms(&self, inlier_fraction: f64, fitted: usize, tests: f64, points: Measured) -> f64 {
        let mut evidence = [(0.0, 0.0); TESTED_NOISE.len()];
        for (entry, (noise, weight)) in evidence.iter_mut().zip(TESTED_NOISE) {
            let sigma = noise * self.model.guess;
            *entry =
                (weight, self.unit.run(Evidence { sigma, area: self.model.area, inlier_fraction, fitted, points }));
        }
        let most = evidence.iter().map(|e| e.1).fold(f64::NEG_INFINITY, f64::max);
        let mean: f64 = evidence.iter().map(|(weight, e)| weight * exp(e - most)).sum();
        (log(tests / mean) - most) / core::f64::consts::LN_10
    }
}

/// Logarithm of the likelihood ratio at one noise. The `fitted` keypoints that made the pose, taken as those that
/// speak most for it, do not count; weights say how likely a keypoint is an inlier before it is looked at.
struct Evidence<'a> {
    sigma: f64,
    area: f64,
    inlier_fraction: f64,
    fitted: usize,
    points: Measured<'a>,
}

/// Blocks whose ratios are multiplied before a look at the size of the product.
const BLOCKS_PER_LOOK: usize = 4;

impl HotLoop for Evidence<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> f64 {
        let one = unit.splat(1.0);
        let peak = self.area / (2.0 * core::f64::consts::PI * square(self.sigma));
        let half_precision = 0.5 / square(self.sigma);
        let mut product = Product { sum: 0.0, product: 1.0 };
        // The largest ratios of every lane, in falling order.
        let (mut first, mut second, mut third) = (one, one, one);
        for group in self.points.groups(BLOCKS_PER_LOOK) {
            let mut lanes = one;
            for (r2, weight) in group.each() {
                let weight = unit.load(weight);
                let p = inlier_probability_lanes(unit, self.inlier_fraction, weight);
                let bell = bell_inverse_lanes(unit, unit.load(r2) * half_precision);
                // An empty lane says nothing.
                let ratio = (one - p + p * peak / bell).where_positive(weight, one);
                lanes = lanes * ratio;
                let rest = ratio.min(first);
                first = first.max(ratio);
                let last = rest.min(second);
                second = second.max(rest);
                third = third.max(last);
            }
            let [a, b, c, d] = lanes.lanes().0;
            product.add(a);
            product.add(b);
            product.add(c);
            product.add(d);
        }
        let mut best = [1.0; MOST_FITTED];
        insert(first.lanes(), &mut best);
        insert(second.lanes(), &mut best);
        insert(third.lanes(), &mut best);
        let mut fitted = 1.0;
        for ratio in &best[..self.fitted] {
            fitted *= ratio;
        }
        product.sum + log(product.product) - log(fitted)
    }
}

/// The logarithm of a product of many numbers: one logarithm before the product leaves the range of numbers.
struct Product {
    sum: f64,
    product: f64,
}

impl Product {
    #[inline(always)]
    fn add(&mut self, factor: f64) {
        self.product *= factor;
        if !(1e-100..1e100).contains(&self.product) {
            self.sum += log(self.product);
            self.product = 1.0;
        }
    }
}

/// The largest numbers seen, in falling order.
#[inline(always)]
fn insert(lanes: Lanes, best: &mut [f64; MOST_FITTED]) {
    for mut number in lanes.0 {
        for place in best.iter_mut() {
            if number > *place {
                core::mem::swap(place, &mut number);
            }
        }
    }
}
