//! Keypoints laid out for vector units.

use crate::simd::lanes::Lanes;

/// Four points of one object, side by side. Lanes beyond the last point have weight zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block {
    /// Observed pixel relative to the principal point.
    pub(crate) u: Lanes,
    pub(crate) v: Lanes,
    /// Model point of the current shape.
    pub(crate) x: Lanes,
    pub(crate) y: Lanes,
    pub(crate) z: Lanes,
    /// Weight from the keypoint's score.
    pub(crate) weight: Lanes,
    /// Weight in the current stage: `weight`, or zero for a point left out.
    pub(crate) active: Lanes,
    /// Squared residual, pixels squared: read through `projection::Measured` alone.
    pub(super) r2: Lanes,
}

impl Block {
    /// A block without points.
    pub(crate) const EMPTY: Self = {
        let zero = Lanes::splat(0.0);
        Self { u: zero, v: zero, x: zero, y: zero, z: zero, weight: zero, active: zero, r2: zero }
    };
}
