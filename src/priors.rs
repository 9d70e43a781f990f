//! What is known besides the keypoints, weighed against their noise: the ground, the class, the 2D box.

use nalgebra::Vector3;

use crate::lm::{Normal, Objective, State, add_row};
use crate::loss::Kernel;
use crate::math::square;
use crate::object::MAX_MODES;
use crate::residual::point_jacobian;

/// Priors of one object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Priors {
    /// Standard deviation of a keypoint's coordinate, pixels: what the others are weighed against.
    pub(crate) noise_sigma: f64,
    /// Standard deviation of the object's up axis about the ground's normal, radians; infinite: no prior.
    pub(crate) tilt_sigma: f64,
    /// Whether the shape coefficients have the model's eigenvalues as variances.
    pub(crate) shape: bool,
    /// Known sides of the 2D box (left, top, right, bottom) relative to the principal point; NaN: unknown.
    pub(crate) bbox: [f64; 4],
    /// Whether the box takes part in the current stage.
    pub(crate) use_bbox: bool,
    /// Standard deviation of a side, pixels; infinite: no prior.
    pub(crate) bbox_sigma: f64,
}

/// Tails of the tilt prior: nearly Gaussian inside, forgiving for a tilt that is wrong for the whole frame.
const TILT_DOF: f64 = 8.0;
/// Standard deviations at which a side of the box loses its say: detectors' boxes have heavy tails, and the box of a
/// hidden object ends anywhere.
const BBOX_CUT: f64 = 4.0;

impl Objective<'_> {
    /// Adds the priors to normal equations and cost.
    pub(crate) fn add_priors<const D: usize>(&self, state: &State, normal: &mut Normal<D>) {
        self.add_tilt_prior(state, normal);
        self.add_shape_prior(state, normal);
        self.add_bbox_prior(state, normal);
    }

    /// Cost of the priors alone.
    pub(crate) fn prior_cost(&self, state: &State) -> f64 {
        let mut normal = Normal { h: [[0.0; 6 + MAX_MODES]; 6 + MAX_MODES], gradient: [0.0; 6 + MAX_MODES], cost: 0.0 };
        self.add_priors(state, &mut normal);
        normal.cost
    }

    /// Two residuals: the components of the object's down axis along the ground's x and z axes, which are zero
    /// for an upright object.
    fn add_tilt_prior<const D: usize>(&self, state: &State, normal: &mut Normal<D>) {
        let p = &self.priors;
        if p.tilt_sigma.is_infinite() {
            return;
        }
        let down: Vector3<f64> = state.pose.r.column(1).into();
        let r = &self.view.r_camera_from_ground;
        let axes: [Vector3<f64>; 2] = [r.column(0).into(), r.column(2).into()];
        let q = axes.map(|axis| axis.dot(&down));
        let s2 = square(p.tilt_sigma);
        let (rho, weight) = Kernel::Student { s2, dof: TILT_DOF }.evaluate(square(q[0]) + square(q[1]));
        // In units of the pixel cost: (noise / sigma)^2 q^2 / 2.
        let scale = square(p.noise_sigma) / s2;
        normal.cost += scale * rho;
        for k in 0..2 {
            let w = down.cross(&axes[k]);
            let mut j = [0.0; D];
            j[..3].copy_from_slice(w.as_slice());
            add_row(normal, &j, q[k], scale * weight);
        }
    }

    /// Coefficients with the eigenvalues as variances.
    fn add_shape_prior<const D: usize>(&self, state: &State, normal: &mut Normal<D>) {
        let eigenvalues = self.model.eigenvalues();
        for m in 0..D - 6 {
            match eigenvalues.get(m) {
                // A padded mode: any curvature keeps it at zero.
                None => normal.h[6 + m][6 + m] = 1.0,
                Some(&variance) if self.priors.shape => {
                    let precision = square(self.priors.noise_sigma) / variance;
                    let lambda = state.coefficients[m];
                    normal.cost += 0.5 * precision * lambda * lambda;
                    normal.gradient[6 + m] += precision * lambda;
                    normal.h[6 + m][6 + m] += precision;
                }
                Some(_) => {}
            }
        }
    }

    /// Up to four residuals: the extent of the projected 3D box against the known sides of the 2D box.
    fn add_bbox_prior<const D: usize>(&self, state: &State, normal: &mut Normal<D>) {
        let p = &self.priors;
        if !p.use_bbox || p.bbox_sigma.is_infinite() {
            return;
        }
        let camera = &self.view.camera;
        let pose = &state.pose;
        let [min, max] = self.model.bbox_3d();
        // For each side the outermost corner and its coordinate (negated for right and bottom).
        let mut outermost = [(f64::INFINITY, [0.0; 3]); 4];
        for &[x, z] in self.model.footprint().corners() {
            for y in [min[1], max[1]] {
                let corner = [x, y, z];
                let point = pose.transform(corner);
                if point.z <= 0.0 {
                    return;
                }
                let (u, v) = (camera.fx * point.x / point.z, camera.fy * point.y / point.z);
                for (side, coordinate) in [u, v, -u, -v].into_iter().enumerate() {
                    if coordinate < outermost[side].0 {
                        outermost[side] = (coordinate, corner);
                    }
                }
            }
        }
        let s2 = square(p.bbox_sigma);
        let scale = square(p.noise_sigma) / s2;
        for (side, (coordinate, corner)) in outermost.into_iter().enumerate() {
            let observed = p.bbox[side];
            if observed.is_nan() {
                continue;
            }
            let residual = if side < 2 { coordinate } else { -coordinate } - observed;
            let (rho, weight) = Kernel::Tukey { c2: square(BBOX_CUT) * s2 }.evaluate(square(residual));
            normal.cost += scale * rho;
            if let Some(jacobian) = point_jacobian(camera, pose, corner, [0.0; 2]) {
                let mut j = [0.0; D];
                j[..6].copy_from_slice(&jacobian.pose[side % 2]);
                add_row(normal, &j, residual, scale * weight);
            }
        }
    }
}
