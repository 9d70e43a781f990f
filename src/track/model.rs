//! How a vehicle moves: state, its prediction, measurements of it. Equations of an extended Kalman filter.
//!
//! Place and velocity are in the scale of the pictures and from where the camera is: `e^scale` times the true ones. What
//! pictures say is linear in them, so that no rounding of a tangent says anything of the scale; what the camera moves does.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::geometry::math::{cos, exp, sin, square};

/// Numbers of a state.
///
/// ```
/// assert_eq!(groundpose::TRACK_NUMBERS, 11);
/// ```
pub const TRACK_NUMBERS: usize = 11;

pub(crate) const X: usize = 0;
pub(crate) const Z: usize = 1;
pub(crate) const VX: usize = 2;
pub(crate) const VZ: usize = 3;
pub(crate) const AXIS: usize = 4;
pub(crate) const TURNING: usize = 5;
pub(crate) const ACCELERATION: usize = 6;
pub(crate) const SCALE: usize = 7;
pub(crate) const DISTANCE_ERROR: usize = 8;
pub(crate) const BEARING_ERROR: usize = 9;
pub(crate) const HEADING_ERROR: usize = 10;
/// Errors of a network: of distance and bearing in distances, of heading in radians.
pub(crate) const ERRORS: [usize; 3] = [DISTANCE_ERROR, BEARING_ERROR, HEADING_ERROR];

pub(crate) type State = SVector<f64, TRACK_NUMBERS>;
pub(crate) type StateMatrix = SMatrix<f64, TRACK_NUMBERS, TRACK_NUMBERS>;

/// Rows of a matrix of the state, or its columns.
pub(crate) type Rows = [[f64; TRACK_NUMBERS]; TRACK_NUMBERS];

/// Where the camera stands in the plane of the first frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera2 {
    /// Right and forward.
    pub(crate) place: [f64; 2],
    pub(crate) yaw: f64,
    /// Of the yaw: every vehicle and every sighting asks for them.
    pub(crate) sin: f64,
    pub(crate) cos: f64,
}

impl From<[f64; 3]> for Camera2 {
    fn from([x, z, yaw]: [f64; 3]) -> Self {
        Self { place: [x, z], yaw, sin: sin(yaw), cos: cos(yaw) }
    }
}

/// Accelerations are forgotten within so many seconds.
const ACCELERATION_TIME: f64 = 2.0;
/// Sideways accelerations, of those along the axis.
const SIDEWAYS: f64 = 0.3;
/// Heading beside the yaw rate: rad per square root of a second.
const WANDER: f64 = 0.01;
/// Of the error of a distance that pictures share, as much is one of the scale, which is then another in other pictures. It
/// shows where the camera passes by.
const SCALE_DRIFT: f64 = 0.1;

/// How uncertain motion is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub(crate) acceleration_sigma: f64,
    pub(crate) turning_sigma: f64,
    /// Variances of the errors that pictures share: of distance and bearing, in distances, and of heading.
    pub(crate) errors: [f64; 3],
    /// How the camera moved meanwhile, metres along the axes of the plane.
    pub(crate) shift: [f64; 2],
    /// Whether a vehicle moves along its axis: not so relative to a camera whose motion is not known.
    pub(crate) along_axis: bool,
}

/// A mean with its covariance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Belief {
    pub(crate) mean: State,
    pub(crate) covariance: StateMatrix,
}

/// A mean moved on, and how it came there.
pub(crate) struct Moved {
    pub(crate) mean: State,
    transition: Transition,
    /// Of the axis before.
    sin: f64,
    cos: f64,
}

/// Derivative of a prediction by the mean before: what of its 121 numbers is neither 0 nor 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transition {
    /// Of each coordinate of the place: by VX, VZ, AXIS, TURNING, ACCELERATION, SCALE.
    place: [[f64; 6]; 2],
    /// Of each coordinate of the velocity: by VX, VZ, AXIS, TURNING, ACCELERATION.
    velocity: [[f64; 5]; 2],
    /// Of the axis by the yaw rate.
    dt: f64,
    /// Of the acceleration by itself.
    keep: f64,
    /// Of the errors by themselves.
    keep_errors: f64,
}

