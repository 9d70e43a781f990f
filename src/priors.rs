//! What is known besides the keypoints, weighed against their noise: the ground, the class, the 2D box.

use nalgebra::Vector3;

use crate::camera::View;
use crate::loss::Kernel;
use crate::math::square;
use crate::normal::{Normal, State, add_pose_row, add_row};
use crate::object::ShapeModel;
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

/// Priors and what they speak of.
pub(crate) struct PriorTerms<'a> {
    pub(crate) priors: &'a Priors,
    pub(crate) view: &'a View,
    pub(crate) model: &'a ShapeModel<'a>,
}

impl PriorTerms<'_> {
    /// Adds all of them to normal equations and cost.
    pub(crate) fn add<const D: usize>(&self, state: &State, normal: &mut Normal<D>) {
        let sides = self.bbox_residuals(state);
        normal.cost += self.cost_with(state, &sides);
        self.add_tilt_rows(state, normal);
        self.add_shape_rows(state, normal);
        self.add_bbox_rows(state, &sides, normal);
    }

    /// Their cost (pixels squared, halved).
    pub(crate) fn cost(&self, state: &State) -> f64 {
        self.cost_with(state, &self.bbox_residuals(state))
    }

    fn cost_with(&self, state: &State, sides: &[Option<Side>; 4]) -> f64 {
        let p = self.priors;
        let tilt = self.tilt_kernel().map_or(0.0, |(kernel, scale)| scale * kernel.evaluate(self.tilt(state).norm2).0);
        let bbox = self.bbox_kernel().map_or(0.0, |(kernel, scale)| {
            sides.iter().flatten().map(|side| scale * kernel.evaluate(square(side.residual)).0).sum()
        });
        let precision = if p.shape { square(p.noise_sigma) } else { 0.0 };
        let coefficients = self.model.eigenvalues().iter().zip(&state.coefficients);
        let shape: f64 = coefficients.map(|(variance, lambda)| 0.5 * precision * square(*lambda) / variance).sum();
        tilt + bbox + shape
    }

    /// Kernel of the tilt prior, and its weight in units of the pixel cost: `(noise / sigma)^2`.
    fn tilt_kernel(&self) -> Option<(Kernel, f64)> {
        let p = self.priors;
        let s2 = square(p.tilt_sigma);
        s2.is_finite().then(|| (Kernel::Student { s2, dof: TILT_DOF }, square(p.noise_sigma) / s2))
    }

    /// Components of the object's down axis along the ground's x and z axes: zero for an upright object.
    fn tilt(&self, state: &State) -> Tilted {
        let down: Vector3<f64> = state.pose.r.column(1).into();
        let r = &self.view.r_camera_from_ground;
        let axes: [Vector3<f64>; 2] = [r.column(0).into(), r.column(2).into()];
        let q = axes.map(|axis| axis.dot(&down));
        Tilted { down, axes, q, norm2: square(q[0]) + square(q[1]) }
    }

    fn add_tilt_rows<const D: usize>(&self, state: &State, normal: &mut Normal<D>) {
        let Some((kernel, scale)) = self.tilt_kernel() else { return };
        let tilted = self.tilt(state);
        let weight = scale * kernel.evaluate(tilted.norm2).1;
        for (axis, q) in tilted.axes.iter().zip(tilted.q) {
            let w = tilted.down.cross(axis);
            add_pose_row(normal, &[w.x, w.y, w.z, 0.0, 0.0, 0.0], q, weight);
        }
    }

    /// Coefficients with the eigenvalues as variances.
    fn add_shape_rows<const D: usize>(&self, state: &State, normal: &mut Normal<D>) {
        let eigenvalues = self.model.eigenvalues();
        for m in 0..D - 6 {
            match eigenvalues.get(m) {
                // A padded mode: any curvature keeps it at zero.
                None => normal.h[6 + m][6 + m] = 1.0,
                Some(&variance) if self.priors.shape => {
                    let precision = square(self.priors.noise_sigma) / variance;
                    normal.gradient[6 + m] += precision * state.coefficients[m];
                    normal.h[6 + m][6 + m] += precision;
                }
                Some(_) => {}
            }
        }
    }

    /// Kernel of a side of the box, and its weight in units of the pixel cost.
    fn bbox_kernel(&self) -> Option<(Kernel, f64)> {
        let p = self.priors;
        let s2 = square(p.bbox_sigma);
        let takes_part = p.use_bbox && s2.is_finite();
        takes_part.then(|| (Kernel::Tukey { c2: square(BBOX_CUT) * s2 }, square(p.noise_sigma) / s2))
    }

    /// For each known side the outermost corner of the projected 3D box against it; none when a corner is behind
    /// the camera, or when the box takes no part. The footprint is stretched with the box.
    fn bbox_residuals(&self, state: &State) -> [Option<Side>; 4] {
        if self.bbox_kernel().is_none() {
            return [None; 4];
        }
        let (camera, pose, model) = (&self.view.camera, &state.pose, self.model);
        let [min, max] = model.bbox_3d_of(&state.coefficients);
        let stretch = |axis: usize| {
            if model.bbox_basis().is_empty() {
                return (1.0, 0.0);
            }
            let [mean_min, mean_max] = model.bbox_3d();
            let factor = (max[axis] - min[axis]) / (mean_max[axis] - mean_min[axis]);
            (factor, min[axis] - factor * mean_min[axis])
        };
        let ((x_factor, x_offset), (z_factor, z_offset)) = (stretch(0), stretch(2));
        let down: Vector3<f64> = pose.r.column(1).into();
        // Coordinates of right and bottom are negated, so that the outermost is always the smallest.
        let mut outermost = [(f64::INFINITY, [0.0; 3]); 4];
        for &[x, z] in model.footprint().corners() {
            let (x, z) = (x_factor * x + x_offset, z_factor * z + z_offset);
            let level = pose.transform([x, 0.0, z]);
            for y in [min[1], max[1]] {
                let point = level + down * y;
                if point.z <= 0.0 {
                    return [None; 4];
                }
                let inverse = 1.0 / point.z;
                let (u, v) = (camera.fx * point.x * inverse, camera.fy * point.y * inverse);
                for (best, coordinate) in outermost.iter_mut().zip([u, v, -u, -v]) {
                    if coordinate < best.0 {
                        *best = (coordinate, [x, y, z]);
                    }
                }
            }
        }
        core::array::from_fn(|side| {
            let (coordinate, corner) = outermost[side];
            let projected = if side < 2 { coordinate } else { -coordinate };
            let residual = projected - self.priors.bbox[side];
            (!residual.is_nan()).then_some(Side { corner, axis: side % 2, residual })
        })
    }

    fn add_bbox_rows<const D: usize>(&self, state: &State, sides: &[Option<Side>; 4], normal: &mut Normal<D>) {
        let Some((kernel, scale)) = self.bbox_kernel() else { return };
        for side in sides.iter().flatten() {
            let weight = scale * kernel.evaluate(square(side.residual)).1;
            if weight == 0.0 {
                continue;
            }
            let Some(jacobian) = point_jacobian(&self.view.camera, &state.pose, side.corner, [0.0; 2]) else {
                continue;
            };
            let (pose, point) = (&jacobian.pose[side.axis], &jacobian.point[side.axis]);
            if D == 6 || self.model.bbox_basis().is_empty() {
                add_pose_row(normal, pose, side.residual, weight);
                continue;
            }
            let mut row = [0.0; D];
            row[..6].copy_from_slice(pose);
            let [min, max] = self.model.bbox_3d_of(&state.coefficients);
            let share = [0, 1, 2].map(|axis| (side.corner[axis] - min[axis]) / (max[axis] - min[axis]));
            for (entry, [min, max]) in row[6..].iter_mut().zip(self.model.bbox_basis()) {
                *entry = (0..3).map(|axis| point[axis] * (min[axis] + share[axis] * (max[axis] - min[axis]))).sum();
            }
            add_row(normal, &row, side.residual, weight);
        }
    }
}

/// How far an object is from upright.
struct Tilted {
    down: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    q: [f64; 2],
    norm2: f64,
}

/// One side of the 2D box against the corner of the 3D box that should touch it.
#[derive(Clone, Copy)]
struct Side {
    corner: [f64; 3],
    /// 0: left or right, 1: top or bottom.
    axis: usize,
    /// Pixels, projected minus observed.
    residual: f64,
}
