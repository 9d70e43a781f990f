//! One vehicle over time.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::geometry::math::{atan2, cos, exp, log, sqrt, square};
use crate::track::facing::Facing;
use crate::track::measure::{Expected, OF_DISTANCE, PlacedReading, PlacedSighting, SLOW_OF_DISTANCE};
use crate::track::model::{
    ACCELERATION, AXIS, Belief, Camera2, ERRORS, Motion, SCALE, State, StateMatrix, TURNING, Transition, VX, VZ, X, Z,
};
use crate::track::options::{CameraMotion, TrackOptions};
use crate::track::row::{Told, TrackRow, row_of, wrapped};
use crate::track::sighting::Sighting;
use crate::track::size::SizeEstimate;
use crate::track::standing;

/// A network's errors are others when a vehicle has turned by so much, as the camera sees it, or is nearer by this factor,
/// a logarithm.
const SAME_PICTURE: (f64, f64) = (0.35, 0.35);
/// How much a picture changes what is usual.
const STATED_KEEPS: f64 = 0.1;
/// Frames nearer in time than this show a front taken for a rear again.
const PICTURE_TIME: f64 = 0.5;
/// Of a place before anything is seen of it, metres; of an axis, rad.
const NOWHERE: f64 = 1e3;
const ANY_AXIS: f64 = 1.5;
/// Of a yaw rate before anything is seen of it, rad/s.
const ANY_TURNING: f64 = 0.3;
/// Of the scale when readings do not bound it.
const ANY_SCALE: f64 = 0.1;
/// The rear axle is so far behind the middle, in lengths; a vehicle does not slip there.
const AXLE: f64 = 0.3;
const USUAL_LENGTH: f64 = 4.3;
/// Slipping: m/s, fraction of the speed, fraction of what the axle explains; forgotten within so many seconds.
const SLIP: (f64, f64, f64, f64) = (0.1, 0.01, 0.5, 0.5);
/// Of the velocity of one that has moved and may stand, m/s.
const SLOWING_SIGMA: f64 = 2.0;
/// A vehicle has moved: speed, m/s, beside so many standard deviations.
const SURELY_MOVES: (f64, f64) = (0.3, 2.5);
/// Places that drift away, squared statistical distance of their mean over so many seconds: it has moved off.
const MOVED_OFF: (f64, f64) = (16.0, 0.7);
/// Standard deviation of its velocity then.
const MOVING_OFF_SIGMA: f64 = 3.0;
/// What a wrong axis, and a front in place of a rear, say at most against a pair.
#[cfg(feature = "std")]
const MOST_OF_AXIS: f64 = 3.0;
#[cfg(feature = "std")]
const LEAST_FACING: f64 = 0.03;
/// Errors of poses have tails at least and at most as heavy as Student's t with so many degrees of freedom.
const DOF: (f64, f64) = (3.0, 8.0);

/// What is known of one vehicle, frame after frame.
///
/// ```
/// use groundpose::{Reading, Sighting, TrackOptions, VehicleFilter};
///
/// // A car that drives away with 10 m/s, seen ten times a second.
/// let at = |k: usize| {
///     let covariance = nalgebra::Matrix3::identity() * 1e-4;
///     let reading = Reading { place: [2.0, 20.0 + k as f64], heading: 0.0, covariance };
///     Sighting { turned: 0.3, ..Sighting::new(reading) }
/// };
/// let camera = [0.0; 3];
/// let mut filter = VehicleFilter::new(&TrackOptions::default(), camera, &at(0));
/// for k in 1..20 {
///     filter.predict(0.1, camera);
///     assert!(filter.distance2(camera, &at(k)) < 18.0);
///     filter.update(camera, 0.1, &at(k));
/// }
/// let row = filter.row(camera);
/// assert!((row.speed - 10.0).abs() < 0.5, "{}", row.speed);
/// assert!(row.facing_probability > 0.99);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct VehicleFilter {
    pub(crate) belief: Belief,
    facing: Facing,
    size: SizeEstimate,
    scale_sigma: f64,
    /// Means of the logarithms of stated standard deviations: of distance and bearing, in distances, and of heading.
    stated: Vector3<f64>,
    standing: bool,
    has_moved: bool,
    drift: Vector2<f64>,
    camera: Camera2,
    options: TrackOptions,
}

