//! The search: draw, solve, score, stop (paper, Alg. A.1).
//!
//! It stops once a sample of inliers alone was drawn with the wanted confidence. Of $`n`$ keypoints let $`I`$ be inliers
//! of the best hypothesis. Draws of one keypoint are without replacement, and samples of $`s`$ keypoints independent of
//! each other: after $`m`$ of them
//!
//! ```math
//! \text{confidence}_1 = 1 - \prod_{j=0}^{m-1} \frac{n - I - j}{n - j}, \qquad
//! \text{confidence}_s = 1 - \Bigl( 1 - \prod_{j=0}^{s-1} \frac{I - j}{n - j} \Bigr)^m .
//! ```

use crate::geometry::camera::Camera;
use crate::geometry::math::pow;
use crate::geometry::pose::Pose;
use crate::minimal::MinimalSolver;
use crate::search::sampler::Stream;
use crate::search::score::{Scoring, cost, inlier_count};
use crate::simd::blocks::Block;
use crate::simd::dispatch::VectorUnit;
use crate::simd::projection::Projection;
use crate::tuning::OTHER_WAY;

/// Hypotheses kept for refinement.
pub(crate) const MAX_CANDIDATES: usize = 4;

/// Why the search ended.
///
/// ```
/// use groundpose::StopReason;
///
/// assert_eq!(StopReason::NAMES[StopReason::Exhausted as usize], "exhausted");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum StopReason {
    /// There was no search.
    #[default]
    None = 0,
    /// The wanted probability that some sample had only inliers was reached.
    Confident = 1,
    /// Every sample was drawn.
    Exhausted = 2,
    /// The limit of iterations was reached.
    MaxIterations = 3,
}

impl StopReason {
    /// Every reason with its name, in order.
    pub const NAMES: [&'static str; 4] = ["none", "confident", "exhausted", "max_iterations"];
}

/// What the search did.
///
/// ```
/// use groundpose::{RansacStatistics, StopReason};
///
/// // What it is before anything was searched; `Estimate::ransac` holds what it was.
/// let none = RansacStatistics::default();
/// assert_eq!((none.iterations, none.stop_reason), (0, StopReason::None));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RansacStatistics {
    /// Samples drawn.
    pub iterations: usize,
    /// Hypotheses scored.
    pub hypotheses: usize,
    /// Probability that at least one sample held only inliers, given the inliers found.
    pub confidence: f64,
    /// Why it ended.
    pub stop_reason: StopReason,
}

/// A hypothesis and its cost.
#[derive(Clone, Copy)]
pub(crate) struct Candidate {
    pub(crate) cost: f64,
    pub(crate) pose: Pose,
}

/// The best hypotheses of different directions, best first.
pub(crate) struct Candidates {
    items: [Option<Candidate>; MAX_CANDIDATES],
    wanted: usize,
    /// A runner-up that costs more than this multiple of the best is not kept.
    worst_ratio: f64,
}

impl Candidates {
    pub(crate) fn new(wanted: usize, worst_ratio: f64) -> Self {
        Self { items: [None; MAX_CANDIDATES], wanted: wanted.clamp(1, MAX_CANDIDATES), worst_ratio }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Candidate> {
        self.items.iter().flatten()
    }

    /// A hypothesis at this cost or above is of no use.
    #[inline]
    fn bound(&self) -> f64 {
        let last = self.items[self.wanted - 1].map_or(f64::INFINITY, |c| c.cost);
        let best = self.items[0].map_or(f64::INFINITY, |c| c.cost * self.worst_ratio);
        last.min(best)
    }

    /// Whether it became the best.
    fn offer(&mut self, candidate: Candidate) -> bool {
        let same = |c: &Option<Candidate>| c.is_some_and(|c| c.pose.forward_cosine(&candidate.pose) > OTHER_WAY);
        let slot = match self.items[..self.wanted].iter().position(same) {
            Some(k) if self.items[k].is_some_and(|c| c.cost <= candidate.cost) => return false,
            Some(k) => k,
            None => self.wanted - 1,
        };
        self.items[slot] = Some(candidate);
        // Insertion from the back keeps the order.
        let mut k = slot;
        while k > 0 && self.items[k - 1].is_none_or(|c| c.cost > candidate.cost) {
            self.items.swap(k, k - 1);
            k -= 1;
        }
        k == 0
    }
}

/// One search over one object's points.
pub(crate) struct Search<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) camera: &'a Camera,
    pub(crate) blocks: &'a [Block],
    /// Index in the model of every visible keypoint.
    pub(crate) visible: &'a [u32],
    pub(crate) scoring: Scoring,
    pub(crate) inlier_threshold: f64,
    pub(crate) confidence: f64,
    pub(crate) max_iterations: usize,
    /// One-point draws made in any case: a drawn inlier may still be a noisy one.
    pub(crate) min_draws: usize,
    /// Largest depth of a hypothesis, metres.
    pub(crate) farthest: f64,
}

