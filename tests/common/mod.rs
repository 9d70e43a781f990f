//! Common to several test binaries: an object with its camera as one value, and scenes with known truth.
#![allow(dead_code, reason = "every test binary uses its own part")]

use groundpose::synthetic::{Protocol, Scene, projected_bbox};
use groundpose::{
    Bbox, Camera, Estimate, EstimateError, Estimator, Footprint, GrowingWorkspace, InputError, NoPose, Observation,
    Options, Pose, ShapeModel, Tilt, View, Workspace,
};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// One object in one view: plain values that a test can change before they are checked and used.
#[derive(Clone, Debug)]
pub struct Case {
    pub view: View,
    pub keypoints_2d: Vec<[f64; 2]>,
    pub keypoints_3d: Vec<[f64; 3]>,
    pub basis: Vec<[f64; 3]>,
    pub eigenvalues: Vec<f64>,
    pub bbox_3d: [[f64; 3]; 2],
    /// One row per mode; empty: the box does not follow the shape.
    pub bbox_basis: Vec<[[f64; 3]; 2]>,
    pub footprint: Option<Vec<[f64; 2]>>,
    pub bbox: Option<[f64; 4]>,
    pub scores: Option<Vec<f64>>,
    pub inlier_threshold: Option<f64>,
    pub truth: Pose,
}

impl Case {
    /// A synthetic scene; the nominal pitch is zero, as in the protocol.
    pub fn of(protocol: &Protocol, scene: &Scene) -> Self {
        Self {
            view: View::new(protocol.camera(), Tilt::default()).unwrap(),
            keypoints_2d: scene.keypoints_2d.clone(),
            keypoints_3d: scene.keypoints_3d.clone(),
            basis: vec![],
            eigenvalues: vec![],
            bbox_3d: protocol.bbox_3d(),
            bbox_basis: vec![],
            footprint: None,
            bbox: Some(scene.bbox),
            scores: None,
            inlier_threshold: Some(scene.inlier_threshold),
            truth: scene.pose,
        }
    }

    /// Runs `f` with the checked observation of this object.
    pub fn try_with_observation<R>(&self, f: impl FnOnce(&Observation) -> R) -> Result<R, InputError> {
        let mut model =
            ShapeModel::rigid(&self.keypoints_3d, self.bbox_3d)?.with_modes(&self.basis, &self.eigenvalues)?;
        if !self.bbox_basis.is_empty() {
            model = model.with_bbox_basis(&self.bbox_basis)?;
        }
        if let Some(corners) = &self.footprint {
            model = model.with_footprint(Footprint::new(corners)?);
        }
        let mut observation = Observation::new(&self.keypoints_2d, &model)?;
        if let Some(scores) = &self.scores {
            observation = observation.with_scores(scores)?;
        }
        if let Some(bbox) = self.bbox {
            observation = observation.with_bbox(Bbox::new(bbox)?);
        }
        if let Some(threshold) = self.inlier_threshold {
            observation = observation.with_inlier_threshold(threshold)?;
        }
        Ok(f(&observation))
    }

    /// The same for an object that is known to be valid.
    pub fn with_observation<R>(&self, f: impl FnOnce(&Observation) -> R) -> R {
        self.try_with_observation(f).unwrap()
    }

    /// The estimate and its residuals.
    pub fn estimate(&self, options: Options) -> Result<(Estimate, Vec<f64>), NoPose> {
        let mut workspace = GrowingWorkspace::new();
        let estimator = Estimator::new(options).unwrap();
        let estimate = self.with_observation(|o| estimator.estimate(&self.view, o, &mut workspace)).map_err(reason)?;
        Ok((estimate, workspace.residuals().to_vec()))
    }

    /// Keypoints of a pose and shape in the camera frame.
    pub fn points_in_camera(&self, pose: &Pose, coefficients: &[f64]) -> Vec<[f64; 3]> {
        let point = |i: usize| {
            let mut x = self.keypoints_3d[i];
            for (m, lambda) in coefficients.iter().enumerate().take(self.eigenvalues.len()) {
                for axis in 0..3 {
                    x[axis] += lambda * self.basis[m * self.keypoints_3d.len() + i][axis];
                }
            }
            [0, 1, 2]
                .map(|row| pose.r[(row, 0)] * x[0] + pose.r[(row, 1)] * x[1] + pose.r[(row, 2)] * x[2] + pose.t[row])
        };
        (0..self.keypoints_3d.len()).map(point).collect()
    }

    /// Keypoints seen through an ideal lens; NaN = not seen.
    pub fn ideal_keypoints(&self) -> Vec<[f64; 2]> {
        let is_seen = |i: usize| self.scores.as_ref().is_none_or(|s| s[i] > 0.0);
        let ideal = |(i, &pixel)| is_seen(i).then(|| self.view.camera.undistort(pixel)).flatten();
        self.keypoints_2d.iter().enumerate().map(|p| ideal(p).unwrap_or([f64::NAN; 2])).collect()
    }

