//! What a tracker is told before it sees anything.

use crate::error::{Got, InputError, require};

/// What is known of the camera's own motion.
///
/// ```
/// use groundpose::{CameraMotion, TrackOptions};
///
/// assert_eq!(TrackOptions::default().camera_motion, CameraMotion::Static);
/// assert_eq!(CameraMotion::NAMES[CameraMotion::Unknown as usize], "unknown");
/// assert_eq!(CameraMotion::ALL[1], CameraMotion::Odometry);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum CameraMotion {
    /// The camera stays where it is.
    Static = 0,
    /// It moves, and every frame says how.
    Odometry = 1,
    /// It moves and nobody says how: places and speeds are relative to it, and do not say where a vehicle faces.
    Unknown = 2,
}

impl CameraMotion {
    /// The names used in Python, in order.
    pub const NAMES: [&'static str; 3] = ["static", "odometry", "unknown"];
    /// All of them, in order.
    pub const ALL: [Self; 3] = [Self::Static, Self::Odometry, Self::Unknown];
}

/// What a tracker is told before it sees anything.
///
/// ```
/// use groundpose::TrackOptions;
///
/// let slow = TrackOptions { acceleration_sigma: 0.5, ..TrackOptions::default() };
/// assert!(slow.check().is_ok());
/// let wrong = TrackOptions { longest_gap: -1.0, ..slow };
/// assert_eq!(wrong.check().unwrap_err().argument, "longest_gap");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackOptions {
    /// What is known of the camera's own motion.
    pub camera_motion: CameraMotion,
    /// Of a vehicle's acceleration along its axis, m/s^2.
    pub acceleration_sigma: f64,
    /// Of the change of its yaw rate within a second, rad/s.
    pub turning_sigma: f64,
    /// Of a vehicle's speed before anything is seen of it, m/s.
    pub speed_sigma: f64,
    /// Variance of a distance that is the same in all frames of a vehicle, in stated variances: nothing but motion of the
    /// camera makes a tracker surer of a scale than one picture.
    pub constant_fraction: f64,
    /// Variance of bearings and headings that is the same as long as the picture is, in stated ones; of distances a quarter
    /// of it.
    pub slow_fraction: f64,
    /// Variance that every frame has of its own, in stated ones; of distances half as much.
    pub own_fraction: f64,
    /// Within which a network forgets its errors when the picture stays the same, s.
    pub error_time: f64,
    /// Squared statistical distance up to which a sighting can belong to a vehicle.
    pub gate: f64,
    /// Sightings until a vehicle is one.
    pub least_sightings: usize,
    /// A vehicle not seen for longer has left, s.
    pub longest_gap: f64,
    /// Frames of a vehicle that are kept to be smoothed; when there are so many, the older half is handed out.
    pub longest_history: usize,
}

impl Default for TrackOptions {
    fn default() -> Self {
        Self {
            camera_motion: CameraMotion::Static,
            acceleration_sigma: 1.5,
            turning_sigma: 0.3,
            speed_sigma: 12.0,
            constant_fraction: 0.6,
            slow_fraction: 2.0,
            own_fraction: 0.8,
            error_time: 60.0,
            gate: 25.0,
            least_sightings: 3,
            longest_gap: 1.5,
            longest_history: 400,
        }
    }
}

impl TrackOptions {
    /// Whether every number can be.
    ///
    /// # Errors
    /// A number that is not finite or outside its range.
    pub fn check(&self) -> Result<(), InputError> {
        let positive = [
            ("acceleration_sigma", self.acceleration_sigma),
            ("turning_sigma", self.turning_sigma),
            ("speed_sigma", self.speed_sigma),
            ("error_time", self.error_time),
            ("gate", self.gate),
            ("longest_gap", self.longest_gap),
        ];
        for (argument, x) in positive {
            require(x > 0.0 && x <= 1e6, argument, "a number above 0, at most 1e6", Got::Number(x))?;
        }
        let fractions = [
            ("constant_fraction", self.constant_fraction, 0.0),
            ("slow_fraction", self.slow_fraction, 0.0),
            ("own_fraction", self.own_fraction, 0.01),
        ];
        for (argument, x, least) in fractions {
            let expected = "a fraction from 0 to 10, of own errors from 0.01";
            require((least..=10.0).contains(&x), argument, expected, Got::Number(x))?;
        }
        require(self.least_sightings >= 1, "least_sightings", "1 or more", Got::Count(self.least_sightings))?;
        let history = self.longest_history;
        require((4..=1_000_000).contains(&history), "longest_history", "4 to 1000000", Got::Count(history))
    }
}
