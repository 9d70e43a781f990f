//! How sure a pose is: the inverse of the normal equations over its inliers, priors included.
//!
//! With the Jacobians $`J_i`$ of the inliers' residuals, their weights $`w_i`$, the noise $`\sigma`$ of a coordinate and
//! the normal matrix $`P`$ of the priors, in units of a pixel's cost,
//!
//! ```math
//! \Sigma = \sigma^2 H^{-1}, \qquad H = \sum_i w_i J_i^T J_i + P .
//! ```
//!
//! The keypoints of a network err together: a shift of all of them, a stretch, a turn. Then the residuals do not show the
//! whole error, and the part of the keypoints alone is larger by a factor $`\kappa`$
//! ([`Options::keypoint_error_factor`]):
//!
//! ```math
//! \Sigma = H^{-1} \bigl( \kappa \sigma^2 (H - P) + \sigma^2 P \bigr) H^{-1}
//!        = \sigma^2 H^{-1} + (\kappa - 1) \sigma^2 H^{-1} (H - P) H^{-1} .
//! ```
//!
//! What all keypoints share in the image or about the ground's normal is no part of that: it is hardly smaller for a near
//! vehicle with small residuals. A shift by a fraction of the box ([`Options::keypoint_error_shift`]) widens the
//! translation across the ray, a turn ([`Options::keypoint_error_turn`]) the rotation about the normal.
//!
//! [`Options::keypoint_error_shift`]: crate::estimate::options::Options::keypoint_error_shift
//! [`Options::keypoint_error_turn`]: crate::estimate::options::Options::keypoint_error_turn
//! [`Options::keypoint_error_factor`]: crate::estimate::options::Options::keypoint_error_factor

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::geometry::math::square;
use crate::geometry::view::View;
use crate::model::shape_model::MAX_MODES;
use crate::refine::kernels::Kernel;
use crate::refine::normal::{Normal, State, cholesky, padded_modes, solve_columns};
use crate::refine::objective::Objective;
use crate::simd::dispatch::HotLoop;
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};

/// Covariance of a pose: rotation vector on the left (camera frame, radians), then translation (metres).
///
/// ```
/// use groundpose::PoseCovariance;
///
/// // 1 degree in every rotation, 0.1 m across and 0.5 m in depth.
/// let sigma = [0.0175, 0.0175, 0.0175, 0.1, 0.1, 0.5_f64];
/// let covariance = PoseCovariance::from_diagonal(&sigma.map(|s| s * s).into());
/// assert_eq!(covariance[(5, 5)].sqrt(), 0.5);
/// ```
pub type PoseCovariance = SMatrix<f64, 6, 6>;
/// Covariance of the shape coefficients, in the leading rows and columns.
///
/// ```
/// use groundpose::{MAX_MODES, ShapeCovariance};
///
/// assert_eq!(ShapeCovariance::zeros().nrows(), MAX_MODES);
/// ```
pub type ShapeCovariance = SMatrix<f64, MAX_MODES, MAX_MODES>;
/// Covariance of the shape coefficients (leading rows) with the pose (columns): when the pose moves, so does the shape.
///
/// ```
/// use groundpose::{MAX_MODES, ShapePoseCovariance};
///
/// assert_eq!(ShapePoseCovariance::zeros().shape(), (MAX_MODES, 6));
/// ```
pub type ShapePoseCovariance = SMatrix<f64, MAX_MODES, 6>;

/// Covariances of a pose and a shape, and between them.
pub(crate) type Covariances = (PoseCovariance, ShapeCovariance, ShapePoseCovariance);

/// Errors that the keypoints of an object have together.
#[derive(Clone, Copy)]
pub(crate) struct SharedErrors {
    /// Of the keypoints' part of the covariance.
    pub(crate) factor: f64,
    /// Standard deviations: pixels in each direction of the image, and radians about the ground's normal.
    pub(crate) shift: f64,
    pub(crate) turn: f64,
}

impl SharedErrors {
    /// Whether there are still numbers afterwards.
    fn widen(&self, covariance: &mut PoseCovariance, view: &View, t: &Vector3<f64>) -> bool {
        if self.turn > 0.0 {
            let normal = view.r_camera_from_ground.column(1) * self.turn;
            let mut rotation = covariance.fixed_view_mut::<3, 3>(0, 0);
            rotation += normal * normal.transpose();
        }
        if self.shift > 0.0 {
            let ray = t.normalize();
            let across = Matrix3::identity() - ray * ray.transpose();
            let mut translation = covariance.fixed_view_mut::<3, 3>(3, 3);
            translation += across * square(self.shift / view.camera.fx * t.z);
        }
        (self.turn == 0.0 && self.shift == 0.0) || covariance.iter().all(|x| x.is_finite())
    }
}

