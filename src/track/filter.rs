//! One vehicle over time.

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};

use crate::geometry::math::{atan2, cos, exp, log, sin, sqrt, square};
use crate::track::facing::Facing;
use crate::track::model::{
    ACCELERATION, AXIS, BEARING_ERROR, Belief, Camera2, DISTANCE_ERROR, ERRORS, HEADING_ERROR, Motion, SCALE, State,
    StateMatrix, TRACK_NUMBERS, TURNING, VX, VZ, X, Z,
};
use crate::track::options::{CameraMotion, TrackOptions};
use crate::track::row::{Told, TrackRow, row_of, wrapped};
use crate::track::sighting::{Reading, Sighting};
use crate::track::size::SizeEstimate;
use crate::track::standing;

/// A network's errors are others when a vehicle has turned by so much, as the camera sees it, or is nearer by this factor,
/// a logarithm.
const SAME_PICTURE: (f64, f64) = (0.35, 0.35);
/// How much a picture changes what is usual, and how much larger errors, a logarithm, are not usual.
const STATED_KEEPS: f64 = 0.1;
const FAR_MORE: f64 = 0.7;
/// What is constant, slow and of a frame adds up to the error of a distance: of the last two half as much as of others.
const OF_DISTANCE: f64 = 0.5;
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

/// A reading as a measurement of the state, in the plane of the first frame.
struct Measured {
    residual: Vector3<f64>,
    by_state: SMatrix<f64, 3, TRACK_NUMBERS>,
    noise: Matrix3<f64>,
}

