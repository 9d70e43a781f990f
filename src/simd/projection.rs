//! The pinhole projection on vector units: [`Camera::project`] for four points at once, relative to the principal
//! point.
//!
//! The scalar form serves single points where the caller's numbers come in and go out. Here are three orders of the
//! same operations, each with the fewest for its loop; another order would change the last bits of every answer:
//! residuals alone ([`Projection`]), residuals with their gradients ([`Projected`]), points of the camera frame
//! ([`centred`]).

use crate::geometry::camera::Camera;
use crate::geometry::pose::Pose;
use crate::simd::blocks::Block;
use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};

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

    /// Residuals of as many points as there is room for, pixels.
    #[inline]
    pub(crate) fn residuals(self, unit: VectorUnit, residuals: &mut [f64]) {
        unit.run(Roots { blocks: self.0, residuals });
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

struct Roots<'a> {
    blocks: &'a [Block],
    residuals: &'a mut [f64],
}

impl HotLoop for Roots<'_> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) {
        let (groups, rest) = self.residuals.as_chunks_mut::<LANES>();
        for (group, block) in groups.iter_mut().zip(self.blocks) {
            *group = roots(unit, block);
        }
        if let Some(block) = self.blocks.get(groups.len()) {
            rest.copy_from_slice(&roots(unit, block)[..rest.len()]);
        }
    }
}

/// Residuals of a block; of what is not a number as of what is behind the camera.
#[inline(always)]
fn roots<U: Unit>(unit: U, block: &Block) -> [f64; LANES] {
    unit.load(block.r2).sqrt().min(unit.splat(f64::INFINITY)).lanes().0
}

/// Four points seen from a pose.
#[derive(Clone, Copy)]
pub(crate) struct Projected<V> {
    /// Rotated model points.
    pub(crate) p: [V; 3],
    pub(crate) depth: V,
    /// One over the depth, and the same times the focal lengths; zero behind the camera.
    pub(crate) inverse: V,
    pub(crate) a: V,
    pub(crate) d: V,
    /// Pixels, relative to the principal point, and residuals.
    pub(crate) u: V,
    pub(crate) v: V,
    pub(crate) du: V,
    pub(crate) dv: V,
}

impl<V: Vector> Projected<V> {
    /// Room for some.
    #[inline(always)]
    pub(crate) fn none(zero: V) -> Self {
        let p = [zero; 3];
        Self { p, depth: zero, inverse: zero, a: zero, d: zero, u: zero, v: zero, du: zero, dv: zero }
    }

    #[inline(always)]
    pub(crate) fn new<U: Unit<Vector = V>>(unit: U, camera: &Camera, pose: &Pose, block: &Block) -> Self {
        let t = &pose.t;
        let p = [rotated(unit, pose, block, 0), rotated(unit, pose, block, 1), rotated(unit, pose, block, 2)];
        let depth = p[2] + unit.splat(t.z);
        // A point behind the camera has no weight; its Jacobian must stay finite.
        let inverse = (unit.splat(1.0) / depth).where_positive(depth, unit.zero());
        let (a, d) = (inverse * camera.fx, inverse * camera.fy);
        let (u, v) = ((p[0] + unit.splat(t.x)) * a, (p[1] + unit.splat(t.y)) * d);
        Self { p, depth, inverse, a, d, u, v, du: u - unit.load(block.u), dv: v - unit.load(block.v) }
    }
}

/// One coordinate of the rotated model points.
#[inline(always)]
fn rotated<U: Unit>(unit: U, pose: &Pose, block: &Block, i: usize) -> U::Vector {
    let r = &pose.r;
    unit.load(block.x) * r[(i, 0)] + unit.load(block.y) * r[(i, 1)] + unit.load(block.z) * r[(i, 2)]
}

/// Column and row of four points of the camera frame.
#[inline(always)]
pub(crate) fn centred<U: Unit>(unit: U, camera: &Camera, [x, y, z]: [U::Vector; 3]) -> [U::Vector; 2] {
    let inverse = unit.splat(1.0) / z;
    [x * inverse * camera.fx, y * inverse * camera.fy]
}
