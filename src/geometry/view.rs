//! A camera's tilt against the ground, and what follows from it: rays, side planes, horizon.

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::error::{Got, InputError, require};
use crate::geometry::bbox::Bbox;
use crate::geometry::camera::Camera;
use crate::geometry::math::{atan2, norm2, tan};
use crate::tuning::BORDER_PX;

/// How the camera is tilted against the ground.
///
/// ```
/// use groundpose::{Camera, Tilt, View};
///
/// // Pitch moves the horizon by `fy tan(pitch)`, up in the image when the camera looks down.
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
/// let [_, b, c] = View::new(camera, Tilt { pitch: -0.1, roll: 0.0 })?.horizon();
/// assert!((-c / b - (540.0 - 1000.0 * 0.1_f64.tan())).abs() < 1e-9);
/// assert_eq!(Tilt::default(), Tilt { pitch: 0.0, roll: 0.0 });
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tilt {
    /// Radians; positive when the optical axis points above the horizon.
    pub pitch: f64,
    /// Radians; rotation of the camera about its optical axis.
    pub roll: f64,
}

/// A camera, its tilt against the ground and, if known, its height above it.
///
/// ```
/// use groundpose::{Camera, Tilt, View};
///
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
/// // Looking down by 5 degrees: the horizon is above the principal point.
/// let view = View::new(camera, Tilt { pitch: -5.0_f64.to_radians(), roll: 0.0 })?.with_height(6.0)?;
/// let [_, b, c] = view.horizon();
/// assert!((-c / b - 452.51).abs() < 0.01);
///
/// // The same from an accelerometer: gravity in the camera's frame.
/// let down = view.r_camera_from_ground.column(1);
/// let same = View::from_gravity(camera, [down[0], down[1], down[2]])?;
/// assert!((same.tilt.pitch - view.tilt.pitch).abs() < 1e-12);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The camera.
    pub camera: Camera,
    /// Its tilt.
    pub tilt: Tilt,
    /// Height above the ground in metres, if known.
    pub height: Option<f64>,
    /// $`R_z(\text{roll}) \, R_x(-\text{pitch})`$ (paper, sec. 3.2, extended with roll).
    pub r_camera_from_ground: Matrix3<f64>,
}

