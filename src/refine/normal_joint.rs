//! Sums over keypoints, four at a time, for pose and shape together.
//!
//! The pose's part is that of [`crate::refine::normal_pose`]. For the shape, a few blocks are weighed at a time by the
//! kernel, of which there are several, and then summed by code of which there is one; of what is symmetric one half is
//! summed.

use nalgebra::Matrix3;

use crate::refine::modes::{Modes, Row, load};
use crate::refine::normal::Normal;
use crate::refine::normal_pose::{SUMS, Summands, add_points, add_up, put_in_order};
use crate::simd::blocks::Block;
use crate::simd::dispatch::HotLoop;
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};
use crate::simd::projection::Projected;

/// Blocks that are weighed at a time; the last time the sides of the box with them.
const BLOCKS: usize = 4;
const HELD: usize = BLOCKS + 1;

/// Cost, gradient and normal equations of the pose and at most `M` coefficients of a shape.
///
/// `P` is [`padded_pairs`] of `M`: Rust cannot say so of a constant yet.
pub(crate) struct LineariseJoint<'a, const D: usize, const M: usize, const P: usize> {
    pub(crate) summands: Summands<'a>,
    pub(crate) modes: Modes<'a>,
    /// 3D box of the shape, and how it moves in each mode (none: not at all): the sides of the 2D box speak of it.
    pub(crate) bbox_3d: [[f64; 3]; 2],
    pub(crate) bbox_basis: &'a [[[f64; 3]; 2]],
    pub(crate) normal: &'a mut Normal<D>,
}

impl<const D: usize, const M: usize, const P: usize> HotLoop for LineariseJoint<'_, D, M, P> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) {
        let (zero, count) = (unit.zero(), self.modes.count().min(M));
        let (mut pose, mut shape) = ([zero; SUMS], ShapeSums::<_, M, P>::new(zero));
        let two = [zero; 2];
        let mut held = [Point { weights: two, residuals: two, p: [zero; 3], a: zero, b: zero, d: zero, e: zero }; HELD];
        let groups = self.summands.blocks.chunks(BLOCKS);
        let last = groups.len();
        for (group, blocks) in (1..).zip(groups) {
            let sides = if group == last { self.summands.sides } else { None };
            let mut free = held.iter_mut();
            Summands { blocks, sides, ..self.summands }.each(
                unit,
                #[inline(always)]
                |q, cost, w| {
                    pose[SUMS - 1] += cost;
                    add_points(&q, w, &mut pose);
                    if let Some(place) = free.next() {
                        *place = Point::new(&q, w);
                    }
                },
            );
            let r = &self.summands.pose.r;
            for (k, point) in held.iter().take(blocks.len()).enumerate() {
                let (made, number) = (&mut None, (group - 1) * BLOCKS + k);
                shape.add(unit, point, &point.object_gradients(r), self.modes.of_block(number, made));
            }
            if let (Some(sides), Some(point)) = (sides, held.get(blocks.len())) {
                let moved = self.corners_moved(unit, &sides.block);
                shape.add(unit, point, &point.object_gradients(r), &moved[..count]);
            }
        }
        put_in_order(&add_up(&pose), self.normal);
        shape.put_in_order(count, self.normal);
    }
}

impl<const D: usize, const M: usize, const P: usize> LineariseJoint<'_, D, M, P> {
    /// How corners of the box that touch its sides move in each mode: with the ends between which they are.
    #[inline(always)]
    fn corners_moved<U: Unit>(&self, unit: U, corners: &Block) -> [Row; M] {
        let [min, max] = self.bbox_3d;
        let corners = [corners.x, corners.y, corners.z];
        let mut moved = [[Lanes::splat(0.0); 3]; M];
        for axis in 0..3 {
            let inverse = 1.0 / (max[axis] - min[axis]);
            let place = (unit.load(corners[axis]) - unit.splat(min[axis])) * inverse;
            for (moved, [min, max]) in moved.iter_mut().zip(self.bbox_basis) {
                moved[axis] = (place * (max[axis] - min[axis]) + unit.splat(min[axis])).lanes();
            }
        }
        moved
    }
}

