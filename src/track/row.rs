//! A vehicle at one time, as a tracker answers.

use nalgebra::Matrix2;

use crate::geometry::math::{atan2, cos, exp, sin, sqrt};
use crate::track::facing::Facing;
use crate::track::model::{ACCELERATION, AXIS, Belief, Camera2, SCALE, TURNING, X, Z, sum_of};
use crate::track::size::SizeEstimate;

/// A vehicle at one time.
///
/// ```
/// use groundpose::{Reading, Sighting, TrackOptions, TrackRow, VehicleFilter};
///
/// let reading = Reading { place: [2.0, 20.0], heading: 0.1, covariance: nalgebra::Matrix3::identity() * 0.01 };
/// let filter = VehicleFilter::new(&TrackOptions::default(), [0.0; 3], &Sighting::new(reading));
/// let row: TrackRow = filter.row([0.0; 3]);
/// assert!((row.place[1] - 20.0).abs() < 1e-6 && (row.seen_from[1] - 20.0).abs() < 1e-6);
/// assert!(row.place_covariance[(0, 0)] > 0.0 && row.heading_sigma < 0.2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackRow {
    /// Number of the vehicle, from 1 in order of appearance; never used again.
    pub id: u64,
    /// Number of the frame, from 0.
    pub frame: u64,
    /// Seconds, as given.
    pub time: f64,
    /// Its class.
    pub class: usize,
    /// Number of the sighting that it was in this frame; none: not seen.
    pub sighting: Option<usize>,
    /// In the plane of the first frame: right and forward of the camera then, metres.
    pub place: [f64; 2],
    /// Of the place.
    pub place_covariance: Matrix2<f64>,
    /// Radians in that plane, -pi to pi; 0 = forward, pi / 2 = to the right.
    pub heading: f64,
    /// Its standard deviation, if it does not face the other way.
    pub heading_sigma: f64,
    /// Probability that it does not face the other way.
    pub facing_probability: f64,
    /// Metres per second along the heading; negative: it reverses. Relative to a camera whose motion is not known.
    pub speed: f64,
    /// Its standard deviation.
    pub speed_sigma: f64,
    /// Radians per second, positive to the right.
    pub yaw_rate: f64,
    /// Its standard deviation.
    pub yaw_rate_sigma: f64,
    /// Metres per second squared along the heading.
    pub acceleration: f64,
    /// Its standard deviation.
    pub acceleration_sigma: f64,
    /// Length, height, width, metres; NaN = not known.
    pub size: [f64; 3],
    /// Their standard deviations.
    pub size_sigma: [f64; 3],
    /// Whether it stands still.
    pub standing: bool,
    /// Place right and forward of the camera now, metres, and heading against the camera's, radians.
    pub seen_from: [f64; 3],
}

/// What of a row is not in the belief.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told {
    pub(crate) facing: Facing,
    pub(crate) size: SizeEstimate,
    pub(crate) standing: bool,
    /// Of a stated variance of a size, what all frames share, and what each has of its own.
    pub(crate) shared: f64,
    pub(crate) own: f64,
}

/// Of a belief at a time; id, frame and the like are the caller's to fill in.
pub(crate) fn row_of(belief: &Belief, told: &Told, camera: &Camera2) -> TrackRow {
    let side = told.facing.side();
    let (along, by_along) = belief.along();
    let heading = belief.mean[AXIS] + if side < 0.0 { core::f64::consts::PI } else { 0.0 };
    let sigma = |k: usize| sqrt(belief.covariance[(k, k)].max(0.0));
    let smaller = exp(-belief.mean[SCALE]);
    let (size, size_sigma) =
        told.size.of(belief.mean[SCALE], belief.covariance[(SCALE, SCALE)], (told.shared, told.own));
    let place = place_of(belief, smaller, camera);
    let [vx, vz, axis] = by_along.map(|(k, by)| (k, by * smaller));
    let by_speed = [vx, vz, axis, (SCALE, -smaller * along)];
    let by_acceleration = [(ACCELERATION, smaller), (SCALE, -smaller * belief.mean[ACCELERATION])];
    let p = told.facing.probability();
    TrackRow {
        id: 0,
        frame: 0,
        time: 0.0,
        class: 0,
        sighting: None,
        place,
        place_covariance: place_covariance(belief, smaller),
        heading: wrapped(heading),
        heading_sigma: sigma(AXIS),
        facing_probability: p.max(1.0 - p),
        speed: side * smaller * along,
        speed_sigma: sqrt(belief.variance(&by_speed)),
        yaw_rate: belief.mean[TURNING],
        yaw_rate_sigma: sigma(TURNING),
        acceleration: side * smaller * belief.mean[ACCELERATION],
        acceleration_sigma: sqrt(belief.variance(&by_acceleration)),
        size,
        size_sigma,
        standing: told.standing,
        seen_from: seen_from(place, heading, camera),
    }
}

fn place_of(belief: &Belief, smaller: f64, camera: &Camera2) -> [f64; 2] {
    [camera.place[0] + smaller * belief.mean[X], camera.place[1] + smaller * belief.mean[Z]]
}

fn place_covariance(belief: &Belief, smaller: f64) -> Matrix2<f64> {
    let by_state = [X, Z].map(|k| [(k, smaller), (SCALE, -smaller * belief.mean[k])]);
    let ph = by_state.map(|terms| belief.times(&terms));
    Matrix2::from_fn(|i, j| sum_of(&by_state[j], &ph[i]))
}

fn seen_from(place: [f64; 2], heading: f64, camera: &Camera2) -> [f64; 3] {
    let [x, z] = place_seen_from(place, camera);
    [x, z, wrapped(heading - camera.yaw)]
}

fn place_seen_from([x, z]: [f64; 2], camera: &Camera2) -> [f64; 2] {
    let (s, c) = (camera.sin, camera.cos);
    let (x, z) = (x - camera.place[0], z - camera.place[1]);
    [x * c - z * s, x * s + z * c]
}

/// The place of a row, right and forward of the camera.
#[cfg(feature = "std")]
pub(crate) fn where_seen(belief: &Belief, camera: &Camera2) -> [f64; 2] {
    place_seen_from(place_of(belief, exp(-belief.mean[SCALE]), camera), camera)
}

/// The same angle between -pi and pi.
pub(crate) fn wrapped(angle: f64) -> f64 {
    atan2(sin(angle), cos(angle))
}
