//! Damped iteratively reweighted least squares over pose and shape coefficients: fixed size, no allocation.
//!
//! The unknowns of size `D` are a rotation vector (left perturbation, radians), a translation (metres) and
//! `D - 6` shape coefficients. A step is accepted on the true robust cost, priors included.

use nalgebra::Vector6;

use crate::camera::View;
use crate::loss::{Kernel, tukey};
use crate::math::square;
use crate::noise::{Noise, NoiseModel};
use crate::object::{MAX_MODES, ShapeModel};
use crate::pose::Pose;
use crate::priors::Priors;
use crate::residual::{Block, LANES, Lanes, Projection, point_jacobian, sum};
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

/// Size of the unknowns for a number of modes: few sizes, so that few copies of the code exist. Modes a model
/// does not have get a zero Jacobian and stay zero.
pub(crate) fn padded_modes(modes: usize) -> usize {
    [0, 5, 10].into_iter().find(|&m| modes <= m).unwrap_or(MAX_MODES)
}

/// Limits of the damping factor.
const DAMPING: (f64, f64) = (1e-10, 1e8);
/// Rejected steps in a row before giving up.
const MAX_REJECTIONS: usize = 6;

impl Objective<'_> {
    /// Moves the model points to the shape of a state.
    pub(crate) fn set_shape(&mut self, coefficients: &[f64; MAX_MODES]) {
        for (k, &i) in self.visible.iter().enumerate() {
            let [x, y, z] = self.model.keypoint(i as usize, coefficients);
            let (block, lane) = (&mut self.blocks[k / LANES], k % LANES);
            (block.x[lane], block.y[lane], block.z[lane]) = (x, y, z);
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
        match kernel {
            Kernel::LeastSquares => self.unit.run(|| {
                self.accumulate_pose(
                    state,
                    #[inline(always)]
                    |r2| (0.5 * r2, 1.0),
                    normal,
                )
            }),
            Kernel::Tukey { c2 } => {
                let inverse = 1.0 / c2;
                self.unit.run(|| {
                    self.accumulate_pose(
                        state,
                        #[inline(always)]
                        |r2| tukey(r2, c2, inverse),
                        normal,
                    )
                });
            }
            Kernel::Student { .. } => self.accumulate_pose(state, |r2| kernel.evaluate(r2), normal),
        }
    }

    #[inline(always)]
    fn accumulate_pose<const D: usize>(
        &self,
        state: &State,
        evaluate: impl Fn(f64) -> (f64, f64),
        normal: &mut Normal<D>,
    ) {
        let camera = &self.view.camera;
        let (fx, fy) = (camera.fx, camera.fy);
        let Pose { r, t } = state.pose;
        let mut cost = [0.0; LANES];
        let mut gradient = [[0.0; LANES]; 6];
        let mut h = [[0.0; LANES]; 21];
        for block in &*self.blocks {
            let mut ju = [[0.0; LANES]; 6];
            let mut jv = [[0.0; LANES]; 6];
            let (mut du, mut dv, mut w): (Lanes, Lanes, Lanes) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                let (x, y, z) = (block.x[l], block.y[l], block.z[l]);
                let px = r[(0, 0)] * x + r[(0, 1)] * y + r[(0, 2)] * z;
                let py = r[(1, 0)] * x + r[(1, 1)] * y + r[(1, 2)] * z;
                let pz = r[(2, 0)] * x + r[(2, 1)] * y + r[(2, 2)] * z;
                let depth = pz + t.z;
                // A point behind the camera has no weight; its Jacobian must stay finite.
                let in_front = depth > 0.0;
                let inverse = if in_front { 1.0 / depth } else { 0.0 };
                let (u, v) = (fx * (px + t.x) * inverse, fy * (py + t.y) * inverse);
                du[l] = u - block.u[l];
                dv[l] = v - block.v[l];
                let r2 = if in_front { du[l] * du[l] + dv[l] * dv[l] } else { f64::INFINITY };
                let (rho, weight) = evaluate(r2);
                let active = block.active[l];
                cost[l] += if active > 0.0 { active * rho } else { 0.0 };
                w[l] = if in_front { active * weight } else { 0.0 };
                // gradients of u: (a, 0, b), of v: (0, d, e), by the point in the camera frame
                let (a, b) = (fx * inverse, -u * inverse);
                let (d, e) = (fy * inverse, -v * inverse);
                let columns_u = [py * b, pz * a - px * b, -py * a, a, 0.0, b];
                let columns_v = [py * e - pz * d, -px * e, px * d, 0.0, d, e];
                for k in 0..6 {
                    ju[k][l] = columns_u[k];
                    jv[k][l] = columns_v[k];
                }
            }
            let mut entry = 0;
            for i in 0..6 {
                let (mut wu, mut wv) = ([0.0; LANES], [0.0; LANES]);
                for l in 0..LANES {
                    wu[l] = w[l] * ju[i][l];
                    wv[l] = w[l] * jv[i][l];
                    gradient[i][l] += wu[l] * du[l] + wv[l] * dv[l];
                }
                for j in i..6 {
                    for l in 0..LANES {
                        h[entry][l] += wu[l] * ju[j][l] + wv[l] * jv[j][l];
                    }
                    entry += 1;
                }
            }
        }
        normal.cost = sum(&cost);
        let mut entry = 0;
        for i in 0..6 {
            normal.gradient[i] = sum(&gradient[i]);
            for j in i..6 {
                normal.h[i][j] = sum(&h[entry]);
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
            let active = block.active[lane];
            if active == 0.0 {
                continue;
            }
            let model_point = [block.x[lane], block.y[lane], block.z[lane]];
            let pixel = [block.u[lane], block.v[lane]];
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
                out.copy_from_slice(&squared[..out.len()]);
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
pub(crate) fn add_row<const D: usize>(normal: &mut Normal<D>, j: &[f64; D], residual: f64, weight: f64) {
    for a in 0..D {
        let wa = weight * j[a];
        normal.gradient[a] += wa * residual;
        for b in a..D {
            normal.h[a][b] += wa * j[b];
        }
    }
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
    /// Weight of the `k`-th visible keypoint.
    pub(crate) fn weight(&self, k: usize) -> f64 {
        self.blocks[k / LANES].weight[k % LANES]
    }

    /// Noise of the keypoints, given a pose; leaves the squared residuals in `scratch`.
    pub(crate) fn estimate_noise(&self, pose: &Pose, scratch: &mut [f64]) -> Noise {
        let squared = &mut scratch[..self.visible.len()];
        self.squared_residuals(pose, squared);
        self.noise.estimate(squared.iter().enumerate().map(|(k, &r2)| (r2, self.weight(k))))
    }

    /// Gives every point its own weight, or none when it is further than `tau` pixels from a pose.
    pub(crate) fn activate_within(&mut self, pose: &Pose, tau: f64) {
        let projection = Projection::new(&self.view.camera, pose);
        let tau2 = square(tau);
        for block in &mut *self.blocks {
            let squared = projection.squared_residuals(block);
            for l in 0..LANES {
                block.active[l] = if squared[l] <= tau2 { block.weight[l] } else { 0.0 };
            }
        }
    }
}
