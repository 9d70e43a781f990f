//! Scenes with known truth: the one generator of tests, benches and Python.
//!
//! `Cube` is the paper's protocol E1 to E4 (sec. 4.1); `Vehicle` is V1, vehicle-like objects on flat ground seen by
//! a camera that pitches. Trial `k` depends on (seed, k) only.

use nalgebra::Vector3;

use crate::error::{Got, InputError, require};
use crate::geometry::camera::Camera;
use crate::geometry::math::{cos, log, sqrt};
use crate::geometry::pose::Pose;
use crate::geometry::view::{Tilt, View};
use crate::search::sampler::Stream;
use crate::tuning::RELATIVE_THRESHOLD;

/// Which scenes.
///
/// ```
/// use groundpose::synthetic::{Kind, Protocol};
///
/// let cube = Protocol { kind: Kind::Cube, ..Protocol::default() };
/// assert_eq!(cube.bbox_3d(), [[-2.0; 3], [2.0; 3]]);
/// assert_eq!(cube.camera().image_size, Some([640.0, 480.0]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Points in a cube of 4 m, 20 to 40 m away (paper, sec. 4.1.1).
    Cube,
    /// 20 to 30 points in a box of vehicle size on the ground, 8 to 60 m away.
    Vehicle,
}

/// Where outliers fall.
///
/// ```
/// use groundpose::synthetic::{Kind, Outliers, Protocol};
///
/// let protocol = Protocol { kind: Kind::Vehicle, outliers: Outliers::Box, ..Protocol::default() };
/// let scene = protocol.scene(0, 3);
/// let [left, _, right, _] = scene.bbox;
/// let mut wrong = scene.keypoints_2d.iter().zip(&scene.is_inlier).filter(|(_, inlier)| !**inlier);
/// assert!(wrong.all(|(pixel, _)| pixel[0] >= left && pixel[0] <= right));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outliers {
    /// Uniformly over the image.
    Image,
    /// Uniformly over the object's 2D box: harder, closer to a real detector.
    Box,
}

/// What kind of error the box sides have.
///
/// ```
/// use groundpose::synthetic::{BboxError, Protocol};
///
/// let exact = Protocol::default();
/// let moved = Protocol { bbox_error: 3.0, bbox_error_kind: BboxError::Shift, ..exact };
/// let right = |protocol: Protocol| protocol.scene(0, 1).bbox[2];
/// assert!((right(moved) - right(exact) - 3.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BboxError {
    /// Both sides moved outward.
    Outward,
    /// Both sides moved to the right.
    Shift,
}

/// What to generate.
///
/// ```
/// use groundpose::synthetic::{Kind, Protocol};
///
/// let protocol = Protocol { kind: Kind::Vehicle, ..Protocol::default() };
/// protocol.check()?;
/// let scene = protocol.scene(0, 7);
/// assert_eq!(scene.keypoints_2d.len(), scene.keypoints_3d.len());
/// assert!(scene.is_inlier.iter().any(|&inlier| !inlier));
/// assert_eq!(scene.pose, protocol.scene(0, 7).pose, "trial 7 of seed 0 is always the same");
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Protocol {
    /// Which scenes.
    pub kind: Kind,
    /// Number of points (`Cube` only).
    pub n_points: usize,
    /// Fraction of outliers (`Cube` only; `Vehicle` draws 20 to 50 %).
    pub outlier_ratio: f64,
    /// Where outliers fall.
    pub outliers: Outliers,
    /// Noise of a coordinate, pixels (`Cube` only; `Vehicle` draws 1 to 3 % of the box).
    pub noise_sigma: f64,
    /// True pitch, radians; the nominal one is 0 (`Cube` only; `Vehicle` draws it with 1.5 degrees).
    pub pitch_error: f64,
    /// Error of the box sides, pixels.
    pub bbox_error: f64,
    /// Kind of that error.
    pub bbox_error_kind: BboxError,
}

impl Default for Protocol {
    fn default() -> Self {
        Self {
            kind: Kind::Cube,
            n_points: 300,
            outlier_ratio: 0.5,
            outliers: Outliers::Image,
            noise_sigma: 2.0,
            pitch_error: 0.0,
            bbox_error: 0.0,
            bbox_error_kind: BboxError::Outward,
        }
    }
}