impl Search<'_> {
    /// One-point draws without replacement in the given order, and the exact finite stop rule.
    pub(crate) fn one_point(
        &self,
        solver: &impl MinimalSolver<1>,
        order: &[u32],
        candidates: &mut Candidates,
    ) -> RansacStatistics {
        let n = order.len();
        let mut run = Run::new(self, candidates);
        let mut statistics = RansacStatistics { stop_reason: StopReason::Exhausted, ..Default::default() };
        let (mut inliers, mut all_missed) = (0, 1.0);
        for (m, &k) in order.iter().enumerate() {
            if m >= self.max_iterations {
                statistics.stop_reason = StopReason::MaxIterations;
                break;
            }
            solver.solve([self.visible[k as usize] as usize], &mut |pose| run.score(pose));
            statistics.iterations = m + 1;
            if run.inliers == inliers {
                all_missed *= missed(n, inliers, m);
            } else {
                inliers = run.inliers;
                all_missed = miss_probability(n, inliers, m + 1);
            }
            statistics.confidence = 1.0 - all_missed;
            if m + 1 >= self.min_draws && m + 1 < n && statistics.confidence >= self.confidence {
                statistics.stop_reason = StopReason::Confident;
                break;
            }
        }
        statistics.hypotheses = run.hypotheses;
        statistics
    }

    /// Samples of `SIZE` points, independent of each other, and the adaptive stop rule.
    pub(crate) fn many_points<const SIZE: usize>(
        &self,
        solver: &impl MinimalSolver<SIZE>,
        stream: &mut Stream,
        candidates: &mut Candidates,
    ) -> RansacStatistics {
        let n = self.visible.len();
        let mut run = Run::new(self, candidates);
        let mut statistics = RansacStatistics { stop_reason: StopReason::MaxIterations, ..Default::default() };
        if n < SIZE {
            return statistics;
        }
        let mut inliers = 0;
        // That a sample is not good, and that none was.
        let (mut bad_sample, mut all_bad) = (1.0, 1.0);
        for m in 1..=self.max_iterations {
            let sample = stream.combination::<SIZE>(n).map(|k| self.visible[k] as usize);
            solver.solve(sample, &mut |pose| run.score(pose));
            statistics.iterations = m;
            if run.inliers != inliers {
                inliers = run.inliers;
                let good: f64 = (0..SIZE).map(|j| inliers.saturating_sub(j) as f64 / (n - j) as f64).product();
                bad_sample = 1.0 - good;
                all_bad = pow(bad_sample, m as f64);
            } else {
                all_bad *= bad_sample;
            }
            statistics.confidence = 1.0 - all_bad;
            if statistics.confidence >= self.confidence {
                statistics.stop_reason = StopReason::Confident;
                break;
            }
        }
        statistics.hypotheses = run.hypotheses;
        statistics
    }
}

/// Probability that `draws` without replacement from `n` points miss all `inliers`.
fn miss_probability(n: usize, inliers: usize, draws: usize) -> f64 {
    (0..draws).map(|earlier| missed(n, inliers, earlier)).product()
}

/// That one draw misses them when all `earlier` ones have.
fn missed(n: usize, inliers: usize, earlier: usize) -> f64 {
    let left = n - earlier;
    left.saturating_sub(inliers) as f64 / left as f64
}

/// The state of a search.
struct Run<'a, 'b> {
    search: &'a Search<'a>,
    candidates: &'b mut Candidates,
    hypotheses: usize,
    inliers: usize,
}

impl<'a, 'b> Run<'a, 'b> {
    fn new(search: &'a Search<'a>, candidates: &'b mut Candidates) -> Self {
        Self { search, candidates, hypotheses: 0, inliers: 0 }
    }

    #[inline]
    fn score(&mut self, pose: Pose) {
        let s = self.search;
        if pose.t.z > s.farthest {
            return;
        }
        self.hypotheses += 1;
        let tau2 = s.inlier_threshold * s.inlier_threshold;
        let projection = Projection::new(s.camera, &pose);
        let cost = cost(s.unit, s.blocks, &projection, s.scoring, tau2, self.candidates.bound());
        if cost.is_finite() && self.candidates.offer(Candidate { cost, pose }) {
            self.inliers = inlier_count(s.unit, s.blocks, &projection, tau2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::miss_probability;

    #[test]
    fn finite_stop_rule_counts_draws_without_replacement() {
        // 5 points, 2 inliers, 2 draws: C(3, 2) / C(5, 2) = 3 / 10
        assert!((miss_probability(5, 2, 2) - 0.3).abs() < 1e-15);
        assert_eq!(miss_probability(5, 2, 4), 0.0);
        assert_eq!(miss_probability(5, 0, 5), 1.0);
    }
}
