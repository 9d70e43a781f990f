//! Sums over keypoints, four at a time: the robust cost of a pose, its gradient and its normal equations.

use crate::camera::Camera;
use crate::lanes::{Lanes, Unit, Vector};
use crate::loss::{Kernel, tukey_lanes};
use crate::pose::Pose;
use crate::residual::Block;
use crate::sides::{SPEAKS_OF_COLUMN, SPEAKS_OF_ROW, Sides};
use crate::simd::HotLoop;

/// Cost, gradient and normal equations of the six unknowns of a pose.
pub(crate) struct PoseSums {
    pub(crate) cost: f64,
    pub(crate) gradient: [f64; 6],
    /// Upper triangle, row by row.
    pub(crate) h: [f64; 21],
}

/// What a cost is summed over.
pub(crate) struct Summands<'a> {
    pub(crate) blocks: &'a [Block],
    pub(crate) sides: Option<&'a Sides>,
    pub(crate) camera: &'a Camera,
    pub(crate) pose: &'a Pose,
    pub(crate) kernel: Kernel,
}

/// Four points seen from a pose.
struct Projected<V> {
    /// Rotated model points.
    p: [V; 3],
    depth: V,
    /// One over the depth, and the same times the focal lengths; zero behind the camera.
    inverse: V,
    a: V,
    d: V,
    /// Pixels, relative to the principal point, and residuals.
    u: V,
    v: V,
    du: V,
    dv: V,
}

impl Summands<'_> {
    #[inline(always)]
    fn project<U: Unit>(&self, unit: U, block: &Block) -> Projected<U::Vector> {
        let t = &self.pose.t;
        let p = [self.rotated(unit, block, 0), self.rotated(unit, block, 1), self.rotated(unit, block, 2)];
        let depth = p[2] + unit.splat(t.z);
        // A point behind the camera has no weight; its Jacobian must stay finite.
        let inverse = (unit.splat(1.0) / depth).where_positive(depth, unit.zero());
        let (a, d) = (inverse * self.camera.fx, inverse * self.camera.fy);
        let (u, v) = ((p[0] + unit.splat(t.x)) * a, (p[1] + unit.splat(t.y)) * d);
        Projected { p, depth, inverse, a, d, u, v, du: u - unit.load(block.u), dv: v - unit.load(block.v) }
    }

    /// One coordinate of the rotated model points.
    #[inline(always)]
    fn rotated<U: Unit>(&self, unit: U, block: &Block, i: usize) -> U::Vector {
        let r = &self.pose.r;
        unit.load(block.x) * r[(i, 0)] + unit.load(block.y) * r[(i, 1)] + unit.load(block.z) * r[(i, 2)]
    }

    /// Calls `add` with everything that has a residual: where it is, its cost, the weights of its column and row.
    #[inline(always)]
    fn each<U: Unit>(
        &self,
        unit: U,
        evaluate: impl Fn(U::Vector) -> (U::Vector, U::Vector),
        mut add: impl FnMut(Projected<U::Vector>, U::Vector, [U::Vector; 2]),
    ) {
        let (zero, infinity) = (unit.zero(), unit.splat(f64::INFINITY));
        for block in self.blocks {
            let active = unit.load(block.active);
            let q = self.project(unit, block);
            let (rho, weight) = evaluate((q.du * q.du + q.dv * q.dv).where_positive(q.depth, infinity));
            let cost = (rho * active).where_positive(active, zero);
            let w = (weight * active).where_positive(q.depth, zero);
            add(q, cost, [w, w]);
        }
        if let Some(sides) = self.sides {
            let (column, row) = (unit.load(SPEAKS_OF_COLUMN), unit.load(SPEAKS_OF_ROW));
            let known = unit.load(sides.block.weight);
            let q = self.project(unit, &sides.block);
            let r2 = q.du * q.du * column + q.dv * q.dv * row;
            let (rho, weight) = tukey_lanes(unit, r2, sides.c2, 1.0 / sides.c2);
            let w = weight * known * sides.scale;
            add(q, rho * known * sides.scale, [w * column, w * row]);
        }
    }

    /// [`Summands::each`] with the kernel at hand.
    #[inline(always)]
    fn with_kernel<U: Unit>(
        &self,
        unit: U,
        add: impl FnMut(Projected<U::Vector>, U::Vector, [U::Vector; 2]),
    ) {
        match self.kernel {
            Kernel::LeastSquares => {
                let one = unit.splat(1.0);
                self.each(
                    unit,
                    #[inline(always)]
                    |r2| (r2 * 0.5, one),
                    add,
                );
            }
            Kernel::Tukey { c2 } => {
                let inverse = 1.0 / c2;
                self.each(
                    unit,
                    #[inline(always)]
                    |r2| tukey_lanes(unit, r2, c2, inverse),
                    add,
                );
            }
            Kernel::Student { .. } => {
                self.each(
                    unit,
                    #[inline(always)]
                    |r2| {
                        let both = r2.lanes().0.map(|r2| self.kernel.evaluate(r2));
                        (unit.load(Lanes(both.map(|b| b.0))), unit.load(Lanes(both.map(|b| b.1))))
                    },
                    add,
                );
            }
        }
    }
}

