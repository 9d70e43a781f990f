//! The tilt of a frame from all its objects: each stands on the road, so the up axis of each measures the road's
//! normal. It serves cameras whose nominal tilt is wrong for the whole frame (method, sec. 4).

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use crate::geometry::math::{sqrt, square};
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::refine::covariance::PoseCovariance;
use crate::tuning::{FRAME_DOF, FRAME_ITERATIONS};

/// What one object says of the road's normal.
///
/// [`frame_tilt`] shows how it is made and used; the poses come from options [`Options::without_tilt`].
///
/// [`Options::without_tilt`]: crate::estimate::options::Options::without_tilt
///
/// ```
/// use groundpose::{Camera, FrameTilt, Pose, PoseCovariance, Tilt, UpAxis, View, frame_tilt};
///
/// let nominal = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?;
/// let upright = Pose::upright(&nominal, 0.3, [2.0, 1.5, 20.0].into());
/// let axis = UpAxis::new(&nominal, &upright, &(PoseCovariance::identity() * 1e-4));
/// let frame: FrameTilt = frame_tilt(&nominal, &[axis], 0.03, 0.2);
/// assert!(frame.view.tilt.pitch.abs() < 1e-9, "an upright object agrees with the nominal tilt");
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct UpAxis {
    /// Components of the object's down axis along the nominal ground frame's x and z axes.
    down: Vector2<f64>,
    covariance: Matrix2<f64>,
}

/// The tilt of a frame.
///
/// ```
/// use groundpose::{Camera, FrameTilt, Tilt, View, frame_tilt};
///
/// // Without objects it is the nominal tilt, as sure as that was.
/// let nominal = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt { pitch: 0.1, roll: 0.0 })?;
/// let FrameTilt { view, covariance, objects } = frame_tilt(&nominal, &[], 0.03, 0.2);
/// assert!((view.tilt.pitch - 0.1).abs() < 1e-12 && objects == 0.0);
/// assert!((covariance[(0, 0)].sqrt() - 0.2).abs() < 1e-12);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FrameTilt {
    /// The view with the estimated tilt; camera and height are the nominal ones.
    pub view: View,
    /// Covariance, radians squared, of the road's normal about the nominal ground frame's z and x axes (roll, pitch).
    pub covariance: Matrix2<f64>,
    /// Effective number of objects: those far from all others count little.
    pub objects: f64,
}

impl UpAxis {
    /// What a pose estimated in `view` says; its tilt must not have been pulled towards the nominal one.
    #[must_use]
    pub fn new(view: &View, pose: &Pose, covariance: &PoseCovariance) -> Self {
        let down: Vector3<f64> = pose.r.column(1).into();
        let ground = &view.r_camera_from_ground;
        let axes: [Vector3<f64>; 2] = [ground.column(0).into(), ground.column(2).into()];
        // A rotation vector w on the left moves the axis by w x down, hence its components by w . (down x axis).
        let jacobian = Matrix2x3::from_rows(&axes.map(|axis| down.cross(&axis).transpose()));
        let rotation = covariance.fixed_view::<3, 3>(0, 0);
        Self {
            down: Vector2::new(axes[0].dot(&down), axes[1].dot(&down)),
            covariance: jacobian * rotation * jacobian.transpose(),
        }
    }

    fn is_finite(&self) -> bool {
        self.down.iter().chain(self.covariance.iter()).all(|x| x.is_finite())
    }
}

/// Student's t over the objects and a Gaussian about the nominal tilt.
struct Cost<'a> {
    axes: &'a [UpAxis],
    object_variance: f64,
    prior_variance: f64,
}