/// One object and its truth.
///
/// ```
/// use groundpose::synthetic::{Protocol, Scene};
///
/// let protocol = Protocol { outlier_ratio: 0.0, noise_sigma: 0.0, ..Protocol::default() };
/// let scene: Scene = protocol.scene(0, 0);
/// let seen = protocol.camera().project(&scene.pose.transform(scene.keypoints_3d[0])).unwrap();
/// assert!((seen[0] - scene.keypoints_2d[0][0]).abs() < 1e-9);
/// ```
#[derive(Clone, Debug)]
pub struct Scene {
    /// Observed keypoints, pixels.
    pub keypoints_2d: Vec<[f64; 2]>,
    /// Model keypoints, metres.
    pub keypoints_3d: Vec<[f64; 3]>,
    /// Whether a keypoint is an inlier.
    pub is_inlier: Vec<bool>,
    /// Observed `left, top, right, bottom`.
    pub bbox: [f64; 4],
    /// True pose.
    pub pose: Pose,
    /// True pitch, radians.
    pub pitch: f64,
    /// Inlier threshold of the protocol, pixels.
    pub inlier_threshold: f64,
    /// True noise of a coordinate, pixels.
    pub noise_sigma: f64,
}

const VEHICLE_HALF_SIZE: [f64; 3] = [0.9, 0.75, 2.25];
const VEHICLE_CAMERA_HEIGHT: f64 = 1.5;
const VEHICLE_PITCH_SIGMA_DEG: f64 = 1.5;

impl Protocol {
    /// # Errors
    /// A value outside its range.
    pub fn check(&self) -> Result<(), InputError> {
        let r = self.outlier_ratio;
        require((0.0..1.0).contains(&r), "outlier_ratio", "a fraction in [0, 1)", Got::Number(r))?;
        require(self.n_points >= 1, "n_points", "at least 1", Got::Count(self.n_points))?;
        let s = self.noise_sigma;
        require(s.is_finite() && s >= 0.0, "noise_sigma", "pixels >= 0", Got::Number(s))?;
        let p = self.pitch_error;
        require(p.is_finite() && p.abs() < 1.0, "pitch_error_deg", "less than 57 degrees", Got::Number(p))?;
        let b = self.bbox_error;
        require(b.is_finite(), "bbox_error", "a finite number of pixels", Got::Number(b))
    }

    /// The camera of the protocol.
    #[must_use]
    pub fn camera(&self) -> Camera {
        let (f, width, height) = match self.kind {
            Kind::Cube => (800.0, 640.0, 480.0),
            Kind::Vehicle => (1000.0, 1914.0, 1080.0),
        };
        Camera { fx: f, fy: f, cx: 0.5 * width, cy: 0.5 * height, lens: None, image_size: Some([width, height]) }
    }

    /// 3D box of the object.
    #[must_use]
    pub fn bbox_3d(&self) -> [[f64; 3]; 2] {
        let half = match self.kind {
            Kind::Cube => [2.0; 3],
            Kind::Vehicle => VEHICLE_HALF_SIZE,
        };
        [half.map(|x| -x), half]
    }

    /// Scene number `trial`.
    #[must_use]
    pub fn scene(&self, seed: u64, trial: u64) -> Scene {
        let mut random = Stream::new(seed, trial);
        let camera = self.camera();
        let (pose, pitch, bbox) = self.draw_pose(&mut random, &camera);
        let longer = (bbox[2] - bbox[0]).max(bbox[3] - bbox[1]);
        let (count, ratio, noise_sigma, inlier_threshold) = match self.kind {
            Kind::Cube => (self.n_points, self.outlier_ratio, self.noise_sigma, 4.0),
            Kind::Vehicle => {
                let count = 20 + random.below(11);
                let noise = longer * (0.01 + 0.02 * random.uniform());
                (count, 0.2 + 0.3 * random.uniform(), noise, RELATIVE_THRESHOLD * longer)
            }
        };
        let [min, max] = self.bbox_3d();
        let keypoints_3d: Vec<[f64; 3]> = (0..count)
            .map(|_| core::array::from_fn(|axis| min[axis] + (max[axis] - min[axis]) * random.uniform()))
            .collect();
        let mut order: Vec<u32> = (0..count as u32).collect();
        random.shuffle(&mut order);
        let outlier_count = (ratio * count as f64).round() as usize;
        let mut is_inlier = vec![true; count];
        for &i in &order[..outlier_count] {
            is_inlier[i as usize] = false;
        }
        let area = match (self.outliers, self.kind) {
            (Outliers::Image, Kind::Cube) => {
                let [width, height] = camera.image_size.unwrap_or_default();
                [0.0, 0.0, width, height]
            }
            _ => bbox,
        };
        let keypoints_2d = (0..count)
            .map(|i| {
                let noise = random.normal_pair();
                let place = [random.uniform(), random.uniform()];
                match camera.project(&pose.transform(keypoints_3d[i])) {
                    Some([u, v]) if is_inlier[i] => [u + noise_sigma * noise[0], v + noise_sigma * noise[1]],
                    _ => [0, 1].map(|axis| area[axis] + (area[axis + 2] - area[axis]) * place[axis]),
                }
            })
            .collect();
        let e = self.bbox_error;
        let moved = match self.bbox_error_kind {
            BboxError::Outward => [bbox[0] - e, bbox[1], bbox[2] + e, bbox[3]],
            BboxError::Shift => [bbox[0] + e, bbox[1], bbox[2] + e, bbox[3]],
        };
        Scene { keypoints_2d, keypoints_3d, is_inlier, bbox: moved, pose, pitch, inlier_threshold, noise_sigma }
    }

