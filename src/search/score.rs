//! Scores of hypotheses: the loop over hypotheses x points, left as soon as a hypothesis cannot win.

use crate::simd::blocks::Block;
use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{Unit, Vector};
use crate::simd::projection::{Measured, Projection};

/// How a hypothesis is scored. Lower is better; both are at most the sum of the weights.
///
/// ```
/// use groundpose::{Options, Scoring};
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
const BLOCKS_PER_CHECK: usize = 4;

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
    match scoring {
        Scoring::Msac => unit.run(Truncated { blocks, projection, tau2, bound }),
        Scoring::Inliers => unit.run(Beyond { blocks, projection, tau2, bound }),
    }
}

struct Truncated<'a> {
    blocks: &'a [Block],
    projection: &'a Projection,
    tau2: f64,
    bound: f64,
}

impl HotLoop for Truncated<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> f64 {
        let (limit, inverse) = (unit.splat(self.tau2), 1.0 / self.tau2);
        // A residual that is not a number costs one.
        accumulate(
            unit,
            self.blocks,
            self.projection,
            self.bound,
            #[inline(always)]
            |r2| r2.min(limit) * inverse,
        )
    }
}

struct Beyond<'a> {
    blocks: &'a [Block],
    projection: &'a Projection,
    tau2: f64,
    bound: f64,
}

impl HotLoop for Beyond<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> f64 {
        let (limit, one) = (unit.splat(self.tau2), unit.splat(1.0));
        accumulate(
            unit,
            self.blocks,
            self.projection,
            self.bound,
            #[inline(always)]
            |r2| one - r2.at_most(limit),
        )
    }
}

#[inline(always)]
fn accumulate<U: Unit>(
    unit: U,
    blocks: &[Block],
    projection: &Projection,
    bound: f64,
    loss: impl Fn(U::Vector) -> U::Vector,
) -> f64 {
    let mut total = unit.zero();
    for group in blocks.chunks(BLOCKS_PER_CHECK) {
        for block in group {
            total += unit.load(block.weight) * loss(projection.squared_residuals(unit, block));
        }
        if total.sum() >= bound {
            return f64::INFINITY;
        }
    }
    total.sum()
}

/// [`Scoring::Msac`] of points that are measured already.
pub(crate) fn truncated(unit: VectorUnit, points: Measured, tau2: f64) -> f64 {
    unit.run(TruncatedMeasured { points, tau2 })
}

struct TruncatedMeasured<'a> {
    points: Measured<'a>,
    tau2: f64,
}

impl HotLoop for TruncatedMeasured<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> f64 {
        let (limit, inverse) = (unit.splat(self.tau2), 1.0 / self.tau2);
        let mut total = unit.zero();
        for (r2, weight) in self.points.each() {
            total += unit.load(weight) * (unit.load(r2).min(limit) * inverse);
        }
        total.sum()
    }
}

/// Number of points within the threshold.
pub(crate) fn inlier_count(unit: VectorUnit, blocks: &[Block], projection: &Projection, tau2: f64) -> usize {
    unit.run(Within { blocks, projection, tau2 }) as usize
}

struct Within<'a> {
    blocks: &'a [Block],
    projection: &'a Projection,
    tau2: f64,
}

impl HotLoop for Within<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> f64 {
        let (limit, zero) = (unit.splat(self.tau2), unit.zero());
        let mut count = zero;
        for block in self.blocks {
            let squared = self.projection.squared_residuals(unit, block);
            count += squared.at_most(limit).where_positive(unit.load(block.weight), zero);
        }
        count.sum()
    }
}
