//! The fisheye of Kannala and Brandt as OpenCV and ROS have it: the angle from the optical axis, not its tangent, becomes
//! the distance from the principal point.
//!
//! With $`r^2 = X^2 + Y^2`$ and $`\theta = \operatorname{atan2}(r, Z)`$ of a direction $`(X, Y, Z)`$
//!
//! ```math
//! \theta_d = \theta \, (1 + k_1 \theta^2 + k_2 \theta^4 + k_3 \theta^6 + k_4 \theta^8), \qquad
//! \begin{bmatrix} x' \\ y' \end{bmatrix} = \frac{\theta_d}{r} \begin{bmatrix} X \\ Y \end{bmatrix} .
//! ```
//!
//! It holds up to the angle at which $`\theta_d`$ stops to grow, or all round; it need not stop at 90 degrees.

use core::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;

use crate::geometry::lens::{LensModel, RayModel};
use crate::geometry::math::{atan2, cos, norm2, sin};

/// Coefficients `k1, k2, k3, k4`, in OpenCV's order; with all of them 0 the lens is a fisheye all the same.
///
/// ```
/// use groundpose::geometry::lens::equidistant::Equidistant;
/// use groundpose::{Camera, Lens};
///
/// // 45 degrees from the axis: an ideal pinhole shows it at fx tan(45 deg), this lens at fx pi / 4.
/// let lens = Lens::Equidistant(Equidistant::new([0.0; 4]));
/// let camera = Camera::new(400.0, 400.0, 640.0, 480.0)?.with_lens(lens)?;
/// let seen = camera.distort([1040.0, 480.0]);
/// assert!((seen[0] - (640.0 + 100.0 * core::f64::consts::PI)).abs() < 1e-9);
/// // An ideal pinhole shows nothing at 90 degrees and more, this lens does.
/// assert!(camera.undistort([640.0 + 639.0, 480.0]).is_none());
/// assert!(camera.direction_of([640.0 + 639.0, 480.0]).unwrap().z < 0.0);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equidistant {
    coefficients: [f64; 4],
    /// Up to this angle the model grows.
    limit: f64,
}

/// The angle at which the model stops to grow is looked for in steps of 90 degrees over this.
const STEPS: usize = 128;
/// Halvings of an interval until it is as small as the numbers are exact.
const HALVINGS: usize = 60;

impl Equidistant {
    /// Name of the model.
    ///
    /// ```
    /// assert_eq!(groundpose::geometry::lens::equidistant::Equidistant::NAME, "equidistant");
    /// ```
    pub const NAME: &'static str = "equidistant";

    /// From `k1, k2, k3, k4`; [`Camera::with_lens`](crate::Camera::with_lens) checks them.
    #[must_use]
    pub fn new(coefficients: [f64; 4]) -> Self {
        let lens = Self { coefficients, limit: PI };
        let angle = |step: usize| FRAC_PI_2 * step as f64 / STEPS as f64;
        let grows = |theta: &f64| lens.at(*theta)[1] > 0.0;
        let limit = (1..=2 * STEPS).find(|&step| !grows(&angle(step))).map_or(PI, |step| {
            let (mut low, mut high) = (angle(step - 1), angle(step));
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                *(if grows(&middle) { &mut low } else { &mut high }) = middle;
            }
            low
        });
        Self { limit, ..lens }
    }

    /// `theta_d` and its derivative at an angle from the axis.
    fn at(&self, theta: f64) -> [f64; 2] {
        let ([k1, k2, k3, k4], t2) = (self.coefficients, theta * theta);
        let value = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
        [value, 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))]
    }

    /// The angle from the axis at a distance behind the lens: Newton's method, inside an interval that holds it.
    fn angle(&self, distance: f64) -> Option<f64> {
        let (mut low, mut high) = (0.0, self.limit);
        if !(distance < self.at(high)[0]) {
            return None;
        }
        let mut theta = distance.min(0.5 * high);
        for _ in 0..HALVINGS {
            let [value, slope] = self.at(theta);
            *(if value < distance { &mut low } else { &mut high }) = theta;
            let newton = theta - (value - distance) / slope;
            let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
            if (next - theta).abs() < f64::EPSILON * (1.0 + theta) {
                return Some(next);
            }
            theta = next;
        }
        Some(theta)
    }
}

impl LensModel for Equidistant {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }
}

impl RayModel for Equidistant {
    fn image_of(&self, ray: &Vector3<f64>) -> Option<[f64; 2]> {
        let r = norm2(ray.x, ray.y);
        let theta = atan2(r, ray.z);
        if !(theta < self.limit) {
            return None;
        }
        let scale = if r == 0.0 { 1.0 } else { self.at(theta)[0] / r };
        Some([scale * ray.x, scale * ray.y])
    }

    fn ray_of(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        let distance = norm2(x, y);
        if distance == 0.0 {
            return Some(Vector3::z());
        }
        let theta = self.angle(distance)?;
        let scale = sin(theta) / distance;
        Some(Vector3::new(scale * x, scale * y, cos(theta)))
    }
}
