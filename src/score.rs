//! Scores of hypotheses: the loop over hypotheses x points, left as soon as a hypothesis cannot win.

use crate::lanes::Lanes;
use crate::residual::{Block, Projection};
use crate::simd::VectorUnit;

/// How a hypothesis is scored. Lower is better; both are at most the sum of the weights.
///
/// ```
/// use groundpose::options::Options;
/// use groundpose::score::Scoring;
///
/// let paper = Options { scoring: Scoring::Inliers, ..Options::default() };
/// assert!(paper.check().is_ok() && Options::default().scoring == Scoring::Msac);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scoring {
    /// Truncated squared error `min(r^2 / tau^2, 1)` (MSAC).
    Msac,
    /// Number of points beyond the threshold: RANSAC's inlier count (paper, Alg. A.1).
    Inliers,
}

/// Blocks between two looks at whether the hypothesis has already lost.
const BLOCKS_PER_CHECK: usize = 8;

/// Weighted cost of a hypothesis with threshold `tau2` (squared pixels), or infinity once it reaches `bound`.
#[inline]
pub(crate) fn cost(
    unit: VectorUnit,
    blocks: &[Block],
    projection: &Projection,
    scoring: Scoring,
    tau2: f64,
    bound: f64,
) -> f64 {
    let limit = Lanes::splat(tau2);
    match scoring {
        // A residual that is not a number costs one.
        Scoring::Msac => unit.run(
            #[inline(always)]
            || accumulate(blocks, projection, bound, |r2| r2.min(limit) * (1.0 / tau2)),
        ),
        Scoring::Inliers => unit.run(
            #[inline(always)]
            || accumulate(blocks, projection, bound, |r2| Lanes::splat(1.0) - r2.at_most(limit)),
        ),
    }
}

#[inline(always)]
fn accumulate(blocks: &[Block], projection: &Projection, bound: f64, loss: impl Fn(Lanes) -> Lanes) -> f64 {
    let mut total = Lanes::default();
    for group in blocks.chunks(BLOCKS_PER_CHECK) {
        for block in group {
            total += block.weight * loss(projection.squared_residuals(block));
        }
        if total.sum() >= bound {
            return f64::INFINITY;
        }
    }
    total.sum()
}

/// Number of points within the threshold.
pub(crate) fn inlier_count(unit: VectorUnit, blocks: &[Block], projection: &Projection, tau2: f64) -> usize {
    let limit = Lanes::splat(tau2);
    let count = unit.run(
        #[inline(always)]
        || {
            let mut count = Lanes::default();
            for block in blocks {
                let squared = projection.squared_residuals(block);
                count += squared.at_most(limit).where_positive(block.weight, 0.0);
            }
            count.sum()
        },
    );
    count as usize
}
