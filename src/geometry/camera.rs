//! A camera: focal lengths, principal point, lens distortion.

use nalgebra::Vector3;

use crate::error::{Got, InputError, require};
use crate::geometry::math::norm2;

/// A pinhole camera; pixel centres at integer coordinates, as in OpenCV.
///
/// ```
/// use groundpose::Camera;
///
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?
///     .with_distortion([-0.3, 0.1, 0.0, 0.0, 0.0])?
///     .with_image_size(1920.0, 1080.0)?;
///
/// let ideal = camera.undistort([1500.0, 900.0]).expect("the lens is invertible there");
/// let back = camera.distort(ideal);
/// assert!((back[0] - 1500.0).abs() < 1e-6 && (back[1] - 900.0).abs() < 1e-6);
///
/// let error = Camera::new(-1000.0, 1000.0, 960.0, 540.0).unwrap_err();
/// assert_eq!(error.to_string(), "fx: expected a positive finite number, got -1000");
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Focal length, pixels, along the columns.
    pub fx: f64,
    /// Focal length, pixels, along the rows.
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// `k1, k2, p1, p2, k3` of OpenCV's model, undone on the way in.
    pub distortion: Option<[f64; 5]>,
    /// Width and height in pixels; tells which box sides are cut by the image border.
    pub image_size: Option<[f64; 2]>,
}

impl Camera {
    /// A camera without distortion.
    ///
    /// # Errors
    /// A focal length that is not positive, or any number that is not finite.
    pub fn new(fx: f64, fy: f64, cx: f64, cy: f64) -> Result<Self, InputError> {
        for (name, f) in [("fx", fx), ("fy", fy)] {
            require(f.is_finite() && f > 0.0, name, "a positive finite number", Got::Number(f))?;
        }
        for (name, c) in [("cx", cx), ("cy", cy)] {
            require(c.is_finite(), name, "a finite number", Got::Number(c))?;
        }
        Ok(Self { fx, fy, cx, cy, distortion: None, image_size: None })
    }

    /// The same camera with lens distortion `k1, k2, p1, p2, k3` (OpenCV's order).
    ///
    /// # Errors
    /// A coefficient that is not finite.
    pub fn with_distortion(mut self, coefficients: [f64; 5]) -> Result<Self, InputError> {
        for c in coefficients {
            require(c.is_finite(), "distortion", "finite numbers", Got::Number(c))?;
        }
        self.distortion = coefficients.iter().any(|&c| c != 0.0).then_some(coefficients);
        Ok(self)
    }

    /// The same camera with an image of `width` x `height` pixels.
    ///
    /// # Errors
    /// A size that is not positive.
    pub fn with_image_size(mut self, width: f64, height: f64) -> Result<Self, InputError> {
        for s in [width, height] {
            require(s.is_finite() && s > 0.0, "image_size", "positive numbers", Got::Number(s))?;
        }
        self.image_size = Some([width, height]);
        Ok(self)
    }

    /// Direction of a pixel in the camera frame, with z = 1.
    ///
    /// ```text
    /// ray = K^-1 [u, v, 1] = [(u - cx) / fx, (v - cy) / fy, 1]
    /// ```
    ///
    /// ```
    /// use groundpose::Camera;
    ///
    /// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
    /// assert_eq!(camera.project(&(7.0 * camera.ray([1460.0, 290.0]))), Some([1460.0, 290.0]));
    /// assert_eq!(camera.project(&[0.0, 0.0, -1.0].into()), None, "behind the camera");
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn ray(&self, pixel: [f64; 2]) -> Vector3<f64> {
        Vector3::new((pixel[0] - self.cx) / self.fx, (pixel[1] - self.cy) / self.fy, 1.0)
    }

    /// Pixel of a point of the camera frame (without distortion); `None` behind the camera.
    #[must_use]
    pub fn project(&self, point: &Vector3<f64>) -> Option<[f64; 2]> {
        (point.z > 0.0).then(|| [self.fx * point.x / point.z + self.cx, self.fy * point.y / point.z + self.cy])
    }

    /// The pixel an ideal lens would have made of a distorted pixel.
    ///
    /// Newton's method on the forward model; `None` where it does not come back to the given
    /// pixel (beyond the radius at which the distortion model folds over).
    #[must_use]
    pub fn undistort(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let Some(d) = self.distortion else {
            return Some(pixel);
        };
        let target = self.ray(pixel);
        let (mut x, mut y) = (target.x, target.y);
        for _ in 0..30 {
            let (value, jacobian) = distort_with_jacobian(&d, x, y);
            let (ex, ey) = (value[0] - target.x, value[1] - target.y);
            let [a, b, c, e] = jacobian;
            let determinant = a * e - b * c;
            // The model stays invertible from the centre outwards while the determinant is positive.
            if determinant <= 1e-6 {
                return None;
            }
            let (dx, dy) = ((e * ex - b * ey) / determinant, (a * ey - c * ex) / determinant);
            x -= dx;
            y -= dy;
            if dx.abs() + dy.abs() < 1e-14 * (1.0 + x.abs() + y.abs()) {
                break;
            }
        }
        let (value, _) = distort_with_jacobian(&d, x, y);
        let error = norm2(value[0] - target.x, value[1] - target.y);
        (error < 1e-9).then_some([self.fx * x + self.cx, self.fy * y + self.cy])
    }

    /// The pixel this lens makes of an ideal pixel: the inverse of [`Camera::undistort`].
    #[must_use]
    pub fn distort(&self, pixel: [f64; 2]) -> [f64; 2] {
        let Some(d) = self.distortion else {
            return pixel;
        };
        let ray = self.ray(pixel);
        let (value, _) = distort_with_jacobian(&d, ray.x, ray.y);
        [self.fx * value[0] + self.cx, self.fy * value[1] + self.cy]
    }
}

/// OpenCV's radial-tangential model at a normalised point, and its Jacobian `[xx, xy, yx, yy]`.
fn distort_with_jacobian(d: &[f64; 5], x: f64, y: f64) -> ([f64; 2], [f64; 4]) {
    let [k1, k2, p1, p2, k3] = *d;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
    let value = [
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    ];
    let mixed = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
    let jacobian = [
        radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        mixed,
        mixed,
        radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    ];
    (value, jacobian)
}