impl View {
    /// A camera with its tilt.
    ///
    /// # Errors
    /// An angle that is not finite, or a pitch of 90 degrees and more.
    pub fn new(camera: Camera, tilt: Tilt) -> Result<Self, InputError> {
        require(
            tilt.pitch.is_finite() && tilt.pitch.abs() < core::f64::consts::FRAC_PI_2,
            "pitch",
            "radians between -pi/2 and pi/2",
            Got::Number(tilt.pitch),
        )?;
        require(
            tilt.roll.is_finite() && tilt.roll.abs() <= core::f64::consts::PI,
            "roll",
            "radians between -pi and pi",
            Got::Number(tilt.roll),
        )?;
        let r_camera_from_ground = Rotation3::from_axis_angle(&Vector3::z_axis(), tilt.roll)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), -tilt.pitch);
        Ok(Self { camera, tilt, height: None, r_camera_from_ground: r_camera_from_ground.into_inner() })
    }

    /// A camera with the direction of gravity (downwards) in its own frame, of any length.
    ///
    /// # Errors
    /// A direction of zero length, not finite, or along the optical axis.
    pub fn from_gravity(camera: Camera, gravity: [f64; 3]) -> Result<Self, InputError> {
        let [x, y, z] = gravity;
        let length = Vector3::from(gravity).norm();
        require(
            length.is_finite() && length > 0.0,
            "gravity",
            "a finite direction of non-zero length",
            Got::Number(length),
        )?;
        let tilt = Tilt { pitch: atan2(-z, norm2(x, y)), roll: atan2(-x, y) };
        require(
            norm2(x, y) > 1e-6 * length,
            "gravity",
            "a direction that is not along the optical axis",
            Got::Number(z / length),
        )?;
        Self::new(camera, tilt)
    }

    /// The same view with the camera `height` metres above the ground.
    ///
    /// # Errors
    /// A height that is not positive.
    pub fn with_height(mut self, height: f64) -> Result<Self, InputError> {
        require(height.is_finite() && height > 0.0, "height", "a positive number of metres", Got::Number(height))?;
        self.height = Some(height);
        Ok(self)
    }

    /// Line $`a u + b v + c = 0`$ of the horizon in pixels; without roll, $`v = c_y + f_y \tan(\text{pitch})`$.
    #[must_use]
    pub fn horizon(&self) -> [f64; 3] {
        let camera = &self.camera;
        if self.tilt.roll == 0.0 {
            return [0.0, 1.0, -camera.pixel([0.0, tan(self.tilt.pitch)])[1]];
        }
        // Rays perpendicular to the ground's normal.
        let [a, b, c] = camera.line_of_plane(&self.r_camera_from_ground.column(1).into());
        let length = norm2(a, b);
        [a / length, b / length, c / length]
    }

    /// Unit normal, in the ground frame, of the plane through pixel column `u`; it points right.
    ///
    /// ```math
    /// n = \frac{R^T a}{\lVert a \rVert}, \qquad a = \Bigl( 1,\; 0,\; -\frac{u - c_x}{f_x} \Bigr)^T, \qquad
    /// R = R_{\text{camera} \leftarrow \text{ground}}
    /// ```
    ///
    /// ```
    /// use groundpose::{Camera, Tilt, View};
    ///
    /// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt { pitch: -0.1, roll: 0.02 })?;
    /// let normal = view.column_plane(1200.0);
    /// assert!(normal.dot(&view.ground_ray([1200.0, 333.0])).abs() < 1e-12, "on the plane");
    /// assert!(normal.dot(&view.ground_ray([1201.0, 333.0])) > 0.0, "right of it");
    ///
    /// // Between the sides of a box both inward normals look the same way.
    /// let inside = view.side_planes(1100.0, 1300.0).map(|side| side.dot(&view.ground_ray([1200.0, 600.0])));
    /// assert!(inside[0] > 0.0 && inside[1] > 0.0);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn column_plane(&self, u: f64) -> Vector3<f64> {
        // K^T [1, 0, -u] divided by fx; the row does not matter.
        let [slope, _] = self.camera.normalised([u, 0.0]);
        let normal = Vector3::new(1.0, 0.0, -slope) / norm2(1.0, slope);
        self.r_camera_from_ground.tr_mul(&normal)
    }

    /// Inward normals, in the ground frame, of the planes through the left and right sides of a box.
    #[must_use]
    pub fn side_planes(&self, left: f64, right: f64) -> [Vector3<f64>; 2] {
        [self.column_plane(left), -self.column_plane(right)]
    }

    /// A box without the sides that the image border cuts: they say where the image ends, not the object.
    ///
    /// ```
    /// use groundpose::{Bbox, Camera, Tilt, View};
    ///
    /// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?.with_image_size(1920.0, 1080.0)?;
    /// let seen = View::new(camera, Tilt::default())?.uncut_bbox(Bbox::new([1500.0, 400.0, 1919.0, 700.0])?);
    /// assert!(seen.right.is_nan() && seen.left == 1500.0);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn uncut_bbox(&self, mut bbox: Bbox) -> Bbox {
        if let Some([width, height]) = self.camera.image_size {
            let unless = |is_cut: bool, side: f64| if is_cut { f64::NAN } else { side };
            bbox.left = unless(bbox.left <= BORDER_PX, bbox.left);
            bbox.top = unless(bbox.top <= BORDER_PX, bbox.top);
            bbox.right = unless(bbox.right >= width - 1.0 - BORDER_PX, bbox.right);
            bbox.bottom = unless(bbox.bottom >= height - 1.0 - BORDER_PX, bbox.bottom);
        }
        bbox
    }

    /// The view of an ideal lens; its image has no borders at known pixels.
    pub(crate) fn ideal(&self) -> Self {
        Self { camera: Camera { lens: None, image_size: None, ..self.camera }, ..*self }
    }

    /// A box of a distorted image without distortion: each side moves as its middle does. A side whose middle
    /// cannot be undone becomes unknown.
    ///
    /// ```
    /// use groundpose::{Bbox, Camera, Tilt, View};
    ///
    /// // A barrel lens pulls the sides inwards.
    /// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?.with_distortion([-0.3, 0.1, 0.0, 0.0, 0.0])?;
    /// let ideal = View::new(camera, Tilt::default())?.undistort_bbox(Bbox::new([1500.0, 400.0, 1800.0, 700.0])?);
    /// assert!(ideal.right > 1850.0 && ideal.left > 1500.0);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn undistort_bbox(&self, bbox: Bbox) -> Bbox {
        if self.camera.lens.is_none() {
            return bbox;
        }
        bbox.moved_by_middles([self.camera.cx, self.camera.cy], |pixel| self.camera.undistort(pixel))
    }

    /// Ray of a pixel in the ground frame, of length one in the bird's-eye view (paper, eq. 4).
    ///
    /// ```math
    /// k = \frac{a}{\sqrt{a_x^2 + a_z^2}}, \qquad
    /// a = R_{\text{camera} \leftarrow \text{ground}}^T \; K^{-1} \, (u, v, 1)^T
    /// ```
    ///
    /// ```
    /// use groundpose::{Camera, Tilt, View};
    ///
    /// // From 1.5 m, looking level: a point on the ground 30 m away lies 50 px below the horizon.
    /// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?;
    /// let k = view.ground_ray([960.0, 590.0]);
    /// assert!((k * 30.0 - view.camera.ray([960.0, 590.0]) * 30.0).norm() < 1e-12);
    /// assert!((k.y * 30.0 - 1.5).abs() < 1e-12);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn ground_ray(&self, pixel: [f64; 2]) -> Vector3<f64> {
        let ray = self.r_camera_from_ground.tr_mul(&self.camera.ray(pixel));
        ray / norm2(ray.x, ray.z)
    }
}
