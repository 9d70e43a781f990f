//! The cost of one object: keypoints under a robust kernel, and priors; with its normal equations.

use crate::camera::{Camera, View};
use crate::lanes::{LANES, Lanes};
use crate::loss::{Kernel, tukey_lanes};
use crate::math::square;
use crate::noise::{Noise, NoiseModel};
use crate::normal::{Normal, State, add_row};
use crate::object::{MAX_MODES, ShapeModel};
use crate::pose::Pose;
use crate::priors::{PriorTerms, Priors};
use crate::residual::{Block, Projection, point_jacobian};
use crate::simd::VectorUnit;

/// Everything a cost is made of, besides the state and the kernel.
pub(crate) struct Objective<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) view: &'a View,
    pub(crate) model: &'a ShapeModel<'a>,
    pub(crate) visible: &'a [u32],
    pub(crate) blocks: &'a mut [Block],
    pub(crate) priors: Priors,
    pub(crate) noise: NoiseModel,
}

/// Sums over points, lane by lane.
#[derive(Default)]
struct PoseSums {
    cost: Lanes,
    gradient: [Lanes; 6],
    /// Upper triangle, row by row.
    h: [Lanes; 21],
}

/// Cost, gradient and normal equations of the pose over blocks of points.
#[inline(always)]
fn accumulate_pose(
    blocks: &[Block],
    camera: &Camera,
    r: [[f64; 3]; 3],
    t: [f64; 3],
    evaluate: impl Fn(Lanes) -> (Lanes, Lanes),
) -> PoseSums {
    let mut sums = PoseSums::default();
    for block in blocks {
        let row = |i: usize| block.x * r[i][0] + block.y * r[i][1] + block.z * r[i][2];
        let (px, py, pz) = (row(0), row(1), row(2));
        let depth = pz + Lanes::splat(t[2]);
        // A point behind the camera has no weight; its Jacobian must stay finite.
        let inverse = depth.reciprocal().where_positive(depth, 0.0);
        // Gradients by the point in the camera frame: (a, 0, b) of u and (0, d, e) of v.
        let (a, d) = (inverse * camera.fx, inverse * camera.fy);
        let (u, v) = ((px + Lanes::splat(t[0])) * a, (py + Lanes::splat(t[1])) * d);
        let zero = Lanes::default();
        let (b, e) = (zero - u * inverse, zero - v * inverse);
        let (du, dv) = (u - block.u, v - block.v);
        let r2 = (du * du + dv * dv).where_positive(depth, f64::INFINITY);
        let (rho, weight) = evaluate(r2);
        sums.cost += (rho * block.active).where_positive(block.active, 0.0);
        let w = (weight * block.active).where_positive(depth, 0.0);
        // Rows of the Jacobian: rotation (P x gradient), then translation without its zeros.
        let ju = [py * b, pz * a - px * b, zero - py * a];
        let jv = [py * e - pz * d, zero - px * e, px * d];
        let (wu, wv) = (ju.map(|j| w * j), jv.map(|j| w * j));
        let (wa, wb, wd, we) = (w * a, w * b, w * d, w * e);
        for k in 0..3 {
            sums.gradient[k] += wu[k] * du + wv[k] * dv;
        }
        sums.gradient[3] += wa * du;
        sums.gradient[4] += wd * dv;
        sums.gradient[5] += wb * du + we * dv;
        let h = &mut sums.h;
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
    sums
}

impl Objective<'_> {
    /// Moves the model points to the shape of a state; a rigid model has one shape.
    pub(crate) fn set_shape(&mut self, coefficients: &[f64; MAX_MODES]) {
        if self.model.eigenvalues().is_empty() {
            return;
        }
        for (k, &i) in self.visible.iter().enumerate() {
            let [x, y, z] = self.model.keypoint(i as usize, coefficients);
            let (block, lane) = (&mut self.blocks[k / LANES], k % LANES);
            (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = (x, y, z);
        }
    }

    /// Normal equations and cost at a state. The blocks must hold the state's shape.
    pub(crate) fn linearise<const D: usize>(&self, state: &State, kernel: Kernel) -> Normal<D> {
        let mut normal = Normal { h: [[0.0; D]; D], gradient: [0.0; D], cost: 0.0 };
        if D == 6 {
            self.add_points_pose(state, kernel, &mut normal);
        } else {
            self.add_points_joint(state, kernel, &mut normal);
        }
        self.prior_terms().add(state, &mut normal);
        for i in 0..D {
            for j in 0..i {
                normal.h[i][j] = normal.h[j][i];
            }
        }
        normal
    }

    fn prior_terms(&self) -> PriorTerms<'_> {
        PriorTerms { priors: &self.priors, view: self.view, model: self.model }
    }

    /// Cost of the priors alone (pixels squared, halved).
    pub(crate) fn prior_cost(&self, state: &State) -> f64 {
        self.prior_terms().cost(state)
    }

    /// The six unknowns of the pose, [`LANES`] points at a time.
    fn add_points_pose<const D: usize>(&self, state: &State, kernel: Kernel, normal: &mut Normal<D>) {
        let Pose { r, t } = state.pose;
        let camera = &self.view.camera;
        let rows = [0, 1, 2].map(|i| [r[(i, 0)], r[(i, 1)], r[(i, 2)]]);
        let accumulated = match kernel {
            Kernel::LeastSquares => self.unit.run(
                #[inline(always)]
                || accumulate_pose(self.blocks, camera, rows, t.into(), |r2| (r2 * 0.5, Lanes::splat(1.0))),
            ),
            Kernel::Tukey { c2 } => {
                let inverse = 1.0 / c2;
                self.unit.run(
                    #[inline(always)]
                    || accumulate_pose(self.blocks, camera, rows, t.into(), |r2| tukey_lanes(r2, c2, inverse)),
                )
            }
            Kernel::Student { .. } => accumulate_pose(self.blocks, camera, rows, t.into(), |r2| {
                let both = r2.0.map(|r2| kernel.evaluate(r2));
                (Lanes(both.map(|b| b.0)), Lanes(both.map(|b| b.1)))
            }),
        };
        normal.cost = accumulated.cost.sum();
        let mut entry = 0;
        for i in 0..6 {
            normal.gradient[i] = accumulated.gradient[i].sum();
            for j in i..6 {
                normal.h[i][j] = accumulated.h[entry].sum();
                entry += 1;
            }
        }
    }

    /// Pose and shape together, point by point.
    fn add_points_joint<const D: usize>(&self, state: &State, kernel: Kernel, normal: &mut Normal<D>) {
        let camera = &self.view.camera;
        let modes = self.model.eigenvalues().len();
        for (k, &index) in self.visible.iter().enumerate() {
            let (block, lane) = (&self.blocks[k / LANES], k % LANES);
            let active = block.active.0[lane];
            if active == 0.0 {
                continue;
            }
            let model_point = [block.x.0[lane], block.y.0[lane], block.z.0[lane]];
            let pixel = [block.u.0[lane], block.v.0[lane]];
            let Some(jacobian) = point_jacobian(camera, &state.pose, model_point, pixel) else {
                normal.cost += active * kernel.evaluate(f64::INFINITY).0;
                continue;
            };
            let r2 = square(jacobian.residual[0]) + square(jacobian.residual[1]);
            let (rho, weight) = kernel.evaluate(r2);
            let weight = active * weight;
            normal.cost += active * rho;
            if weight == 0.0 {
                continue;
            }
            for row in 0..2 {
                let mut j = [0.0; D];
                j[..6].copy_from_slice(&jacobian.pose[row]);
                let [gx, gy, gz] = jacobian.point[row];
                for m in 0..modes {
                    let [bx, by, bz] = self.model.basis(m, index as usize);
                    j[6 + m] = gx * bx + gy * by + gz * bz;
                }
                add_row(normal, &j, jacobian.residual[row], weight);
            }
        }
    }

    /// Squared residuals of the visible keypoints, in their order.
    pub(crate) fn squared_residuals(&self, pose: &Pose, out: &mut [f64]) {
        let projection = Projection::new(&self.view.camera, pose);
        self.unit.run(|| {
            for (block, out) in self.blocks.iter().zip(out.chunks_mut(LANES)) {
                let squared = projection.squared_residuals(block);
                out.copy_from_slice(&squared.0[..out.len()]);
            }
        });
    }

    /// Noise of the keypoints, given a pose; leaves the squared residuals in the blocks.
    pub(crate) fn estimate_noise(&mut self, pose: &Pose) -> Noise {
        let projection = Projection::new(&self.view.camera, pose);
        self.unit.run(
            #[inline(always)]
            || self.blocks.iter_mut().for_each(|block| block.r2 = projection.squared_residuals(block)),
        );
        self.noise.estimate(self.unit, self.blocks)
    }

    /// Squared residual and weight of every visible keypoint, after [`Objective::estimate_noise`].
    pub(crate) fn measured(&self) -> impl Iterator<Item = (f64, f64)> + Clone {
        let pairs = self.blocks.iter().flat_map(|block| (0..LANES).map(|l| (block.r2.0[l], block.weight.0[l])));
        pairs.take(self.visible.len())
    }

    /// Gives every point its own weight, or none when it is further than `tau` pixels from a pose.
    pub(crate) fn activate_within(&mut self, pose: &Pose, tau: f64) {
        let projection = Projection::new(&self.view.camera, pose);
        let tau2 = square(tau);
        for block in &mut *self.blocks {
            let squared = projection.squared_residuals(block);
            for l in 0..LANES {
                block.active.0[l] = if squared.0[l] <= tau2 { block.weight.0[l] } else { 0.0 };
            }
        }
    }

    /// Gives every point its own weight.
    pub(crate) fn activate_all(&mut self) {
        for block in &mut *self.blocks {
            block.active = block.weight;
        }
    }
}
