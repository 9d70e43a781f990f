//! Damped iteratively reweighted least squares over pose and shape coefficients: fixed size, no allocation.
//!
//! The unknowns of size `D` are a rotation vector (left perturbation, radians), a translation (metres) and
//! `D - 6` shape coefficients. A step is accepted on the true robust cost, priors included.

use nalgebra::Vector6;

use crate::camera::{Camera, View};
use crate::lanes::{LANES, Lanes};
use crate::loss::{Kernel, tukey_lanes};
use crate::math::square;
use crate::noise::{Noise, NoiseModel};
use crate::object::{MAX_MODES, ShapeModel};
use crate::pose::Pose;
use crate::priors::Priors;
use crate::residual::{Block, Projection, point_jacobian};
use crate::simd::VectorUnit;

/// Pose and shape coefficients.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State {
    pub(crate) pose: Pose,
    pub(crate) coefficients: [f64; MAX_MODES],
}

/// Normal equations at a state, and the cost there.
pub(crate) struct Normal<const D: usize> {
    pub(crate) h: [[f64; D]; D],
    pub(crate) gradient: [f64; D],
    pub(crate) cost: f64,
}

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

/// Size of the unknowns for a number of modes: few sizes, so that few copies of the code exist. Modes a model
/// does not have get a zero Jacobian and stay zero.
pub(crate) fn padded_modes(modes: usize) -> usize {
    [0, 5].into_iter().find(|&m| modes <= m).unwrap_or(MAX_MODES)
}

/// Limits of the damping factor.
const DAMPING: (f64, f64) = (1e-10, 1e8);
/// Rejected steps in a row before giving up.
const MAX_REJECTIONS: usize = 6;

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
        self.add_priors(state, &mut normal);
        for i in 0..D {
            for j in 0..i {
                normal.h[i][j] = normal.h[j][i];
            }
        }
        normal
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

    /// Robust cost and normal equations are minimised from `state` with a fixed kernel for at most
    /// `max_iterations` steps, or until the cost falls by less than `tolerance` of itself.
    /// `kernel_at` gives the kernel after each accepted step (the scale may follow the residuals).
    pub(crate) fn minimise<const D: usize>(
        &mut self,
        state: &mut State,
        max_iterations: usize,
        tolerance: f64,
        mut kernel_at: impl FnMut(&Self, &State) -> Kernel,
    ) -> (f64, usize) {
        if D > 6 {
            self.set_shape(&state.coefficients);
        }
        let mut kernel = kernel_at(self, state);
        let mut normal = self.linearise::<D>(state, kernel);
        let (mut damping, mut rejections) = (1e-6, 0);
        for iteration in 0..max_iterations {
            let Some(step) = solve_damped(&normal, damping) else {
                damping = (damping * 100.0).min(DAMPING.1);
                rejections += 1;
                if rejections > MAX_REJECTIONS {
                    return (normal.cost, iteration);
                }
                continue;
            };
            let trial = state.moved(&step);
            if D > 6 {
                self.set_shape(&trial.coefficients);
            }
            let mut next = self.linearise::<D>(&trial, kernel);
            if next.cost < normal.cost {
                let decrease = normal.cost - next.cost;
                let converged = decrease <= tolerance * normal.cost;
                *state = trial;
                rejections = 0;
                damping = (damping * 0.1).max(DAMPING.0);
                let next_kernel = kernel_at(self, state);
                let kernel_settled = next_kernel == kernel;
                if !kernel_settled {
                    kernel = next_kernel;
                    next = self.linearise::<D>(state, kernel);
                }
                normal = next;
                if converged {
                    return (normal.cost, iteration + 1);
                }
            } else {
                if D > 6 {
                    self.set_shape(&state.coefficients);
                }
                // No step can lower the cost: rounding, or a minimum.
                let predicted: f64 = (0..D).map(|i| -step[i] * normal.gradient[i]).sum();
                rejections += 1;
                damping = (damping * 10.0).min(DAMPING.1);
                if predicted <= tolerance * normal.cost || rejections > MAX_REJECTIONS {
                    return (normal.cost, iteration + 1);
                }
            }
        }
        (normal.cost, max_iterations)
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
}

impl State {
    fn moved<const D: usize>(&self, step: &[f64; D]) -> Self {
        let pose = self.pose.perturbed(&Vector6::from_column_slice(&step[..6]));
        let mut coefficients = self.coefficients;
        for m in 0..D - 6 {
            coefficients[m] += step[6 + m];
        }
        Self { pose, coefficients }
    }
}

/// Adds one weighted row to the upper triangle of the normal equations.
#[inline(always)]
fn add_row<const D: usize, const N: usize>(normal: &mut Normal<D>, j: &[f64; N], residual: f64, weight: f64) {
    for a in 0..N {
        let wa = weight * j[a];
        normal.gradient[a] += wa * residual;
        for b in a..N {
            normal.h[a][b] += wa * j[b];
        }
    }
}

/// Adds a row that does not depend on the shape.
#[inline]
pub(crate) fn add_pose_row<const D: usize>(normal: &mut Normal<D>, j: &[f64; 6], residual: f64, weight: f64) {
    add_row(normal, j, residual, weight);
}

/// `-(H + damping diag(H))^-1 gradient`; `None` when the matrix is not positive definite.
fn solve_damped<const D: usize>(normal: &Normal<D>, damping: f64) -> Option<[f64; D]> {
    let mut h = normal.h;
    for i in 0..D {
        h[i][i] += damping * h[i][i];
    }
    cholesky(&mut h)?;
    let mut x = normal.gradient.map(|g| -g);
    solve_cholesky(&h, &mut x);
    x.iter().all(|x| x.is_finite()).then_some(x)
}

/// Lower Cholesky factor in place, with inverse diagonal; `None` when the matrix is not positive definite.
pub(crate) fn cholesky<const D: usize>(h: &mut [[f64; D]; D]) -> Option<()> {
    for j in 0..D {
        let scale = h[j][j];
        let mut pivot = h[j][j];
        for k in 0..j {
            pivot -= h[j][k] * h[j][k];
        }
        // Relative to the diagonal: a direction the data says nothing about.
        if !(pivot > 1e-14 * scale) {
            return None;
        }
        let inverse = 1.0 / crate::math::sqrt(pivot);
        for i in j + 1..D {
            let mut s = h[i][j];
            for k in 0..j {
                s -= h[i][k] * h[j][k];
            }
            h[i][j] = s * inverse;
        }
        h[j][j] = inverse;
    }
    Some(())
}

/// Solves `L L^T x = b` in place with the factor of [`cholesky`].
pub(crate) fn solve_cholesky<const D: usize>(l: &[[f64; D]; D], x: &mut [f64; D]) {
    for i in 0..D {
        let mut s = x[i];
        for k in 0..i {
            s -= l[i][k] * x[k];
        }
        x[i] = s * l[i][i];
    }
    for i in (0..D).rev() {
        let mut s = x[i];
        for k in i + 1..D {
            s -= l[k][i] * x[k];
        }
        x[i] = s * l[i][i];
    }
}

impl Objective<'_> {
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
