//! Scores of hypotheses: the loop over hypotheses x points, left as soon as a hypothesis cannot win.

use crate::residual::{Block, LANES, Projection, sum};
use crate::simd::VectorUnit;

/// How a hypothesis is scored. Lower is better; both are at most the sum of the weights.
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
    let inverse = 1.0 / tau2;
    match scoring {
        // A residual that is not a number compares false and costs one.
        Scoring::Msac => unit.run(|| {
            accumulate(
                blocks,
                projection,
                bound,
                #[inline(always)]
                |r2| if r2 < tau2 { r2 * inverse } else { 1.0 },
            )
        }),
        Scoring::Inliers => unit.run(|| {
            accumulate(
                blocks,
                projection,
                bound,
                #[inline(always)]
                |r2| if r2 <= tau2 { 0.0 } else { 1.0 },
            )
        }),
    }
}

#[inline(always)]
fn accumulate(blocks: &[Block], projection: &Projection, bound: f64, loss: impl Fn(f64) -> f64) -> f64 {
    let mut total = [0.0; LANES];
    for group in blocks.chunks(BLOCKS_PER_CHECK) {
        for block in group {
            let squared = projection.squared_residuals(block);
            for l in 0..LANES {
                total[l] += block.weight[l] * loss(squared[l]);
            }
        }
        if sum(&total) >= bound {
            return f64::INFINITY;
        }
    }
    sum(&total)
}

/// Number of points within the threshold.
pub(crate) fn inlier_count(blocks: &[Block], projection: &Projection, tau2: f64) -> usize {
    let mut count = 0;
    for block in blocks {
        let squared = projection.squared_residuals(block);
        for l in 0..LANES {
            count += usize::from(block.weight[l] > 0.0 && squared[l] <= tau2);
        }
    }
    count
}