impl Transition {
    /// Nothing has happened.
    #[cfg(feature = "std")]
    pub(crate) fn none() -> Self {
        let velocity = [[1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0]];
        Self { place: [[0.0; 6]; 2], velocity, dt: 0.0, keep: 1.0, keep_errors: 1.0 }
    }

    /// Rows of its product with a matrix, given by rows.
    pub(crate) fn times(&self, rows: &Rows) -> Rows {
        let mut found = *rows;
        for k in 0..2 {
            for (row, by) in rows[VX..=SCALE].iter().zip(self.place[k]) {
                add(&mut found[X + k], by, row);
            }
            found[VX + k] = rows[VX].map(|x| x * self.velocity[k][0]);
            for (row, by) in rows[VZ..=ACCELERATION].iter().zip(&self.velocity[k][1..]) {
                add(&mut found[VX + k], *by, row);
            }
        }
        add(&mut found[AXIS], self.dt, &rows[TURNING]);
        found[ACCELERATION] = rows[ACCELERATION].map(|x| x * self.keep);
        for k in ERRORS {
            found[k] = rows[k].map(|x| x * self.keep_errors);
        }
        found
    }
}

/// Of a linear function of the state, or its derivative: which number, and how many times.
pub(crate) type Term = (usize, f64);

/// The function of a state.
pub(crate) fn sum_of(terms: &[Term], state: &State) -> f64 {
    terms.iter().fold(0.0, |sum, &(k, factor)| sum + factor * state[k])
}

/// Adds so many times a row.
#[inline(always)]
pub(crate) fn add(sum: &mut [f64; TRACK_NUMBERS], factor: f64, row: &[f64; TRACK_NUMBERS]) {
    for (sum, x) in sum.iter_mut().zip(row) {
        *sum += factor * x;
    }
}

impl Belief {
    /// The mean alone `dt` seconds later, before its errors are forgotten.
    pub(crate) fn moved(&self, dt: f64, motion: &Motion) -> Moved {
        moved(&self.mean, dt, motion)
    }

    /// The same `dt` seconds later, and the derivative of the mean by the mean before; `keep`: how much of a network's
    /// errors is still the same.
    pub(crate) fn predicted(&self, dt: f64, motion: &Motion, moved: Moved, keep: f64) -> (Self, Transition) {
        let Moved { mut mean, mut transition, .. } = moved;
        transition.keep_errors = keep;
        ERRORS.into_iter().for_each(|k| mean[k] *= keep);
        // Rows are columns: it is symmetric.
        let by_rows = transition.times(&self.covariance.data.0);
        let mut covariance = transition.times(&transposed(&by_rows));
        add_noise(&mut covariance, dt, motion, (moved.sin, moved.cos), keep);
        (Self { mean, covariance: symmetric(&covariance) }, transition)
    }

    /// Takes in a measurement: `ph` the covariance times the transpose of its derivative by the state, `residual` measured
    /// minus expected, `expected` the covariance of that.
    pub(crate) fn update(
        &mut self,
        ph: &SMatrix<f64, TRACK_NUMBERS, 3>,
        residual: &Vector3<f64>,
        expected: &Matrix3<f64>,
    ) {
        let Some(inverse) = expected.try_inverse() else { return };
        let gain = ph * inverse;
        self.mean += gain * residual;
        self.lessen(&gain, ph);
    }

    /// Takes in one number.
    pub(crate) fn update_one(&mut self, h: &[Term], residual: f64, variance: f64) {
        let ph = self.times(h);
        let gain = ph / (sum_of(h, &ph) + variance);
        self.mean += gain * residual;
        self.lessen(&gain, &ph);
    }

    /// The covariance less the product of a gain and a transposed matrix.
    fn lessen<const M: usize>(&mut self, gain: &SMatrix<f64, TRACK_NUMBERS, M>, ph: &SMatrix<f64, TRACK_NUMBERS, M>) {
        let (gain, ph) = (&gain.data.0, &ph.data.0);
        let mut left = self.covariance.data.0;
        for (j, column) in left.iter_mut().enumerate() {
            for (i, x) in column.iter_mut().enumerate() {
                *x -= (1..M).fold(gain[0][i] * ph[0][j], |sum, k| sum + gain[k][i] * ph[k][j]);
            }
        }
        self.covariance = symmetric(&left);
    }

