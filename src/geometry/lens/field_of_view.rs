//! The field-of-view model of Devernay and Faugeras ("Straight lines have to be straight", 2001): the distance from the
//! middle grows with an angle, by one coefficient $`\omega`$.
//!
//! With $`r = \tan \theta`$ of a direction at $`\theta`$ from the axis
//!
//! ```math
//! r' = \frac{1}{\omega} \arctan \Bigl( 2 r \tan \frac{\omega}{2} \Bigr) .
//! ```
//!
//! It is stated in normalised coordinates, and so ends at 90 degrees.

use core::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;

use crate::error::{Got, InputError, require};
use crate::geometry::lens::{LensModel, RayModel};
use crate::geometry::math::{atan2, cos, norm2, sin, tan};

/// The coefficient `omega`, radians.
///
/// ```
/// use groundpose::geometry::lens::field_of_view::FieldOfView;
/// use groundpose::{Camera, Lens};
///
/// let lens = Lens::FieldOfView(FieldOfView::new([0.9]));
/// let camera = Camera::new(500.0, 500.0, 640.0, 480.0)?.with_lens(lens)?;
/// let expected = (2.0 * 0.45_f64.tan()).atan() / 0.9;
/// assert!((camera.distort([1140.0, 480.0])[0] - (640.0 + 500.0 * expected)).abs() < 1e-9);
/// assert!(camera.with_lens(Lens::FieldOfView(FieldOfView::new([0.0]))).is_err());
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOfView {
    coefficients: [f64; 1],
}

impl FieldOfView {
    /// Name of the model.
    ///
    /// ```
    /// assert_eq!(groundpose::geometry::lens::field_of_view::FieldOfView::NAME, "field_of_view");
    /// ```
    pub const NAME: &'static str = "field_of_view";

    /// From `omega`; [`Camera::with_lens`](crate::Camera::with_lens) checks it.
    #[must_use]
    pub const fn new(coefficients: [f64; 1]) -> Self {
        Self { coefficients }
    }

    fn stretch(&self) -> f64 {
        2.0 * tan(0.5 * self.coefficients[0])
    }
}

impl LensModel for FieldOfView {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    fn check(&self) -> Result<(), InputError> {
        let [omega] = self.coefficients;
        require(0.0 < omega && omega < PI, "distortion", "omega between 0 and pi", Got::Number(omega))
    }
}

impl RayModel for FieldOfView {
    fn image_of(&self, ray: &Vector3<f64>) -> Option<[f64; 2]> {
        let r = norm2(ray.x, ray.y);
        if !(ray.z > 0.0) {
            return None;
        }
        let distance = atan2(self.stretch() * r, ray.z) / self.coefficients[0];
        let scale = if r == 0.0 { 1.0 } else { distance / r };
        Some([scale * ray.x, scale * ray.y])
    }

    fn ray_of(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        let distance = norm2(x, y);
        let angle = distance * self.coefficients[0];
        if !(angle < FRAC_PI_2) {
            return None;
        }
        let scale = if distance == 0.0 { 1.0 } else { sin(angle) / (distance * self.stretch()) };
        Some(Vector3::new(scale * x, scale * y, cos(angle)).normalize())
    }
}
