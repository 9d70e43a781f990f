//! What is known besides the keypoints, weighed against their noise: the ground, the class, the 2D box.
//!
//! With the noise $`\sigma`$ of a coordinate, a prior on $`q`$ of standard deviation $`\sigma_q`$ adds the cost
//! $`(\sigma / \sigma_q)^2 \, \rho(q)`$: Student's t for the object's lean, $`q^2 / 2`$ for a coefficient of its shape
//! (whose variance is the mode's eigenvalue), Tukey's biweight for a side of its box.

use nalgebra::Vector3;

use crate::geometry::math::square;
use crate::geometry::view::View;
use crate::model::shape_model::ShapeModel;
use crate::refine::box_extremes::Outermost;
use crate::refine::box_sides::Sides;
use crate::refine::kernels::Kernel;
use crate::refine::normal::{Normal, State, add_row};
use crate::simd::dispatch::VectorUnit;
use crate::tuning::{BBOX_CUT, TILT_DOF};

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

/// Priors and what they speak of.
pub(crate) struct PriorTerms<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) priors: &'a Priors,
    pub(crate) view: &'a View,
    pub(crate) model: &'a ShapeModel<'a>,
}

impl PriorTerms<'_> {
    /// Adds tilt and shape to normal equations and cost.
    pub(crate) fn add_tilt_and_shape<const D: usize>(&self, state: &State, normal: &mut Normal<D>) {
        normal.cost += self.add_tilt_rows(state, normal) + self.shape_cost(state);
        self.add_shape_rows(state, normal);
    }

    /// Cost of tilt and shape (pixels squared, halved).
    pub(crate) fn tilt_and_shape_cost(&self, state: &State) -> f64 {
        self.tilt_kernel().map_or(0.0, |(kernel, scale)| scale * kernel.evaluate(self.tilt(state).norm2).0)
            + self.shape_cost(state)
    }

    /// Their cost and that of the box (pixels squared, halved).
    pub(crate) fn cost(&self, state: &State) -> f64 {
        self.tilt_and_shape_cost(state) + self.sides(state).map_or(0.0, |sides| sides.cost())
    }

    fn shape_cost(&self, state: &State) -> f64 {
        let precision = if self.priors.shape { square(self.priors.noise_sigma) } else { 0.0 };
        let coefficients = self.model.eigenvalues().iter().zip(&state.coefficients);
        coefficients.map(|(variance, lambda)| 0.5 * precision * square(*lambda) / variance).sum()
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

    /// Adds the rows of the tilt; its cost.
    fn add_tilt_rows<const D: usize>(&self, state: &State, normal: &mut Normal<D>) -> f64 {
        let Some((kernel, scale)) = self.tilt_kernel() else { return 0.0 };
        let tilted = self.tilt(state);
        let (rho, weight) = kernel.evaluate(tilted.norm2);
        for (axis, q) in tilted.axes.iter().zip(tilted.q) {
            // The translation does not tilt.
            let row: [f64; 3] = tilted.down.cross(axis).into();
            add_row(normal, &row, q, scale * weight);
        }
        scale * rho
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

    /// Every side of the box and the corner of the projected 3D box that should touch it; none when a corner is behind
    /// the camera, or when the box takes no part. The footprint is stretched with the box.
    pub(crate) fn sides(&self, state: &State) -> Option<Sides> {
        let (p, model) = (self.priors, self.model);
        let s2 = square(p.bbox_sigma);
        if !p.use_bbox || !s2.is_finite() {
            return None;
        }
        let bbox_3d = model.bbox_3d_of(&state.coefficients);
        let (x, z) = (model.footprint_stretch(&bbox_3d, 0), model.footprint_stretch(&bbox_3d, 2));
        let extremes = self.unit.run(Outermost {
            camera: &self.view.camera,
            pose: &state.pose,
            footprint: model.footprint().corners(),
            factor: [x.0, z.0],
            offset: [x.1, z.1],
            heights: bbox_3d.map(|end| end[1]),
        });
        extremes.map(|extremes| Sides::new(&extremes, &p.bbox, square(BBOX_CUT) * s2, square(p.noise_sigma) / s2))
    }
}

/// How far an object is from upright.
struct Tilted {
    down: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    q: [f64; 2],
    norm2: f64,
}
