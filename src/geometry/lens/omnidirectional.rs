//! The omnidirectional model of Mei and Rives ("Single View Point Omnidirectional Camera Calibration from Planar Grids",
//! ICRA 2007): a sphere, a pinhole $`\xi`$ behind its centre, then the model of Brown and Conrady.
//!
//! For a direction $`(X, Y, Z)`$ of length one
//!
//! ```math
//! x = \frac{X}{Z + \xi}, \qquad y = \frac{Y}{Z + \xi},
//! ```
//!
//! and $`(x', y')`$ as in [`brown_conrady`](super::brown_conrady).

use nalgebra::Vector3;

use crate::error::{Got, InputError, require};
use crate::geometry::lens::brown_conrady::BrownConrady;
use crate::geometry::lens::{LensModel, PlaneModel, RayModel, shown};
use crate::geometry::math::{sqrt, square};

/// Coefficients `xi, k1, k2, p1, p2`: `omni` of Kalibr, `MEI` of camodocal and KITTI-360, `omnidir` of OpenCV.
///
/// ```
/// use groundpose::geometry::lens::omnidirectional::Omnidirectional;
/// use groundpose::{Camera, Lens};
///
/// let lens = Lens::Omnidirectional(Omnidirectional::new([2.2, 0.02, 1.6, 0.0, 0.0]));
/// let camera = Camera::new(1336.0, 1336.0, 716.0, 705.0)?.with_lens(lens)?;
/// let seen = camera.image_of(&[4.0, 1.5, -0.3].into()).expect("94 degrees from the axis");
/// assert!(camera.direction_of(seen).unwrap().z < 0.0);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Omnidirectional {
    coefficients: [f64; 5],
    behind: BrownConrady,
}

impl Omnidirectional {
    /// Name of the model.
    ///
    /// ```
    /// assert_eq!(groundpose::geometry::lens::omnidirectional::Omnidirectional::NAME, "omnidirectional");
    /// ```
    pub const NAME: &'static str = "omnidirectional";

    /// From `xi, k1, k2, p1, p2`; [`Camera::with_lens`](crate::Camera::with_lens) checks them.
    #[must_use]
    pub const fn new(coefficients: [f64; 5]) -> Self {
        let [_, k1, k2, p1, p2] = coefficients;
        Self { coefficients, behind: BrownConrady::new([k1, k2, p1, p2, 0.0]) }
    }

    /// Directions of length one with a larger Z have an image of their own.
    fn lowest_z(&self) -> f64 {
        let xi = self.coefficients[0];
        if xi > 1.0 { -1.0 / xi } else { -xi }
    }
}

impl LensModel for Omnidirectional {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    fn check(&self) -> Result<(), InputError> {
        let [xi, ..] = self.coefficients;
        require(xi >= 0.0, "distortion", "xi of 0 or more of an omnidirectional camera", Got::Number(xi))
    }

    fn is_ideal(&self) -> bool {
        self.coefficients == [0.0; 5]
    }
}

impl RayModel for Omnidirectional {
    fn image_of(&self, ray: &Vector3<f64>) -> Option<[f64; 2]> {
        let z = ray.z + self.coefficients[0];
        if ray.z > self.lowest_z() { shown(&self.behind, [ray.x / z, ray.y / z]) } else { None }
    }

    fn ray_of(&self, target: [f64; 2]) -> Option<Vector3<f64>> {
        let (xi, [x, y]) = (self.coefficients[0], self.behind.undistort(target)?);
        let r2 = square(x) + square(y);
        let root = 1.0 + (1.0 - xi * xi) * r2;
        if !(root >= 0.0) {
            return None;
        }
        let factor = (xi + sqrt(root)) / (1.0 + r2);
        Some(Vector3::new(factor * x, factor * y, factor - xi))
    }
}