    /// A pose whose whole 3D box is in the image (`Vehicle`) or anywhere the paper's ranges put it (`Cube`).
    fn draw_pose(&self, random: &mut Stream, camera: &Camera) -> (Pose, f64, [f64; 4]) {
        let [width, height] = camera.image_size.unwrap_or_default();
        loop {
            let (pitch, centre) = match self.kind {
                Kind::Cube => {
                    let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
                    (self.pitch_error, Vector3::new(between(-4.0, 4.0), between(-1.0, 1.0), between(20.0, 40.0)))
                }
                Kind::Vehicle => {
                    let pitch = VEHICLE_PITCH_SIGMA_DEG.to_radians() * random.normal_pair()[0];
                    let depth = 8.0 + 52.0 * random.uniform();
                    let bearing = 0.9 * (2.0 * random.uniform() - 1.0) * 0.5 * width / camera.fx;
                    let y = VEHICLE_CAMERA_HEIGHT - VEHICLE_HALF_SIZE[1];
                    (pitch, Vector3::new(depth * bearing, y, depth))
                }
            };
            let yaw = core::f64::consts::PI * (2.0 * random.uniform() - 1.0);
            let Ok(view) = View::new(*camera, Tilt { pitch, roll: 0.0 }) else {
                continue;
            };
            let pose = Pose::upright(&view, yaw, centre);
            let Some(bbox) = projected_bbox(camera, &pose, &self.bbox_3d()) else {
                continue;
            };
            let inside = bbox[0] >= 0.0 && bbox[1] >= 0.0 && bbox[2] < width && bbox[3] < height;
            if inside || self.kind == Kind::Cube {
                return (pose, pitch, bbox);
            }
        }
    }
}

/// Extent of the eight projected corners of a 3D box; `None` when one is behind the camera.
///
/// ```
/// use groundpose::{Camera, Pose, Tilt, View};
/// use groundpose::synthetic::projected_bbox;
///
/// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?;
/// let cube = [[-1.0; 3], [1.0; 3]];
/// let ahead = Pose::upright(&view, 0.0, [0.0, 0.0, 11.0].into());
/// assert_eq!(projected_bbox(&view.camera, &ahead, &cube), Some([860.0, 440.0, 1060.0, 640.0]));
/// let behind = Pose::upright(&view, 0.0, [0.0, 0.0, -11.0].into());
/// assert_eq!(projected_bbox(&view.camera, &behind, &cube), None);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[must_use]
pub fn projected_bbox(camera: &Camera, pose: &Pose, bbox_3d: &[[f64; 3]; 2]) -> Option<[f64; 4]> {
    let mut bbox = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for corner in 0..8 {
        let point = core::array::from_fn(|axis| bbox_3d[(corner >> axis) & 1][axis]);
        let [u, v] = camera.project(&pose.transform(point))?;
        bbox = [bbox[0].min(u), bbox[1].min(v), bbox[2].max(u), bbox[3].max(v)];
    }
    Some(bbox)
}

impl Stream {
    /// Two independent standard normal numbers (Box and Muller).
    pub(crate) fn normal_pair(&mut self) -> [f64; 2] {
        let radius = sqrt(-2.0 * log(1.0 - self.uniform()));
        let angle = 2.0 * core::f64::consts::PI * self.uniform();
        [radius * cos(angle), radius * crate::geometry::math::sin(angle)]
    }
}