/// What is held of four points.
#[derive(Clone, Copy)]
struct Point<V> {
    /// Weights of column and row.
    weights: [V; 2],
    residuals: [V; 2],
    /// Rotated model point.
    p: [V; 3],
    /// Gradients by the point in the camera frame: (a, 0, -b) and (0, d, -e).
    a: V,
    b: V,
    d: V,
    e: V,
}

impl<V: Vector> Point<V> {
    #[inline(always)]
    fn new(q: &Projected<V>, weights: [V; 2]) -> Self {
        let (b, e) = (q.u * q.inverse, q.v * q.inverse);
        Self { weights, residuals: [q.du, q.dv], p: q.p, a: q.a, b, d: q.d, e }
    }

    /// Gradients of column and row by the model point.
    #[inline(always)]
    fn object_gradients(&self, r: &Matrix3<f64>) -> [[V; 3]; 2] {
        let (mut column, mut row) = ([self.a; 3], [self.d; 3]);
        for axis in 0..3 {
            column[axis] = self.a * r[(0, axis)] - self.b * r[(2, axis)];
            row[axis] = self.d * r[(1, axis)] - self.e * r[(2, axis)];
        }
        [column, row]
    }
}

/// Of a mode: its gradient, its products with rotation and translation, up to the signs of
/// [`ShapeSums::put_in_order`].
const SUMS_OF_MODE: usize = 8;

/// Where the pairs of a mode with those up to it begin.
const fn first_pair(mode: usize) -> usize {
    mode * (mode + 1) / 2
}

/// Pairs of so many modes, in whole vectors.
pub(crate) const fn padded_pairs(modes: usize) -> usize {
    first_pair(modes).next_multiple_of(LANES)
}

/// Sums for the coefficients.
struct ShapeSums<V, const M: usize, const P: usize> {
    modes: [[V; SUMS_OF_MODE]; M],
    /// Of every mode with those up to it, in whole vectors.
    pairs: [V; P],
}

impl<V: Vector, const M: usize, const P: usize> ShapeSums<V, M, P> {
    #[inline(always)]
    fn new(zero: V) -> Self {
        Self { modes: [[zero; SUMS_OF_MODE]; M], pairs: [zero; P] }
    }

    /// Adds four points with their gradients by the model point, and what they move by in each mode.
    #[inline(always)]
    fn add<U: Unit<Vector = V>>(&mut self, unit: U, point: &Point<V>, [gu, gv]: &[[V; 3]; 2], modes: &[Row]) {
        let [px, py, pz] = point.p;
        let mut rows = [[unit.zero(); 2]; M];
        for mode in 0..M {
            // A loop of known length with an exit is unrolled: what is held of the modes before stays in registers.
            let Some(row) = modes.get(mode) else { break };
            let [x, y, z] = load(unit, row);
            let (u, v) = (gu[0] * x + gu[1] * y + gu[2] * z, gv[0] * x + gv[1] * y + gv[2] * z);
            rows[mode] = [u, v];
            let (wu, wv) = (u * point.weights[0], v * point.weights[1]);
            let (x, y, z) = (wu * point.a, wv * point.d, wu * point.b + wv * point.e);
            let sums = &mut self.modes[mode];
            sums[0] += wu * point.residuals[0] + wv * point.residuals[1];
            sums[1] += py * z + pz * y;
            sums[2] += pz * x + px * z;
            sums[3] += px * y - py * x;
            sums[4] += x;
            sums[5] += y;
            sums[6] += z;
            for (sum, [u, v]) in self.pairs[first_pair(mode)..].iter_mut().zip(&rows[..=mode]) {
                *sum += wu * *u + wv * *v;
            }
        }
    }

    /// The sums with their signs, where they belong.
    #[inline(always)]
    fn put_in_order<const D: usize>(&self, modes: usize, normal: &mut Normal<D>) {
        let pairs = add_up(&self.pairs);
        for mode in 0..modes {
            let [gradient, rx, ry, rz, x, y, z, _] = add_up(&self.modes[mode]);
            normal.gradient[6 + mode] = gradient;
            for (unknown, product) in [-rx, ry, rz, x, y, -z].into_iter().enumerate() {
                normal.h[unknown][6 + mode] = product;
            }
            for other in 0..=mode {
                normal.h[6 + other][6 + mode] = pairs[first_pair(mode) + other];
            }
        }
    }
}
