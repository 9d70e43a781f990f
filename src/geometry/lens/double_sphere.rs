//! The double sphere of Usenko, Demmel and Cremers ("The Double Sphere Camera Model", 3DV 2018): a direction goes through
//! two spheres, whose centres are $`\xi`$ apart, and a pinhole.
//!
//! With $`d_1 = \lVert (X, Y, Z) \rVert`$ and $`d_2 = \lVert (X, Y, \xi d_1 + Z) \rVert`$
//!
//! ```math
//! \begin{bmatrix} x' \\ y' \end{bmatrix} =
//! \frac{1}{\alpha d_2 + (1 - \alpha) (\xi d_1 + Z)} \begin{bmatrix} X \\ Y \end{bmatrix} .
//! ```

use nalgebra::Vector3;

use crate::error::{Got, InputError, require};
use crate::geometry::lens::{LensModel, RayModel};
use crate::geometry::math::{norm2, sqrt, square};

/// Coefficients `xi, alpha`, as Kalibr and Basalt have them.
///
/// ```
/// use groundpose::geometry::lens::double_sphere::DoubleSphere;
/// use groundpose::{Camera, Lens};
///
/// // Straight to the side, and still in the picture.
/// let lens = Lens::DoubleSphere(DoubleSphere::new([-0.2, 0.6]));
/// let camera = Camera::new(300.0, 300.0, 640.0, 480.0)?.with_lens(lens)?;
/// let [u, v] = camera.image_of(&[5.0, 0.0, 0.0].into()).expect("within the lens");
/// assert!(u > 1100.0 && v == 480.0);
/// assert!((camera.direction_of([u, v]).unwrap().x - 1.0).abs() < 1e-12);
/// assert!(camera.with_lens(Lens::DoubleSphere(DoubleSphere::new([-0.2, 1.6]))).is_err());
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleSphere {
    coefficients: [f64; 2],
}

impl DoubleSphere {
    /// Name of the model.
    ///
    /// ```
    /// assert_eq!(groundpose::geometry::lens::double_sphere::DoubleSphere::NAME, "double_sphere");
    /// ```
    pub const NAME: &'static str = "double_sphere";

    /// From `xi, alpha`; [`Camera::with_lens`](crate::Camera::with_lens) checks them.
    #[must_use]
    pub const fn new(coefficients: [f64; 2]) -> Self {
        Self { coefficients }
    }

    /// The smallest Z of a direction of length one that has an image of its own (eq. 43 to 45 of the paper).
    fn lowest_z(&self) -> f64 {
        let [xi, alpha] = self.coefficients;
        let w1 = if alpha <= 0.5 { alpha / (1.0 - alpha) } else { (1.0 - alpha) / alpha };
        -(w1 + xi) / sqrt(2.0 * w1 * xi + xi * xi + 1.0)
    }
}

impl LensModel for DoubleSphere {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    fn check(&self) -> Result<(), InputError> {
        let [xi, alpha] = self.coefficients;
        require(xi > -1.0, "distortion", "xi > -1 of a double sphere", Got::Number(xi))?;
        require((0.0..=1.0).contains(&alpha), "distortion", "alpha from 0 to 1 of a double sphere", Got::Number(alpha))
    }

    fn is_ideal(&self) -> bool {
        self.coefficients == [0.0; 2]
    }
}

impl RayModel for DoubleSphere {
    fn image_of(&self, ray: &Vector3<f64>) -> Option<[f64; 2]> {
        let [xi, alpha] = self.coefficients;
        if !(ray.z > self.lowest_z()) {
            return None;
        }
        let z = xi + ray.z;
        let d2 = sqrt(square(ray.x) + square(ray.y) + square(z));
        let denominator = alpha * d2 + (1.0 - alpha) * z;
        Some([ray.x / denominator, ray.y / denominator])
    }

    fn ray_of(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        let ([xi, alpha], r2) = (self.coefficients, square(norm2(x, y)));
        let root = 1.0 - (2.0 * alpha - 1.0) * r2;
        if !(root >= 0.0) {
            return None;
        }
        let z = (1.0 - alpha * alpha * r2) / (alpha * sqrt(root) + 1.0 - alpha);
        let factor = (z * xi + sqrt(z * z + (1.0 - xi * xi) * r2)) / (z * z + r2);
        let ray = Vector3::new(factor * x, factor * y, factor * z - xi);
        (ray.z > self.lowest_z()).then_some(ray)
    }
}
