//! Frames with known truth, drawn from the priors that the solve is given.

use groundpose::{
    Camera, Frame, FrameAnswer, FrameObject, FramePriors, Pose, PoseCovariance, ScalePrior, Tilt, View, solve_frame,
};
use nalgebra::{Rotation3, SMatrix, Vector3, Vector6};

use crate::common::Random;

/// Where the bottom centre is in the object frame.
pub const BOTTOM_CENTRE: [f64; 3] = [0.05, 0.4, -0.3];

pub fn camera() -> Camera {
    Camera::new(1000.0, 1000.0, 960.0, 540.0).unwrap()
}

pub struct Scene {
    pub nominal: View,
    pub truth: View,
    pub priors: FramePriors,
    /// Pose, covariance and class as an estimate of the object alone has them.
    pub objects: Vec<(Pose, PoseCovariance, usize)>,
    /// Pose and log size.
    pub true_objects: Vec<(Pose, f64)>,
}

impl Scene {
    /// A camera on a car.
    pub fn draw(random: &mut Random, objects: usize) -> Self {
        let tilt = Tilt { pitch: random.between(-0.05, 0.05), roll: random.between(-0.05, 0.05) };
        let priors = FramePriors::default();
        let nominal = View::new(camera(), tilt).unwrap().with_height(random.between(1.2, 2.0)).unwrap();
        Self::with(random, objects, nominal, priors, [6.0, 45.0])
    }

    /// A camera above a road that hardly bends, whose tilt is known to three degrees.
    pub fn road_side(random: &mut Random, objects: usize) -> Self {
        let tilt = Tilt { pitch: random.between(-0.5, -0.2), roll: 0.0 };
        let sigma = 3.0_f64.to_radians();
        let priors = FramePriors { pitch_sigma: sigma, roll_sigma: sigma, curvature: 2e-5, ..FramePriors::default() };
        let nominal = View::new(camera(), tilt).unwrap().with_height(7.0).unwrap();
        Self::with(random, objects, nominal, priors, [10.0, 50.0])
    }

    fn with(
        random: &mut Random,
        objects: usize,
        nominal: View,
        mut priors: FramePriors,
        [near, far]: [f64; 2],
    ) -> Self {
        priors.scales[1] = ScalePrior { log_mean: 0.1, sigma: 0.06, own_sigma: 0.08 };
        let tilt = Tilt {
            pitch: nominal.tilt.pitch + priors.pitch_sigma * random.normal(),
            roll: nominal.tilt.roll + priors.roll_sigma * random.normal(),
        };
        let height = nominal.height.unwrap() * (priors.height_sigma * random.normal()).exp();
        let truth = View::new(nominal.camera, tilt).unwrap().with_height(height).unwrap();
        let class_sizes: [f64; 2] =
            core::array::from_fn(|k| priors.scales[k].log_mean + priors.scales[k].sigma * random.normal());
        let mut scene = Self { nominal, truth, priors, objects: vec![], true_objects: vec![] };
        for k in 0..objects {
            let class = k % 2;
            let log_size = class_sizes[class] + priors.scales[class].own_sigma * random.normal();
            let z = random.between(near, far);
            let x = random.between(-0.4, 0.4) * z;
            scene.add(random, class, log_size, [x, z]);
        }
        scene
    }

    /// Objects of a frame whose truth is given.
    fn of(random: &mut Random, nominal: View, truth: View, class_sizes: &[f64; 2], objects: usize) -> Self {
        let mut scene = Self { nominal, truth, priors: FramePriors::default(), objects: vec![], true_objects: vec![] };
        for k in 0..objects {
            let z = random.between(6.0, 45.0);
            let log_size = class_sizes[k % 2] + scene.priors.scales[k % 2].own_sigma * random.normal();
            let x = random.between(-0.4, 0.4) * z;
            scene.add(random, k % 2, log_size, [x, z]);
        }
        scene
    }