impl VehicleFilter {
    /// A vehicle that is seen for the first time; `camera`: where the camera stands, right, forward and yaw.
    #[must_use]
    pub fn new(options: &TrackOptions, camera: [f64; 3], seen: &Sighting) -> Self {
        let Reading { place, heading, .. } = seen.reading;
        let there = turned_by(camera[2], place);
        let mut mean = State::zeros();
        (mean[X], mean[Z]) = (there[0], there[1]);
        mean[AXIS] = heading + camera[2];
        let scale_sigma = (exp(spread_of(&seen.reading)[0]) * sqrt(options.constant_fraction)).min(ANY_SCALE);
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
            stated: spread_of(&seen.reading),
            standing: false,
            has_moved: false,
            drift: Vector2::zeros(),
            camera,
            options: *options,
        };
        for (k, variance) in ERRORS.into_iter().zip(filter.slow_errors()) {
            filter.belief.covariance[(k, k)] = variance;
        }
        filter.take(camera, f64::INFINITY, seen, &seen.reading);
        filter
    }

    /// Whether it moves along its axis: not so relative to a camera whose motion is not known.
    fn along_axis(&self) -> bool {
        self.options.camera_motion != CameraMotion::Unknown
    }

    /// `dt` seconds later, nothing seen; the camera is there now.
    pub fn predict(&mut self, dt: f64, camera: [f64; 3]) {
        self.advance(dt, camera);
    }

    /// The same; the derivative of the mean by the mean before.
    pub(crate) fn advance(&mut self, dt: f64, camera: Camera2) -> StateMatrix {
        let calm = if self.standing { 0.1 } else { 1.0 };
        let mut motion = Motion {
            acceleration_sigma: calm * self.options.acceleration_sigma,
            turning_sigma: calm * self.options.turning_sigma,
            keep: 1.0,
            errors: self.slow_errors(),
            shift: [camera[0] - self.camera[0], camera[1] - self.camera[1]],
            along_axis: self.along_axis(),
        };
        self.camera = camera;
        motion.keep = self.still_the_same(dt, &self.belief.expected(dt, &motion));
        let (belief, by_before) = self.belief.predicted(dt, &motion);
        self.belief = belief;
        by_before
    }

    /// Variances of the errors that are the same as long as the picture is.
    fn slow_errors(&self) -> [f64; 3] {
        let slow = self.options.slow_fraction;
        let variance = self.stated.map(|x| slow * exp(2.0 * x));
        [OF_DISTANCE * variance[0], variance[1], variance[2]]
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
        let away = |reading: &Reading| self.place_distance2(&self.measured(camera, reading)).1;
        seen.other.map_or(f64::INFINITY, |(other, _)| away(&other)).min(away(&seen.reading))
    }

    #[cfg(feature = "std")]
    /// How badly something seen agrees with where it is and faces: the squared statistical distance of the places, and
    /// costs of the axis and of which way it faces.
    pub(crate) fn disagreement(&self, camera: Camera2, seen: &Sighting) -> (f64, f64) {
        let of = |reading: &Reading, turned: f64| {
            let m = self.measured(camera, reading);
            let h = m.by_state.row(2);
            let variance = (h * self.belief.covariance * h.transpose())[(0, 0)] + m.noise[(2, 2)];
            let axis = (0.5 * square(m.residual[2]) / variance).min(MOST_OF_AXIS);
            let away = cos(reading.heading + camera[2] - self.belief.mean[AXIS]) < 0.0;
            let along = self.facing.probability();
            let p = if away { 1.0 - along } else { along };
            let facing = -log((p * (1.0 - turned) + (1.0 - p) * turned).max(LEAST_FACING));
            (self.place_distance2(&m).1, axis + facing)
        };
        let first = of(&seen.reading, seen.turned);
        let Some((other, p)) = seen.other else { return first };
        let second = of(&other, 0.5);
        let cost = |(d2, rest): (f64, f64), p: f64| 0.5 * d2 + rest - log(p.max(1e-3));
        if cost(second, p) < cost(first, 1.0 - p) { second } else { first }
    }

    /// Whitened difference of places, and its square.
    fn place_distance2(&self, m: &Measured) -> (Vector2<f64>, f64) {
        let h = m.by_state.fixed_rows::<2>(0);
        let s: Matrix2<f64> = h * self.belief.covariance * h.transpose() + m.noise.fixed_view::<2, 2>(0, 0);
        let residual = Vector2::new(m.residual[0], m.residual[1]);
        let Some(root) = s.cholesky() else { return (residual, f64::INFINITY) };
        let white = root.l().solve_lower_triangular(&residual).unwrap_or(residual);
        (white, white.norm_squared())
    }

    /// It was seen, `dt` seconds after the last frame.
    pub fn update(&mut self, camera: [f64; 3], dt: f64, seen: &Sighting) {
        self.notice(camera, dt, seen);
        self.absorb(camera, dt, seen);
    }

    /// Before it is taken in: has it moved off? Then what was expected is less sure than it was.
    pub(crate) fn notice(&mut self, camera: Camera2, dt: f64, seen: &Sighting) {
        if self.standing {
            self.watch_drift(camera, dt, &self.likeliest(camera, seen));
        }
    }

    pub(crate) fn absorb(&mut self, camera: Camera2, dt: f64, seen: &Sighting) {
        self.take(camera, dt, seen, &self.likeliest(camera, seen));
        if self.along_axis() {
            self.keep_along_axis(dt);
            self.judge_standing();
            let (along, by_along) = self.belief.along();
            let sigma = sqrt(self.belief.variance(&by_along));
            self.has_moved |= along.abs() > SURELY_MOVES.0 + SURELY_MOVES.1 * sigma;
            self.facing.drive(along, sigma);
        }
    }

    /// The reading that this vehicle explains best.
    fn likeliest(&self, camera: Camera2, seen: &Sighting) -> Reading {
        let Some((other, p)) = seen.other else { return seen.reading };
        let fit = |reading: &Reading, p: f64| {
            let m = self.measured(camera, reading);
            let s = m.by_state * self.belief.covariance * m.by_state.transpose() + m.noise;
            let inverse = s.try_inverse().unwrap_or_else(Matrix3::zeros);
            let d2 = m.residual.dot(&(inverse * m.residual));
            // As Student's t, so that two bad fits do not differ by much.
            log(p.max(1e-3)) - 0.5 * log(s.determinant().max(1e-300)) - 3.5 * log(1.0 + d2 / 4.0)
        };
        if fit(&other, p) > fit(&seen.reading, 1.0 - p) { other } else { seen.reading }
    }

    /// A reading against the belief. The shared errors are numbers of the state, the rest is noise.
    fn measured(&self, camera: Camera2, reading: &Reading) -> Measured {
        let there = Vector2::from(turned_by(camera[2], reading.place));
        let mean = &self.belief.mean;
        let expected_there = Vector2::new(mean[X], mean[Z]);
        let away = expected_there.norm().max(0.1);
        // Along the expected ray, not the measured one: an axis that errs as the measurement does would make every
        // vehicle nearer.
        let ray = expected_there / away;
        let side = Vector2::new(ray[1], -ray[0]);
        let (s, c) = (sin(camera[2]), cos(camera[2]));
        let turn = aligned(&there, &ray) * Matrix3::new(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0);
        let usual = self.usual(reading, &ray, &side);
        let covariance = usual * turn * reading.covariance * turn.transpose() * usual;
        let mut by_state = SMatrix::<f64, 3, TRACK_NUMBERS>::zeros();
        for k in 0..2 {
            by_state[(k, X + k)] = 1.0;
            by_state[(k, DISTANCE_ERROR)] = ray[k] * away;
            by_state[(k, BEARING_ERROR)] = side[k] * away;
        }
        by_state[(2, AXIS)] = 1.0;
        by_state[(2, HEADING_ERROR)] = 1.0;
        let expected = by_state * mean;
        let residual = Vector3::new(
            there[0] - expected[0],
            there[1] - expected[1],
            folded(reading.heading + camera[2] - expected[2]),
        );
        let own = self.own_noise(&ray);
        Measured { residual, by_state, noise: own * covariance * own }
    }

    /// From the errors that a reading states to those that its vehicle's pictures usually have at this distance; readings
    /// that state far larger ones are believed.
    fn usual(&self, reading: &Reading, ray: &Vector2<f64>, side: &Vector2<f64>) -> Matrix3<f64> {
        let own = spread_of(reading);
        let [x, z] = reading.place;
        let expected = 0.5 * log((square(self.belief.mean[X]) + square(self.belief.mean[Z])).max(1.0));
        let nearer = expected - 0.5 * log((square(x) + square(z)).max(1.0));
        let factor = |k: usize, more: f64| {
            let usual = self.stated[k] - own[k];
            if usual < -FAR_MORE { 1.0 } else { exp((usual + more).clamp(-3.0, 3.0)) }
        };
        let (along, across) = (factor(0, nearer), factor(1, nearer));
        let mut all = Matrix3::identity() * factor(2, 0.0);
        let plane = ray * ray.transpose() * along + side * side.transpose() * across;
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(&plane);
        all
    }

    /// From the error that a reading states to that of its frame alone.
    fn own_noise(&self, ray: &Vector2<f64>) -> Matrix3<f64> {
        let own = sqrt(self.options.own_fraction);
        let plane = Matrix2::identity() + ray * ray.transpose() * (sqrt(OF_DISTANCE) - 1.0);
        let mut all = Matrix3::identity() * own;
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(&(plane * own));
        all
    }

    /// Takes a reading in; numbers far from what they should be count little.
    fn take(&mut self, camera: Camera2, dt: f64, seen: &Sighting, reading: &Reading) {
        self.state_errors(reading);
        let mut m = self.measured(camera, reading);
        let dof = seen.error_dof.clamp(DOF.0, DOF.1);
        let s = m.by_state * self.belief.covariance * m.by_state.transpose() + m.noise;
        let place = self.place_distance2(&m).1;
        let weight = |d2: f64, n: f64| ((dof + n) / (dof + d2)).clamp(1e-6, 1.0);
        let (of_place, of_heading) = (weight(place, 2.0), weight(square(m.residual[2]) / s[(2, 2)], 1.0));
        let less = Vector3::new(of_place, of_place, of_heading).map(|w| 1.0 / sqrt(w));
        m.noise = Matrix3::from_diagonal(&less) * m.noise * Matrix3::from_diagonal(&less);
        self.belief.update(&m.by_state, &m.residual, &m.noise);
        let new = 1.0 - exp(-dt / PICTURE_TIME);
        let side = if cos(seen.reading.heading + camera[2] - self.belief.mean[AXIS]) < 0.0 { -1.0 } else { 1.0 };
        self.facing.see(side, seen.turned, new);
        self.size.add(&seen.size, &seen.size_sigma, of_place * new.max(0.2));
    }

    /// What pictures state of their errors on the whole: a picture that puts a vehicle too near is surer of it than one that
    /// puts it too far, and must not count more.
    fn state_errors(&mut self, reading: &Reading) {
        self.stated += (spread_of(reading) - self.stated) * STATED_KEEPS;
        let scale = exp(self.stated[0]) * sqrt(self.options.constant_fraction);
        let scale = scale.max(1e-4);
        if scale < 0.95 * self.scale_sigma {
            let variance = 1.0 / (1.0 / square(scale) - 1.0 / square(self.scale_sigma));
            let mut h = State::zeros();
            h[SCALE] = 1.0;
            self.belief.update_one(&h, -self.belief.mean[SCALE], variance);
            self.scale_sigma = scale;
        }
    }

    /// The rear axle does not slip: a measurement of velocity, axis and yaw rate.
    fn keep_along_axis(&mut self, dt: f64) {
        let (sideways, mut h) = self.belief.sideways();
        let length = self.size.of(0.0, 0.0, (0.0, 0.0)).0[0];
        let arm = AXLE * if length.is_finite() { length.clamp(2.0, 20.0) } else { USUAL_LENGTH };
        let side = self.facing.expected_side();
        h[TURNING] = -arm * side;
        let swing = arm * side * self.belief.mean[TURNING];
        let (along, by_along) = self.belief.along();
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
    fn watch_drift(&mut self, camera: Camera2, dt: f64, reading: &Reading) {
        let (white, d2) = self.place_distance2(&self.measured(camera, reading));
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
        row_of(&self.belief, &self.told(), camera)
    }
}