impl VehicleFilter {
    /// A vehicle that is seen for the first time; `camera`: where the camera stands, right, forward and yaw.
    #[must_use]
    pub fn new(options: &TrackOptions, camera: [f64; 3], seen: &Sighting) -> Self {
        let camera = camera.into();
        Self::first(options, camera, &PlacedSighting::of(&camera, seen))
    }

    pub(crate) fn first(options: &TrackOptions, camera: Camera2, seen: &PlacedSighting) -> Self {
        let PlacedReading { there, heading, spread, .. } = seen.reading;
        let mut mean = State::zeros();
        (mean[X], mean[Z], mean[AXIS]) = (there[0], there[1], heading);
        let scale_sigma = (exp(spread[0]) * sqrt(options.constant_fraction)).min(ANY_SCALE);
        let mut sigmas = State::repeat(1.0);
        (sigmas[X], sigmas[Z]) = (NOWHERE, NOWHERE);
        (sigmas[VX], sigmas[VZ]) = (options.speed_sigma, options.speed_sigma);
        (sigmas[AXIS], sigmas[TURNING]) = (ANY_AXIS, ANY_TURNING);
        (sigmas[ACCELERATION], sigmas[SCALE]) = (options.acceleration_sigma, scale_sigma.max(1e-4));
        let mut filter = Self {
            belief: Belief { mean, covariance: StateMatrix::from_diagonal(&sigmas.map(square)) },
            facing: Facing::default(),
            size: SizeEstimate::default(),
            scale_sigma,
            stated: spread,
            standing: false,
            has_moved: false,
            drift: Vector2::zeros(),
            camera,
            options: *options,
        };
        for (k, variance) in ERRORS.into_iter().zip(filter.slow_errors()) {
            filter.belief.covariance[(k, k)] = variance;
        }
        filter.take(f64::INFINITY, seen, &seen.reading);
        filter
    }

    /// What it leads one to expect of a reading.
    pub(crate) fn expected(&self) -> Expected {
        Expected::of(&self.belief, &self.stated, self.options.own_fraction)
    }

    /// Whether it moves along its axis: not so relative to a camera whose motion is not known.
    fn along_axis(&self) -> bool {
        self.options.camera_motion != CameraMotion::Unknown
    }

    /// `dt` seconds later, nothing seen; the camera is there now.
    pub fn predict(&mut self, dt: f64, camera: [f64; 3]) {
        self.advance(dt, &camera.into());
    }

    /// The same; the derivative of the mean by the mean before.
    pub(crate) fn advance(&mut self, dt: f64, camera: &Camera2) -> Transition {
        let calm = if self.standing { 0.1 } else { 1.0 };
        let motion = Motion {
            acceleration_sigma: calm * self.options.acceleration_sigma,
            turning_sigma: calm * self.options.turning_sigma,
            errors: self.slow_errors(),
            shift: [camera.place[0] - self.camera.place[0], camera.place[1] - self.camera.place[1]],
            along_axis: self.along_axis(),
        };
        self.camera = *camera;
        let moved = self.belief.moved(dt, &motion);
        let keep = self.still_the_same(dt, &moved.mean);
        let (belief, by_before) = self.belief.predicted(dt, &motion, moved, keep);
        self.belief = belief;
        by_before
    }

    /// Variances of the errors that are the same as long as the picture is.
    fn slow_errors(&self) -> [f64; 3] {
        let slow = self.options.slow_fraction;
        let variance = self.stated.map(|x| slow * exp(2.0 * x));
        [SLOW_OF_DISTANCE * variance[0], variance[1], variance[2]]
    }

    /// How much of a network's errors is still the same after `dt` seconds: it is forgotten as the vehicle turns, in what
    /// is seen of it, and comes nearer.
    fn still_the_same(&self, dt: f64, later: &State) -> f64 {
        let seen = |x: &State| (x[AXIS] - atan2(x[X], x[Z]), 0.5 * log(square(x[X]) + square(x[Z]) + 1e-6));
        let ((angle, log_distance), (later_angle, later_log)) = (seen(&self.belief.mean), seen(later));
        let turned = wrapped(later_angle - angle).abs() / SAME_PICTURE.0;
        exp(-(turned + (later_log - log_distance).abs() / SAME_PICTURE.1 + dt / self.options.error_time))
    }

