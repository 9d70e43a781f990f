//! Reprojection residuals and their Jacobian, over points laid out for vector units.

use nalgebra::{Matrix3, Vector3};

use crate::geometry::camera::Camera;
use crate::geometry::pose::Pose;
use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};

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
    /// Squared residual, pixels squared: [`Measured`] alone reads it.
    r2: Lanes,
}

impl Block {
    /// A block without points.
    pub(crate) const EMPTY: Self = {
        let zero = Lanes::splat(0.0);
        Self { u: zero, v: zero, x: zero, y: zero, z: zero, weight: zero, active: zero, r2: zero }
    };
}

/// `diag(fx, fy, 1) (R X + t)`: homogeneous pixels relative to the principal point.
#[derive(Clone, Copy)]
pub(crate) struct Projection {
    r: [[f64; 3]; 3],
    t: [f64; 3],
}

impl Projection {
    #[inline]
    pub(crate) fn new(camera: &Camera, pose: &Pose) -> Self {
        let scale = [camera.fx, camera.fy, 1.0];
        let row = |i: usize| [pose.r[(i, 0)] * scale[i], pose.r[(i, 1)] * scale[i], pose.r[(i, 2)] * scale[i]];
        Self { r: [row(0), row(1), row(2)], t: [pose.t.x * scale[0], pose.t.y * scale[1], pose.t.z] }
    }

    /// Squared reprojection errors of a block, pixels squared; infinite behind the camera.
    #[inline(always)]
    pub(crate) fn squared_residuals<U: Unit>(&self, unit: U, b: &Block) -> U::Vector {
        let depth = self.row(unit, b, 2);
        let inverse = unit.splat(1.0) / depth;
        let du = self.row(unit, b, 0) * inverse - unit.load(b.u);
        let dv = self.row(unit, b, 1) * inverse - unit.load(b.v);
        (du * du + dv * dv).where_positive(depth, unit.splat(f64::INFINITY))
    }

    /// One coordinate of the homogeneous pixels.
    #[inline(always)]
    fn row<U: Unit>(&self, unit: U, b: &Block, i: usize) -> U::Vector {
        let [rx, ry, rz] = self.r[i];
        unit.load(b.x) * rx + unit.load(b.y) * ry + unit.load(b.z) * rz + unit.splat(self.t[i])
    }
}

/// Points with their squared residuals at the pose at which they were measured.
#[derive(Clone, Copy)]
pub(crate) struct Measured<'a>(&'a [Block]);

impl<'a> Measured<'a> {
    /// Measures the points of blocks.
    #[inline]
    pub(crate) fn new(unit: VectorUnit, blocks: &'a mut [Block], projection: &Projection) -> Self {
        unit.run(Measure { blocks: &mut *blocks, projection });
        Self(blocks)
    }

    /// Squared residuals, pixels squared, and weights, four at a time.
    #[inline(always)]
    pub(crate) fn each(self) -> impl Iterator<Item = (Lanes, Lanes)> {
        self.0.iter().map(
            #[inline(always)]
            |block| (block.r2, block.weight),
        )
    }

    /// The same points in groups of so many blocks.
    #[inline(always)]
    pub(crate) fn groups(self, blocks: usize) -> impl Iterator<Item = Self> {
        self.0.chunks(blocks).map(Self)
    }

    /// Squared residual of the `k`th point, pixels squared.
    #[inline(always)]
    pub(crate) fn squared(self, k: usize) -> f64 {
        self.0[k / LANES].r2.0[k % LANES]
    }
}

/// Measures blocks, and gives every point that is within `tau2` (pixels squared) its weight, the others none.
pub(crate) fn activate_within(unit: VectorUnit, blocks: &mut [Block], projection: &Projection, tau2: f64) {
    unit.run(Measure { blocks: &mut *blocks, projection });
    for block in blocks {
        for l in 0..LANES {
            block.active.0[l] = if block.r2.0[l] <= tau2 { block.weight.0[l] } else { 0.0 };
        }
    }
}

/// Writes the squared residuals of a projection into the blocks.
struct Measure<'a> {
    blocks: &'a mut [Block],
    projection: &'a Projection,
}

impl HotLoop for Measure<'_> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) {
        for block in self.blocks {
            block.r2 = self.projection.squared_residuals(unit, block).lanes();
        }
    }
}

/// Jacobian of one point's residual: rows `u` and `v`, by a rotation vector on the left and a translation.
pub(crate) struct PointJacobian {
    /// `d residual / d (rotation, translation)`.
    pub(crate) pose: [[f64; 6]; 2],
    /// `d residual / d X_object`.
    pub(crate) point: [[f64; 3]; 2],
}

/// Jacobian of one model point's residual; `None` behind the camera.
#[inline]
pub(crate) fn point_jacobian(camera: &Camera, pose: &Pose, model: [f64; 3]) -> Option<PointJacobian> {
    let rotated: Vector3<f64> = pose.r * Vector3::from(model);
    let p = rotated + pose.t;
    if p.z <= 0.0 {
        return None;
    }
    let inverse = 1.0 / p.z;
    let (u, v) = (camera.fx * p.x * inverse, camera.fy * p.y * inverse);
    // Gradients of u and v by the point in the camera frame.
    let gradients =
        [Vector3::new(camera.fx * inverse, 0.0, -u * inverse), Vector3::new(0.0, camera.fy * inverse, -v * inverse)];
    let row = |g: &Vector3<f64>| {
        let w = rotated.cross(g);
        [w.x, w.y, w.z, g.x, g.y, g.z]
    };
    let to_object = |g: &Vector3<f64>, r: &Matrix3<f64>| -> [f64; 3] { r.tr_mul(g).into() };
    Some(PointJacobian {
        pose: [row(&gradients[0]), row(&gradients[1])],
        point: [to_object(&gradients[0], &pose.r), to_object(&gradients[1], &pose.r)],
    })
}