/// A place right and forward of the camera, along the axes of the first frame.
fn turned_by(yaw: f64, [x, z]: [f64; 2]) -> [f64; 2] {
    let (s, c) = (sin(yaw), cos(yaw));
    [x * c + z * s, z * c - x * s]
}

/// The difference of two axes, between -pi / 2 and pi / 2.
fn folded(angle: f64) -> f64 {
    0.5 * wrapped(2.0 * angle)
}

/// The turn in the plane that lays one direction on another.
fn aligned(from: &Vector2<f64>, to: &Vector2<f64>) -> Matrix3<f64> {
    let length = from.norm().max(1e-9) * to.norm().max(1e-9);
    let (c, s) = (from.dot(to) / length, (from[0] * to[1] - from[1] * to[0]) / length);
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

/// Logarithms of the standard deviations that a reading states: of distance and bearing, in distances, and of heading.
fn spread_of(reading: &Reading) -> Vector3<f64> {
    let there = Vector2::from(reading.place);
    let distance2 = there.norm_squared().max(0.01);
    let side = Vector2::new(there[1], -there[0]);
    let plane = reading.covariance.fixed_view::<2, 2>(0, 0);
    let of = |along: &Vector2<f64>| along.dot(&(plane * along)) / square(distance2);
    Vector3::new(of(&there), of(&side), reading.covariance[(2, 2)]).map(|x| 0.5 * log(x.max(1e-12)))
}
