//! A pinhole view of its own for one object of a wide lens.
//!
//! A picture of 180 degrees fits no pinhole, but a pinhole that faces an object sees it nearly as the lens does. Its axis
//! goes through a pixel in the middle of the object, and there its image has the lens's scale along rows and columns, and
//! their directions. Where columns and rows of the lens are not perpendicular, each is turned by half of what is missing.
//! Near that pixel both pictures are the same, pixel by pixel, up to that turn and to second order in the distance.

use nalgebra::{Matrix3, Vector3};

use crate::geometry::bbox::Bbox;
use crate::geometry::camera::Camera;
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::tuning::NARROWEST_RAY;

/// Half the distance, pixels, over which the lens's scale is measured.
const STEP: f64 = 0.5;

/// A view that faces an object.
pub(crate) struct LocalView {
    /// Without a lens; its ground is that of the camera.
    pub(crate) view: View,
    local_from_camera: Matrix3<f64>,
}

impl LocalView {
    /// The view whose axis goes through a pixel; `None` where the lens shows nothing there.
    pub(crate) fn facing(view: &View, centre: [f64; 2]) -> Option<Self> {
        let axis = view.camera.direction_of(centre)?;
        let [along_row, along_column] = [0, 1].map(|k| slope(&view.camera, centre, &axis, k));
        let (along_row, along_column) = (along_row?, along_column?);
        let (row, column) = (along_row.try_normalize(0.0)?, along_column.try_normalize(0.0)?);
        // Perpendicular, and both as far from the lens's directions.
        let (sum, difference) = ((row + column).try_normalize(0.0)?, (row - column).try_normalize(0.0)?);
        let (x, y) = ((sum + difference).normalize(), (sum - difference).normalize());
        let (fx, fy) = (1.0 / x.dot(&along_row), 1.0 / y.dot(&along_column));
        if !(fx > 0.0 && fy > 0.0 && fx.is_finite() && fy.is_finite() && x.cross(&y).dot(&axis) > 0.0) {
            return None;
        }
        let local_from_camera = Matrix3::from_rows(&[x.transpose(), y.transpose(), axis.transpose()]);
        let [cx, cy] = centre;
        let camera = Camera { fx, fy, cx, cy, lens: None, image_size: None };
        let r_camera_from_ground = local_from_camera * view.r_camera_from_ground;
        Some(Self { view: View { camera, r_camera_from_ground, ..*view }, local_from_camera })
    }

    /// Where it shows what the camera shows at a pixel.
    pub(crate) fn pixel(&self, camera: &Camera, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let ray = self.local_from_camera * camera.direction_of(pixel)?;
        if ray.z > NARROWEST_RAY { self.view.camera.project(&ray) } else { None }
    }

    /// A box without its lens: each side moves as its middle does. A side whose middle is not shown becomes unknown.
    pub(crate) fn bbox(&self, camera: &Camera, bbox: Bbox) -> Bbox {
        bbox.moved_by_middles([self.view.camera.cx, self.view.camera.cy], |pixel| self.pixel(camera, pixel))
    }

    /// A vector of the camera's frame.
    pub(crate) fn to_camera(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.local_from_camera.tr_mul(vector)
    }

    /// A pose of this view as one of the camera.
    pub(crate) fn pose_to_camera(&self, pose: &Pose) -> Pose {
        Pose { r: self.local_from_camera.tr_mul(&pose.r), t: self.to_camera(&pose.t) }
    }

    /// `camera_from_local`.
    pub(crate) fn rotation_to_camera(&self) -> Matrix3<f64> {
        self.local_from_camera.transpose()
    }
}

/// How the direction changes by a pixel along a row (0) or a column (1), across the axis; one-sided at the lens's limit.
fn slope(camera: &Camera, centre: [f64; 2], axis: &Vector3<f64>, along: usize) -> Option<Vector3<f64>> {
    let at = |step: f64| {
        let mut pixel = centre;
        pixel[along] += step;
        camera.direction_of(pixel)
    };
    let slope = match (at(-STEP), at(STEP)) {
        (Some(before), Some(after)) => (after - before) / (2.0 * STEP),
        (Some(before), None) => (axis - before) / STEP,
        (None, Some(after)) => (after - axis) / STEP,
        (None, None) => return None,
    };
    Some(slope - axis * axis.dot(&slope))
}