    fn add(&mut self, random: &mut Random, class: usize, log_size: f64, [x, z]: [f64; 2]) {
        let height = self.truth.height.unwrap();
        let distance = Vector3::new(x, height, z).norm();
        let bend = 0.5 * self.priors.curvature * x.hypot(z).powi(2);
        let unevenness =
            (self.priors.roughness.powi(2) + (self.priors.slope * distance).powi(2) + bend.powi(2)).sqrt() / height;
        let y = height * (unevenness * random.normal()).exp();
        // The bottom centre of the object, as large as it is, stands on the road.
        let mut pose = Pose::upright(&self.truth, random.between(-3.0, 3.0), [x, y, z].into());
        pose.t -= pose.r * Vector3::from(BOTTOM_CENTRE) * log_size.exp();
        // Rotation and lateral place are well known, the depth and the ray's height less.
        let root = SMatrix::<f64, 6, 6>::from_fn(|_, _| 0.3 * random.normal());
        let sigmas = Vector6::new(0.01, 0.02, 0.01, 0.002 * z, 0.002 * z, 0.04 * z);
        let scaled = SMatrix::<f64, 6, 6>::from_diagonal(&sigmas) * (SMatrix::<f64, 6, 6>::identity() + root);
        let covariance = scaled * scaled.transpose();
        let off = scaled * Vector6::from_fn(|_, _| random.normal());
        // `(R, t) exp(size) = exp(off) estimate`
        let rotation = Rotation3::new(Vector3::new(-off[0], -off[1], -off[2]));
        let t = pose.t * (-log_size).exp() - Vector3::new(off[3], off[4], off[5]);
        self.objects.push((Pose { r: rotation * pose.r, t }, covariance, class));
        self.true_objects.push((pose, log_size));
    }

    /// One object is taken to be far too near.
    pub fn spoil(&mut self, k: usize) {
        self.objects[k].0.t *= 0.4;
    }

    /// One object is put anywhere on its ray.
    pub fn scatter(&mut self, k: usize, random: &mut Random) {
        self.objects[k].0.t *= (0.5 * random.normal()).exp();
    }

    pub fn frame_objects(&self) -> Vec<FrameObject> {
        let made = |&(pose, covariance, class)| FrameObject::new(pose, covariance, BOTTOM_CENTRE, class).unwrap();
        self.objects.iter().map(made).collect()
    }
}

/// The nominal view of a camera on a car, the mean true one of a drive, and the true log sizes of two classes.
pub fn drive(random: &mut Random) -> (View, View, [f64; 2]) {
    let priors = FramePriors::default();
    let nominal = View::new(camera(), Tilt::default()).unwrap().with_height(1.6).unwrap();
    let tilt = Tilt { pitch: priors.pitch_sigma * random.normal(), roll: priors.roll_sigma * random.normal() };
    let height = 1.6 * (priors.height_sigma * random.normal()).exp();
    let truth = View::new(camera(), tilt).unwrap().with_height(height).unwrap();
    (nominal, truth, [0, 1].map(|k| priors.scales[k].sigma * random.normal()))
}

/// A frame of a drive: its own tilt and height about the mean.
pub fn camera_scene(random: &mut Random, nominal: &View, mean: &View, class_sizes: &[f64; 2]) -> Scene {
    let degrees = |sigma: f64, random: &mut Random| sigma.to_radians() * random.normal();
    let tilt = Tilt { pitch: mean.tilt.pitch + degrees(0.3, random), roll: mean.tilt.roll + degrees(0.7, random) };
    let height = mean.height.unwrap() * (0.02 * random.normal()).exp();
    let truth = View::new(mean.camera, tilt).unwrap().with_height(height).unwrap();
    Scene::of(random, *nominal, truth, class_sizes, 5)
}

pub fn solved(scene: &Scene) -> (Frame, Vec<FrameAnswer>) {
    let objects = scene.frame_objects();
    let mut answers = vec![FrameAnswer::default(); objects.len()];
    let frame = solve_frame(&scene.nominal, &scene.priors, &objects, &mut answers).unwrap();
    (frame, answers)
}

/// Rotation vector on the left and translation from the true to the estimated pose.
pub fn pose_error(estimate: &Pose, truth: &Pose) -> Vector6<f64> {
    let turn = Rotation3::from_matrix_unchecked(estimate.r * truth.r.transpose()).scaled_axis();
    let t = estimate.t - truth.t;
    Vector6::new(turn.x, turn.y, turn.z, t.x, t.y, t.z)
}