/// The covariances when the noise of a coordinate is that of the objective's priors and the keypoints have `errors`
/// together; `None` when the inliers leave a direction free.
pub(crate) fn covariance(
    objective: &mut Objective,
    state: &State,
    inlier_threshold: f64,
    errors: &SharedErrors,
) -> Option<Covariances> {
    objective.keypoints.activate_within(state, inlier_threshold);
    let mut found = match padded_modes(objective.keypoints.model.eigenvalues().len()) {
        0 => inverse::<6>(objective, state, errors.factor),
        5 => inverse::<11>(objective, state, errors.factor),
        _ => inverse::<{ 6 + MAX_MODES }>(objective, state, errors.factor),
    };
    if let Some((pose, ..)) = &mut found
        && !errors.widen(pose, objective.view, &state.pose.t)
    {
        return None;
    }
    found
}

/// A call of its own, as [`Objective::linearise_keypoints`]: matrices of one size at a time are on the stack.
#[inline(never)]
fn inverse<const D: usize>(objective: &mut Objective, state: &State, error_factor: f64) -> Option<Covariances> {
    let mut normal = Normal::<D>::ZERO;
    objective.linearise(state, Kernel::LeastSquares, &mut normal);
    cholesky(&mut normal.h)?;
    let keypoints = (error_factor != 1.0).then(|| objective.linearise_keypoints::<D>(state));
    let (mut pose, mut shape) = (PoseCovariance::zeros(), ShapeCovariance::zeros());
    let mut between = ShapePoseCovariance::zeros();
    let modes = objective.keypoints.model.eigenvalues().len();
    let variance = square(objective.priors.noise_sigma);
    for first in (0..6 + modes).step_by(LANES) {
        let columns = first..(first + LANES).min(6 + modes);
        let mut unknowns = [Lanes::splat(0.0); D];
        for column in columns.clone() {
            unknowns[column].0[column - first] = variance;
        }
        let (factors, keypoints, shared) = (&normal.h, keypoints.as_ref(), error_factor - 1.0);
        objective.keypoints.unit.run(Columns { factors, keypoints, shared, unknowns: &mut unknowns });
        for column in columns {
            let x: [f64; D] = unknowns.map(|lanes| lanes.0[column - first]);
            if x.iter().any(|x| !x.is_finite()) {
                return None;
            }
            if column < 6 {
                pose.column_mut(column).copy_from_slice(&x[..6]);
                for m in 0..modes {
                    between[(m, column)] = x[6 + m];
                }
            } else {
                for m in 0..modes {
                    shape[(m, column - 6)] = x[6 + m];
                }
            }
        }
    }
    if error_factor == 1.0 {
        return Some((pose, shape, between));
    }
    // Rounding may have left nothing of a direction that the inliers hardly determine.
    (0..6).all(|k| pose[(k, k)] > 0.0).then(|| (symmetric(pose), symmetric(shape), between))
}

/// Four columns of the covariance at a time, from those of the identity.
struct Columns<'a, const D: usize> {
    /// Of `H`, by [`cholesky`].
    factors: &'a [[f64; D]; D],
    /// The part of the keypoints, which have more errors together by this factor.
    keypoints: Option<&'a Normal<D>>,
    shared: f64,
    unknowns: &'a mut [Lanes; D],
}

impl<const D: usize> HotLoop for Columns<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) {
        let mut x = [unit.zero(); D];
        for i in 0..D {
            x[i] = unit.load(self.unknowns[i]);
        }
        solve_columns(self.factors, &mut x);
        if let Some(keypoints) = self.keypoints {
            let mut shared = times(unit, &keypoints.h, &x);
            solve_columns(self.factors, &mut shared);
            for i in 0..D {
                x[i] += shared[i] * self.shared;
            }
        }
        for i in 0..D {
            self.unknowns[i] = x[i].lanes();
        }
    }
}

/// A symmetric matrix, of which the upper triangle is stored, times four columns.
#[inline(always)]
fn times<U: Unit, const D: usize>(unit: U, h: &[[f64; D]; D], x: &[U::Vector; D]) -> [U::Vector; D] {
    let mut product = [unit.zero(); D];
    for i in 0..D {
        product[i] += x[i] * h[i][i];
        for j in i + 1..D {
            product[i] += x[j] * h[i][j];
            product[j] += x[i] * h[i][j];
        }
    }
    product
}

/// Without what rounding made of a symmetric product.
fn symmetric<const N: usize>(matrix: SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (matrix + matrix.transpose()) * 0.5
}