    /// The covariance times a vector.
    pub(crate) fn times(&self, terms: &[Term]) -> State {
        let mut sum = [0.0; TRACK_NUMBERS];
        terms.iter().for_each(|&(k, factor)| add(&mut sum, factor, &self.covariance.data.0[k]));
        State::from(sum)
    }

    /// Variance of a linear function of the state.
    pub(crate) fn variance(&self, h: &[Term]) -> f64 {
        sum_of(h, &self.times(h)).max(0.0)
    }

    /// Velocity along the axis, and its derivative by the state.
    pub(crate) fn along(&self) -> (f64, [Term; 3]) {
        let (s, c) = (sin(self.mean[AXIS]), cos(self.mean[AXIS]));
        self.velocity_along([s, c])
    }

    /// Velocity along the axis and to the right of it, and their derivatives by the state.
    pub(crate) fn along_and_sideways(&self) -> [(f64, [Term; 3]); 2] {
        let (s, c) = (sin(self.mean[AXIS]), cos(self.mean[AXIS]));
        [self.velocity_along([s, c]), self.velocity_along([c, -s])]
    }

    /// Velocity in a direction that turns with the axis, and its derivative by the state.
    fn velocity_along(&self, [x, z]: [f64; 2]) -> (f64, [Term; 3]) {
        let by_axis = self.mean[VX] * z - self.mean[VZ] * x;
        (self.mean[VX] * x + self.mean[VZ] * z, [(VX, x), (VZ, z), (AXIS, by_axis)])
    }
}

pub(crate) fn transposed(rows: &Rows) -> Rows {
    core::array::from_fn(|i| core::array::from_fn(|j| rows[j][i]))
}

/// The mean of a matrix and its transpose.
pub(crate) fn symmetric(rows: &Rows) -> StateMatrix {
    let mut found = StateMatrix::zeros();
    let columns = &mut found.data.0;
    for i in 0..TRACK_NUMBERS {
        for j in 0..=i {
            let mean = (rows[i][j] + rows[j][i]) * 0.5;
            (columns[i][j], columns[j][i]) = (mean, mean);
        }
    }
    found
}

/// Along an arc of constant yaw rate, where a vehicle moves along its axis; on a line else.
fn moved(x: &State, dt: f64, motion: &Motion) -> Moved {
    let turning = if motion.along_axis { x[TURNING] } else { 0.0 };
    let (s, c) = (sin(x[AXIS]), cos(x[AXIS]));
    let arc = Turned::within(dt, turning);
    let keep = exp(-dt / ACCELERATION_TIME);
    let faster = ACCELERATION_TIME * (1.0 - keep);
    let farther = ACCELERATION_TIME * (dt - faster);
    // In the scale of the pictures the camera moves farther too.
    let grown = exp(x[SCALE].clamp(-1.0, 1.0));
    let mut y = *x;
    y[X] += arc.along * x[VX] + arc.across * x[VZ] + farther * x[ACCELERATION] * s;
    y[Z] += arc.along * x[VZ] - arc.across * x[VX] + farther * x[ACCELERATION] * c;
    y[VX] = arc.cos * x[VX] + arc.sin * x[VZ] + faster * x[ACCELERATION] * s;
    y[VZ] = arc.cos * x[VZ] - arc.sin * x[VX] + faster * x[ACCELERATION] * c;
    let shift = motion.shift.map(|metres| grown * metres);
    (y[X], y[Z]) = (y[X] - shift[0], y[Z] - shift[1]);
    y[AXIS] += dt * x[TURNING];
    y[ACCELERATION] *= keep;
    let (mut place_by_turning, mut velocity_by_turning) = ([0.0; 2], [0.0; 2]);
    if motion.along_axis {
        place_by_turning =
            [arc.along_slope * x[VX] + arc.across_slope * x[VZ], arc.along_slope * x[VZ] - arc.across_slope * x[VX]];
        velocity_by_turning = [dt * (arc.cos * x[VZ] - arc.sin * x[VX]), -dt * (arc.cos * x[VX] + arc.sin * x[VZ])];
    }
    let a = x[ACCELERATION];
    let place = [
        [arc.along, arc.across, farther * a * c, place_by_turning[0], farther * s, -shift[0]],
        [-arc.across, arc.along, -farther * a * s, place_by_turning[1], farther * c, -shift[1]],
    ];
    let velocity = [
        [arc.cos, arc.sin, faster * a * c, velocity_by_turning[0], faster * s],
        [-arc.sin, arc.cos, -faster * a * s, velocity_by_turning[1], faster * c],
    ];
    let transition = Transition { place, velocity, dt, keep, keep_errors: 1.0 };
    Moved { mean: y, transition, sin: s, cos: c }
}