impl Cost<'_> {
    /// Objects that can be used: difference from a tilt, and its inverse covariance.
    fn terms(&self, tilt: Vector2<f64>) -> impl Iterator<Item = (&UpAxis, Matrix2<f64>, f64)> {
        let spread = Matrix2::identity() * self.object_variance;
        self.axes.iter().filter(|axis| axis.is_finite()).filter_map(move |axis| {
            let information = (axis.covariance + spread).try_inverse()?;
            let difference = axis.down - tilt;
            Some((axis, information, (information * difference).dot(&difference)))
        })
    }

    fn at(&self, tilt: Vector2<f64>) -> f64 {
        let objects: f64 =
            self.terms(tilt).map(|(_, _, d2)| 0.5 * (FRAME_DOF + 2.0) * libm::log1p(d2 / FRAME_DOF)).sum();
        objects + 0.5 * tilt.norm_squared() / self.prior_variance
    }

    /// One step of iteratively reweighted least squares: the new tilt, its covariance, the sum of weights.
    fn step(&self, tilt: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>, f64) {
        let mut information = Matrix2::identity() / self.prior_variance;
        let (mut sum, mut weights) = (Vector2::zeros(), 0.0);
        for (axis, inverse, d2) in self.terms(tilt) {
            let weight = (FRAME_DOF + 2.0) / (FRAME_DOF + d2);
            information += inverse * weight;
            sum += inverse * axis.down * weight;
            weights += weight.min(1.0);
        }
        // Positive definite: the prior alone is.
        let covariance = information.try_inverse().unwrap_or_else(Matrix2::zeros);
        (covariance * sum, covariance, weights)
    }
}

/// The tilt of a frame from the up axes of its objects, robust against wrong ones. `object_sigma`: standard deviation,
/// radians, of an object's up axis about the frame's; `prior_sigma`: of the frame's about the nominal one. Without
/// objects it is the nominal tilt.
///
/// ```
/// use groundpose::{Camera, Pose, PoseCovariance, Tilt, UpAxis, View, frame_tilt};
///
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
/// let nominal = View::new(camera, Tilt::default())?;
/// let truth = View::new(camera, Tilt { pitch: 0.15, roll: 0.02 })?;
/// let sure = PoseCovariance::identity() * 1e-4;
/// let axes = [0.3, 1.1, 2.0, -2.5].map(|yaw| {
///     let pose = Pose::upright(&truth, yaw, [2.0, 1.5, 20.0].into());
///     UpAxis::new(&nominal, &pose, &sure)
/// });
/// let frame = frame_tilt(&nominal, &axes, 0.03, 0.2);
/// assert!((frame.view.tilt.pitch - 0.15).abs() < 2e-3);
/// assert!((frame.view.tilt.roll - 0.02).abs() < 2e-3);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[must_use]
pub fn frame_tilt(view: &View, axes: &[UpAxis], object_sigma: f64, prior_sigma: f64) -> FrameTilt {
    let cost = Cost { axes, object_variance: square(object_sigma), prior_variance: square(prior_sigma) };
    // Every object and the nominal tilt is a start: the cost has one valley for each group that agrees.
    let mut best = (Vector2::zeros(), cost.at(Vector2::zeros()));
    for axis in axes.iter().filter(|axis| axis.is_finite()) {
        let at = cost.at(axis.down);
        if at < best.1 {
            best = (axis.down, at);
        }
    }
    let (mut tilt, mut covariance, mut objects) = cost.step(best.0);
    for _ in 1..FRAME_ITERATIONS {
        (tilt, covariance, objects) = cost.step(tilt);
    }
    let up = sqrt((1.0 - tilt.norm_squared()).max(0.0));
    let gravity = view.r_camera_from_ground * Vector3::new(tilt.x, up, tilt.y);
    let nominal = || FrameTilt { view: *view, covariance: Matrix2::identity() * square(prior_sigma), objects: 0.0 };
    // A normal along the optical axis is no tilt of a camera that sees a road.
    let Ok(mut estimated) = View::from_gravity(view.camera, gravity.into()) else { return nominal() };
    estimated.height = view.height;
    FrameTilt { view: estimated, covariance, objects }
}