    /// Reprojection errors of a pose and shape, computed independently; only the lens is the crate's.
    pub fn residuals(&self, pose: &Pose, coefficients: &[f64]) -> Vec<f64> {
        let camera = &self.view.camera;
        let residual = |([u, v], [x, y, z]): ([f64; 2], [f64; 3])| {
            if u.is_nan() || v.is_nan() {
                return f64::NAN;
            }
            if z <= 0.0 {
                return f64::INFINITY;
            }
            (camera.fx * x / z + camera.cx - u).hypot(camera.fy * y / z + camera.cy - v)
        };
        self.ideal_keypoints().into_iter().zip(self.points_in_camera(pose, coefficients)).map(residual).collect()
    }
}

/// Why there is no pose, where nobody made a mistake.
#[track_caller]
pub fn reason(error: EstimateError) -> NoPose {
    match error {
        EstimateError::NoPose(reason) => reason,
        EstimateError::Input(mistake) => panic!("{mistake}"),
    }
}

/// Rotation from `a` to `b`, degrees.
pub fn angle_deg(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
    // sin(angle / 2) from the chord: exact for small angles, where an arccosine is not.
    (2.0 * ((a - b).norm() / 8.0_f64.sqrt()).min(1.0).asin()).to_degrees()
}

/// Asserts that two poses are one up to `tolerance` (radians; fraction of the distance).
#[track_caller]
pub fn assert_same_pose(a: &Pose, b: &Pose, tolerance: f64) {
    let (e_r, e_t) = (angle_deg(&a.r, &b.r).to_radians(), (a.t - b.t).norm() / b.t.norm());
    assert!(e_r <= tolerance && e_t <= tolerance, "e_r {e_r:e} rad, e_t {e_t:e}:\n{a:?}\n{b:?}");
}

/// Random numbers of the tests (SplitMix64).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn point(&mut self, [low, high]: [[f64; 3]; 2]) -> [f64; 3] {
        core::array::from_fn(|axis| self.between(low[axis], high[axis]))
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.between(0.0, 1.0)).ln()).sqrt();
        radius * (2.0 * core::f64::consts::PI * self.between(0.0, 1.0)).cos()
    }

    pub fn rotation(&mut self) -> Matrix3<f64> {
        let axis = Vector3::new(self.normal(), self.normal(), self.normal());
        let angle = self.between(0.0, core::f64::consts::PI);
        Rotation3::new(axis.normalize() * angle).into_inner()
    }

    /// An upright car-sized object without noise, 5 to 60 m from a camera with pitch 10 to -40 degrees (looking
    /// down) and roll -5 to 5 degrees; its 2D box is the extent of its projected 3D box.
    pub fn exact_car(&mut self, keypoints: usize) -> Case {
        loop {
            let fx = self.between(600.0, 1600.0);
            let camera = Camera::new(fx, fx * self.between(0.95, 1.05), 960.0, 540.0).unwrap();
            let tilt =
                Tilt { pitch: self.between(-40.0, 10.0).to_radians(), roll: self.between(-5.0, 5.0).to_radians() };
            let view = View::new(camera, tilt).unwrap();
            let low = [self.between(-1.5, -0.5), self.between(-2.0, -0.4), self.between(-4.0, -1.0)];
            let size = [self.between(1.5, 2.2), self.between(1.3, 2.2), self.between(3.5, 5.5)];
            let bbox_3d = [low, core::array::from_fn(|axis| low[axis] + size[axis])];
            let ray = view.ground_ray([self.between(96.0, 1824.0), self.between(108.0, 972.0)]);
            let distance = self.between(5.0, 60.0);
            let yaw = self.between(-core::f64::consts::PI, core::f64::consts::PI);
            let truth = Pose::upright(&view, yaw, ray.normalize() * distance);
            let keypoints_3d: Vec<_> = (0..keypoints).map(|_| self.point(bbox_3d)).collect();
            let pixels = keypoints_3d.iter().map(|&x| camera.project(&truth.transform(x))).collect();
            if let (Some(bbox), Some(keypoints_2d)) = (projected_bbox(&camera, &truth, &bbox_3d), pixels) {
                return Case {
                    view,
                    keypoints_2d,
                    keypoints_3d,
                    basis: vec![],
                    eigenvalues: vec![],
                    bbox_3d,
                    bbox_basis: vec![],
                    footprint: None,
                    bbox: Some(bbox),
                    scores: None,
                    inlier_threshold: None,
                    truth,
                };
            }
        }
    }
}