/// A velocity that turns at a constant rate for a while.
struct Turned {
    /// Of the angle by which it has turned.
    sin: f64,
    cos: f64,
    /// How far a velocity of 1 m/s leads along its first direction and to the right of it, metres.
    along: f64,
    across: f64,
    /// Derivatives of these by the rate.
    along_slope: f64,
    across_slope: f64,
}

impl Turned {
    /// After `dt` seconds at `turning` radians per second; by series where the angle is so small that quotients round.
    fn within(dt: f64, turning: f64) -> Self {
        let a = turning * dt;
        let (s, c) = (sin(a), cos(a));
        if a.abs() < 1e-3 {
            let (along, across) = (1.0 - a * a / 6.0, a / 2.0);
            let slopes = (-a / 3.0, 0.5 - a * a / 8.0);
            return Self {
                sin: s,
                cos: c,
                along: dt * along,
                across: dt * across,
                along_slope: dt * dt * slopes.0,
                across_slope: dt * dt * slopes.1,
            };
        }
        let (along, across) = (s / a, (1.0 - c) / a);
        let slopes = ((c - along) / a, (s - across) / a);
        Self {
            sin: s,
            cos: c,
            along: dt * along,
            across: dt * across,
            along_slope: dt * dt * slopes.0,
            across_slope: dt * dt * slopes.1,
        }
    }
}

/// What happens within `dt` that nobody foresees, to a vehicle along that axis.
fn add_noise(covariance: &mut Rows, dt: f64, motion: &Motion, (s, c): (f64, f64), keep: f64) {
    let along = square(motion.acceleration_sigma);
    // Relative to a camera that moves as it likes there is no axis to move along.
    let beside = if motion.along_axis { SIDEWAYS * SIDEWAYS * along } else { along };
    let sides = if motion.along_axis { 0.1 * along } else { along };
    let xx = sides * s * s + beside * c * c;
    let zz = sides * c * c + beside * s * s;
    let xz = (sides - beside) * s * c;
    for (i, j, density) in [(0, 0, xx), (1, 1, zz), (0, 1, xz), (1, 0, xz)] {
        covariance[X + i][X + j] += density * dt * dt * dt / 3.0;
        covariance[X + i][VX + j] += density * dt * dt / 2.0;
        covariance[VX + i][X + j] += density * dt * dt / 2.0;
        covariance[VX + i][VX + j] += density * dt;
    }
    let turning = square(motion.turning_sigma);
    covariance[AXIS][AXIS] += turning * dt * dt * dt / 3.0 + WANDER * WANDER * dt;
    covariance[AXIS][TURNING] += turning * dt * dt / 2.0;
    covariance[TURNING][AXIS] += turning * dt * dt / 2.0;
    covariance[TURNING][TURNING] += turning * dt;
    covariance[ACCELERATION][ACCELERATION] += along * (1.0 - exp(-2.0 * dt / ACCELERATION_TIME));
    covariance[SCALE][SCALE] += 1e-8 * dt + SCALE_DRIFT * motion.errors[0] * (1.0 - square(keep));
    for (k, variance) in ERRORS.into_iter().zip(motion.errors) {
        covariance[k][k] += variance * (1.0 - square(keep));
    }
}
