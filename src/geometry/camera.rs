//! A camera: focal lengths, principal point, lens. The pinhole's equations stand here, and once more for vector units
//! in `simd/projection.rs`.

use nalgebra::Vector3;

use crate::error::{Got, InputError, require};
use crate::geometry::lens::Lens;
use crate::geometry::lens::brown_conrady::BrownConrady;

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
    /// The lens, undone on the way in; `None`: an ideal one.
    pub lens: Option<Lens>,
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
        Ok(Self { fx, fy, cx, cy, lens: None, image_size: None })
    }

    /// The same camera with lens distortion `k1, k2, p1, p2, k3` (OpenCV's order).
    ///
    /// # Errors
    /// A coefficient that is not finite.
    pub fn with_distortion(self, coefficients: [f64; 5]) -> Result<Self, InputError> {
        self.with_lens(Lens::BrownConrady(BrownConrady::new(coefficients)))
    }

    /// The same camera with a lens of any model.
    ///
    /// ```
    /// use groundpose::geometry::lens::brown_conrady::BrownConrady;
    /// use groundpose::{Camera, Lens};
    ///
    /// let (camera, k) = (Camera::new(1000.0, 1000.0, 960.0, 540.0)?, [-0.3, 0.1, 0.0, 0.0, 0.0]);
    /// assert_eq!(camera.with_lens(Lens::BrownConrady(BrownConrady::new(k)))?, camera.with_distortion(k)?);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    ///
    /// # Errors
    /// A coefficient that is not finite or that the model cannot have.
    pub fn with_lens(mut self, lens: Lens) -> Result<Self, InputError> {
        lens.check()?;
        self.lens = (!lens.is_ideal()).then_some(lens);
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
    /// ```math
    /// K^{-1} \begin{bmatrix} u & v & 1 \end{bmatrix}^T
    ///   = \begin{bmatrix} \dfrac{u - c_x}{f_x} & \dfrac{v - c_y}{f_y} & 1 \end{bmatrix}^T
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
        let [x, y] = self.normalised(pixel);
        Vector3::new(x, y, 1.0)
    }

    /// Pixel of a point of the camera frame (without distortion); `None` behind the camera.
    ///
    /// ```math
    /// u = \frac{f_x X}{Z} + c_x, \qquad v = \frac{f_y Y}{Z} + c_y
    /// ```
    #[must_use]
    pub fn project(&self, point: &Vector3<f64>) -> Option<[f64; 2]> {
        (point.z > 0.0).then(|| [self.fx * point.x / point.z + self.cx, self.fy * point.y / point.z + self.cy])
    }

    /// A pixel relative to the principal point.
    #[inline]
    pub(crate) fn centred(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [u - self.cx, v - self.cy]
    }

    /// Pixel to normalised coordinates.
    #[inline]
    pub(crate) fn normalised(&self, pixel: [f64; 2]) -> [f64; 2] {
        let [u, v] = self.centred(pixel);
        [u / self.fx, v / self.fy]
    }

    /// Normalised coordinates to pixel.
    #[inline]
    pub(crate) fn pixel(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.fx * x + self.cx, self.fy * y + self.cy]
    }

    /// The line $`a u + b v + c = 0`$ in which the image cuts the plane through the camera with this normal:
    /// $`(a, b, c) = K^{-T} n`$.
    pub(crate) fn line_of_plane(&self, normal: &Vector3<f64>) -> [f64; 3] {
        let (a, b) = (normal.x / self.fx, normal.y / self.fy);
        [a, b, normal.z - a * self.cx - b * self.cy]
    }

    /// The pixel an ideal lens would have made of a distorted pixel; `None` beyond the radius at which the lens model
    /// folds over, and 90 degrees and more from the axis.
    #[must_use]
    pub fn undistort(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        match self.lens {
            None => Some(pixel),
            Some(lens) => lens.undistort(self.normalised(pixel)).map(|ideal| self.pixel(ideal)),
        }
    }

    /// The pixel this lens makes of an ideal pixel: the inverse of [`Camera::undistort`]. Not a number beyond the limit of
    /// a lens of rays.
    #[must_use]
    pub fn distort(&self, pixel: [f64; 2]) -> [f64; 2] {
        match self.lens {
            None => pixel,
            Some(lens) => self.pixel(lens.distort(self.normalised(pixel))),
        }
    }

    /// The pixel at which the camera shows a point of its frame, through its lens; `None` where it does not: behind the
    /// camera or, of a lens that sees farther, beyond its limit.
    ///
    /// ```
    /// use groundpose::geometry::lens::equidistant::Equidistant;
    /// use groundpose::{Camera, Lens};
    ///
    /// let fisheye = Camera::new(400.0, 400.0, 960.0, 960.0)?.with_lens(Lens::Equidistant(Equidistant::new([0.0; 4])))?;
    /// let beside = [3.0, 0.0, -0.1].into();
    /// let pixel = fisheye.image_of(&beside).expect("92 degrees from the axis");
    /// assert!((fisheye.direction_of(pixel).unwrap().cross(&beside)).norm() < 1e-12);
    /// assert_eq!(fisheye.project(&beside), None);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn image_of(&self, point: &Vector3<f64>) -> Option<[f64; 2]> {
        match self.lens {
            None => self.project(point),
            Some(lens) => lens.image_of(point).map(|seen| self.pixel(seen)),
        }
    }

    /// Direction, of length one in the camera frame, of what the camera shows at a pixel, through its lens; `None` where
    /// the lens shows nothing. The inverse of [`Camera::image_of`].
    #[must_use]
    pub fn direction_of(&self, pixel: [f64; 2]) -> Option<Vector3<f64>> {
        match self.lens {
            None => self.ray(pixel).try_normalize(0.0),
            Some(lens) => lens.ray_of(self.normalised(pixel)),
        }
    }
}