    /// Squared statistical distance between where it should be and where something was seen.
    #[must_use]
    pub fn distance2(&self, camera: [f64; 3], seen: &Sighting) -> f64 {
        let seen = &PlacedSighting::of(&camera.into(), seen);
        let expected = self.expected();
        let away = |reading: &PlacedReading| expected.measured(reading).place_distance2().1;
        seen.other.as_ref().map_or(f64::INFINITY, |(other, _)| away(other)).min(away(&seen.reading))
    }

    #[cfg(feature = "std")]
    /// How badly something seen agrees with where it is and faces: the squared statistical distance of the places, and
    /// costs of the axis and of which way it faces.
    pub(crate) fn disagreement(&self, expected: &Expected, seen: &PlacedSighting) -> (f64, f64) {
        let of = |reading: &PlacedReading, turned: f64| {
            let m = expected.measured(reading);
            let variance = m.spread[(2, 2)] + m.noise[(2, 2)];
            let axis = (0.5 * square(m.residual[2]) / variance).min(MOST_OF_AXIS);
            let away = cos(reading.heading - self.belief.mean[AXIS]) < 0.0;
            let along = self.facing.probability();
            let p = if away { 1.0 - along } else { along };
            let facing = -log((p * (1.0 - turned) + (1.0 - p) * turned).max(LEAST_FACING));
            (m.place_distance2().1, axis + facing)
        };
        let first = of(&seen.reading, seen.seen.turned);
        let Some((other, p)) = &seen.other else { return first };
        let second = of(other, 0.5);
        let cost = |(d2, rest): (f64, f64), p: f64| 0.5 * d2 + rest - log(p.max(1e-3));
        if cost(second, *p) < cost(first, 1.0 - p) { second } else { first }
    }

    /// It was seen, `dt` seconds after the last frame.
    pub fn update(&mut self, camera: [f64; 3], dt: f64, seen: &Sighting) {
        let seen = PlacedSighting::of(&camera.into(), seen);
        self.notice(dt, &seen);
        self.absorb(dt, &seen);
    }

    /// Before it is taken in: has it moved off? Then what was expected is less sure than it was.
    pub(crate) fn notice(&mut self, dt: f64, seen: &PlacedSighting) {
        if self.standing {
            self.watch_drift(dt, seen);
        }
    }

    pub(crate) fn absorb(&mut self, dt: f64, seen: &PlacedSighting) {
        let reading = if seen.other.is_some() { self.expected().likeliest(seen) } else { &seen.reading };
        self.take(dt, seen, reading);
        if self.along_axis() {
            self.keep_along_axis(dt);
            self.judge_standing();
            let (along, by_along) = self.belief.along();
            let sigma = sqrt(self.belief.variance(&by_along));
            self.has_moved |= along.abs() > SURELY_MOVES.0 + SURELY_MOVES.1 * sigma;
            self.facing.drive(along, sigma);
        }
    }

    /// Takes a reading in; numbers far from what they should be count little.
    fn take(&mut self, dt: f64, seen: &PlacedSighting, reading: &PlacedReading) {
        self.state_errors(reading);
        let expected = self.expected();
        let m = expected.measured(reading);
        let dof = seen.seen.error_dof.clamp(DOF.0, DOF.1);
        let place = m.place_distance2().1;
        let weight = |d2: f64, n: f64| ((dof + n) / (dof + d2)).clamp(1e-6, 1.0);
        let of_heading = weight(square(m.residual[2]) / (m.spread[(2, 2)] + m.noise[(2, 2)]), 1.0);
        let of_place = weight(place, 2.0);
        let less = Vector3::new(of_place, of_place, of_heading).map(|w| 1.0 / sqrt(w));
        let noise = Matrix3::from_diagonal(&less) * m.noise * Matrix3::from_diagonal(&less);
        self.belief.update(&expected.ph, &m.residual, &(m.spread.transpose() + noise));
        let new = 1.0 - exp(-dt / PICTURE_TIME);
        let side = if cos(seen.reading.heading - self.belief.mean[AXIS]) < 0.0 { -1.0 } else { 1.0 };
        self.facing.see(side, seen.seen.turned, new);
        self.size.add(&seen.seen.size, &seen.seen.size_sigma, of_place * new.max(0.2));
    }