/// The cost alone.
pub(crate) struct Cost<'a>(pub(crate) Summands<'a>);

impl HotLoop for Cost<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> f64 {
        let mut sum = unit.zero();
        self.0.with_kernel(
            unit,
            #[inline(always)]
            |_, cost, _| sum += cost,
        );
        sum.sum()
    }
}

/// Cost, gradient and normal equations.
pub(crate) struct Linearise<'a>(pub(crate) Summands<'a>);

impl HotLoop for Linearise<'_> {
    type Output = PoseSums;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> PoseSums {
        let zero = unit.zero();
        let (mut sum, mut gradient, mut h) = (zero, [zero; 6], [zero; 21]);
        self.0.with_kernel(
            unit,
            #[inline(always)]
            |q, cost, w| {
                sum += cost;
                add_rows(unit, &q, w, &mut gradient, &mut h);
            },
        );
        let mut sums = PoseSums { cost: sum.sum(), gradient: [0.0; 6], h: [0.0; 21] };
        for (total, lanes) in sums.gradient.iter_mut().zip(gradient) {
            *total = lanes.sum();
        }
        for (total, lanes) in sums.h.iter_mut().zip(h) {
            *total = lanes.sum();
        }
        sums
    }
}

/// Adds the two rows of the Jacobian of four points to gradient and normal equations.
#[inline(always)]
fn add_rows<U: Unit>(
    unit: U,
    q: &Projected<U::Vector>,
    [wc, wr]: [U::Vector; 2],
    gradient: &mut [U::Vector; 6],
    h: &mut [U::Vector; 21],
) {
    let zero = unit.zero();
    let ([px, py, pz], du, dv) = (q.p, q.du, q.dv);
    // Gradients by the point in the camera frame: (a, 0, b) of u and (0, d, e) of v.
    let (a, d) = (q.a, q.d);
    let (b, e) = (zero - q.u * q.inverse, zero - q.v * q.inverse);
    // Rows of the Jacobian: rotation (P x gradient), then translation without its zeros.
    let ju = [py * b, pz * a - px * b, zero - py * a];
    let jv = [py * e - pz * d, zero - px * e, px * d];
    let (wu, wv) = ([wc * ju[0], wc * ju[1], wc * ju[2]], [wr * jv[0], wr * jv[1], wr * jv[2]]);
    let (wa, wb, wd, we) = (wc * a, wc * b, wr * d, wr * e);
    for k in 0..3 {
        gradient[k] += wu[k] * du + wv[k] * dv;
    }
    gradient[3] += wa * du;
    gradient[4] += wd * dv;
    gradient[5] += wb * du + we * dv;
    h[0] += wu[0] * ju[0] + wv[0] * jv[0];
    h[1] += wu[0] * ju[1] + wv[0] * jv[1];
    h[2] += wu[0] * ju[2] + wv[0] * jv[2];
    h[3] += wu[0] * a;
    h[4] += wv[0] * d;
    h[5] += wu[0] * b + wv[0] * e;
    h[6] += wu[1] * ju[1] + wv[1] * jv[1];
    h[7] += wu[1] * ju[2] + wv[1] * jv[2];
    h[8] += wu[1] * a;
    h[9] += wv[1] * d;
    h[10] += wu[1] * b + wv[1] * e;
    h[11] += wu[2] * ju[2] + wv[2] * jv[2];
    h[12] += wu[2] * a;
    h[13] += wv[2] * d;
    h[14] += wu[2] * b + wv[2] * e;
    h[15] += wa * a;
    // h[16], between the translations along x and y, is zero
    h[17] += wa * b;
    h[18] += wd * d;
    h[19] += wd * e;
    h[20] += wb * b + we * e;
}
