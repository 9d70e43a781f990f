//! A vehicle in one frame, as a tracker takes it.

use nalgebra::{Matrix2x3, Matrix3, SMatrix, Vector3};

use crate::error::{Got, InputError, require};
use crate::geometry::math::atan2;
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::refine::covariance::PoseCovariance;

/// Where a vehicle stands and faces, on the ground plane below the camera.
///
/// ```
/// use groundpose::{Camera, Pose, PoseCovariance, Reading, Tilt, View};
///
/// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt { pitch: -0.1, roll: 0.0 })?;
/// let pose = Pose::upright(&view, 0.5, [3.0, 1.5, 20.0].into());
/// let reading = Reading::of(&view, &pose, &(PoseCovariance::identity() * 1e-4), [0.0; 3])?;
/// assert!((reading.place[0] - 3.0).abs() < 1e-9 && (reading.place[1] - 20.0).abs() < 1e-9);
/// assert!((reading.heading - 0.5).abs() < 1e-9);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Right and forward of the camera, metres: the middle of the bottom face.
    pub place: [f64; 2],
    /// Radians; 0 = away from the camera, pi / 2 = to the right.
    pub heading: f64,
    /// Of place and heading.
    pub covariance: Matrix3<f64>,
}

impl Reading {
    /// Of a pose with its covariance; `bottom_centre` is the middle of the vehicle's bottom face in its own frame.
    ///
    /// # Errors
    /// Numbers that are not finite, a covariance without positive variances.
    pub fn of(
        view: &View,
        pose: &Pose,
        covariance: &PoseCovariance,
        bottom_centre: [f64; 3],
    ) -> Result<Self, InputError> {
        let ground = &view.r_camera_from_ground;
        let arm = pose.r * Vector3::from(bottom_centre);
        let place = ground.tr_mul(&(arm + pose.t));
        let ahead = ground.tr_mul(&pose.r.column(2));
        // A rotation on the left moves the place by w x arm, and turns the vehicle about the ground's normal.
        let right_and_forward = Matrix2x3::from_rows(&[ground.column(0).transpose(), ground.column(2).transpose()]);
        let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
        by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&(right_and_forward * -arm.cross_matrix()));
        by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&right_and_forward);
        by_pose.fixed_view_mut::<1, 3>(2, 0).copy_from(&ground.column(1).transpose());
        let covariance = by_pose * covariance * by_pose.transpose();
        let heading = atan2(ahead[0], ahead[2]);
        Self { place: [place[0], place[2]], heading, covariance }.checked()
    }

    /// Itself, if its numbers can be.
    fn checked(self) -> Result<Self, InputError> {
        let finite = self.place.iter().chain([&self.heading]).chain(self.covariance.iter()).all(|x| x.is_finite());
        require(finite, "pose", "finite numbers", Got::Text("NaN or infinite"))?;
        let [x, z] = self.place;
        require(x.abs().max(z.abs()) < 1e5, "pose", "a place within 100 km", Got::Pair(x, z))?;
        let least = self.covariance.diagonal().min();
        require(least > 0.0, "covariance", "positive variances", Got::Number(least))?;
        Ok(self)
    }
}

/// A vehicle in one frame.
///
/// ```
/// use groundpose::{Reading, Sighting};
///
/// let reading = Reading { place: [2.0, 20.0], heading: 0.1, covariance: nalgebra::Matrix3::identity() * 0.01 };
/// let seen = Sighting { class: 1, ..Sighting::new(reading) };
/// assert!(seen.check().is_ok() && seen.other.is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// The caller's number of it, which rows give back.
    pub number: usize,
    /// The answer.
    pub reading: Reading,
    /// Another reading of the same picture, and the probability that it is the right one.
    pub other: Option<(Reading, f64)>,
    /// Probability that the vehicle faces the half of the directions turned away from `reading`.
    pub turned: f64,
    /// Degrees of freedom of Student's t of the errors; infinite: Gaussian.
    pub error_dof: f64,
    /// Number of its class.
    pub class: usize,
    /// Length, height, width, metres; NaN = not known.
    pub size: [f64; 3],
    /// Their standard deviations, metres.
    pub size_sigma: [f64; 3],
    /// 2D box: left, top, right, bottom, pixels; NaN = not known.
    pub bbox: [f64; 4],
    /// Probability that the answer is right.
    pub probability: f64,
}

impl Sighting {
    /// One of which nothing else is known.
    #[must_use]
    pub fn new(reading: Reading) -> Self {
        Self {
            number: 0,
            reading,
            other: None,
            turned: 0.5,
            error_dof: f64::INFINITY,
            class: 0,
            size: [f64::NAN; 3],
            size_sigma: [f64::NAN; 3],
            bbox: [f64::NAN; 4],
            probability: 0.9,
        }
    }

    /// Whether its numbers can be.
    ///
    /// # Errors
    /// Numbers that are not finite, variances that are not positive, probabilities that are none.
    pub fn check(&self) -> Result<(), InputError> {
        self.reading.checked()?;
        let other = self.other.map_or(Ok(0.0), |(reading, p)| reading.checked().map(|_| p))?;
        let probabilities =
            [("alternative_probability", other), ("ambiguity", self.turned), ("probability", self.probability)];
        for (argument, p) in probabilities {
            require((0.0..=1.0).contains(&p), argument, "a probability", Got::Number(p))?;
        }
        require(self.error_dof > 2.0, "error_dof", "above 2", Got::Number(self.error_dof))
    }
}