    /// What pictures state of their errors on the whole: a picture that puts a vehicle too near is surer of it than one that
    /// puts it too far, and must not count more.
    fn state_errors(&mut self, reading: &PlacedReading) {
        self.stated += (reading.spread - self.stated) * STATED_KEEPS;
        let scale = exp(self.stated[0]) * sqrt(self.options.constant_fraction);
        let scale = scale.max(1e-4);
        if scale < 0.95 * self.scale_sigma {
            let variance = 1.0 / (1.0 / square(scale) - 1.0 / square(self.scale_sigma));
            self.belief.update_one(&[(SCALE, 1.0)], -self.belief.mean[SCALE], variance);
            self.scale_sigma = scale;
        }
    }

    /// The rear axle does not slip: a measurement of velocity, axis and yaw rate.
    fn keep_along_axis(&mut self, dt: f64) {
        let [(along, by_along), (sideways, by_sideways)] = self.belief.along_and_sideways();
        let length = self.size.length();
        let arm = AXLE * if length.is_finite() { length.clamp(2.0, 20.0) } else { USUAL_LENGTH };
        let side = self.facing.expected_side();
        let [vx, vz, axis] = by_sideways;
        let h = [vx, vz, axis, (TURNING, -arm * side)];
        let swing = arm * side * self.belief.mean[TURNING];
        let unknown = self.belief.variance(&by_along) * self.belief.covariance[(AXIS, AXIS)];
        let slip = SLIP.0 + SLIP.1 * along.abs() + SLIP.2 * arm * self.belief.mean[TURNING].abs();
        let variance = square(slip) * (SLIP.3 / dt.clamp(0.01, SLIP.3)) + unknown;
        let residual = swing - sideways;
        let expected = self.belief.variance(&h) + variance;
        let weight = (5.0 / (4.0 + square(residual) / expected)).min(1.0);
        self.belief.update_one(&h, residual, variance / weight);
    }

    fn judge_standing(&mut self) {
        if !self.standing {
            self.standing = standing::is_likely(&self.belief, self.moving_sigma());
            self.drift = Vector2::zeros();
        }
        if self.standing {
            standing::hold_still(&mut self.belief);
        }
    }

    /// Of one that stands: whether its places have drifted away.
    fn watch_drift(&mut self, dt: f64, seen: &PlacedSighting) {
        let expected = self.expected();
        let (white, d2) = expected.measured(expected.likeliest(seen)).place_distance2();
        let keep = exp(-dt / MOVED_OFF.1);
        // One wrong place is no drift.
        let new = white * (1.0 - keep) * (3.0 / sqrt(d2.max(9.0)));
        self.drift = self.drift * keep + new;
        let variance = (1.0 - keep) / (1.0 + keep);
        if self.drift.norm_squared() / variance > MOVED_OFF.0 {
            self.standing = false;
            for (k, sigma) in [(VX, MOVING_OFF_SIGMA), (VZ, MOVING_OFF_SIGMA), (X, 1.0), (Z, 1.0)] {
                self.belief.covariance[(k, k)] += square(sigma);
            }
            self.belief.covariance[(TURNING, TURNING)] += square(ANY_TURNING);
            self.belief.covariance[(ACCELERATION, ACCELERATION)] += square(self.options.acceleration_sigma);
        }
    }

    /// Standard deviation of its velocity if it does not stand: one that has moved stops slowly.
    pub(crate) fn moving_sigma(&self) -> f64 {
        if self.has_moved { SLOWING_SIGMA.min(self.options.speed_sigma) } else { self.options.speed_sigma }
    }

    /// Whether it stands still.
    #[cfg(feature = "std")]
    pub(crate) fn stands(&self) -> bool {
        self.standing
    }

    /// What rows say beside the belief.
    pub(crate) fn told(&self) -> Told {
        Told {
            facing: self.facing,
            size: self.size,
            standing: self.standing,
            shared: self.options.constant_fraction.min(1.0),
            own: OF_DISTANCE * self.options.own_fraction,
        }
    }

    /// What is known now, of a vehicle seen from a camera that stands there.
    #[must_use]
    pub fn row(&self, camera: [f64; 3]) -> TrackRow {
        self.row_seen_from(&camera.into())
    }

    pub(crate) fn row_seen_from(&self, camera: &Camera2) -> TrackRow {
        row_of(&self.belief, &self.told(), camera)
    }
}
