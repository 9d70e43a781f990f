//! How a vehicle moves: state, its prediction, measurements of it. Equations of an extended Kalman filter.
//!
//! Place and velocity are in the scale of the pictures and from where the camera is: `e^scale` times the true ones. What
//! pictures say is linear in them, so that no rounding of a tangent says anything of the scale; what the camera moves does.

use nalgebra::{SMatrix, SVector};

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

/// Place right and forward, and yaw, of the camera in the plane of the first frame.
pub(crate) type Camera2 = [f64; 3];

/// Accelerations are forgotten within so many seconds.
const ACCELERATION_TIME: f64 = 2.0;
/// Sideways accelerations, of those along the axis.
const SIDEWAYS: f64 = 0.3;
/// Heading beside the yaw rate: rad per square root of a second.
const WANDER: f64 = 0.01;

/// How uncertain motion is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub(crate) acceleration_sigma: f64,
    pub(crate) turning_sigma: f64,
    /// How much of a network's errors is still the same: its picture has changed.
    pub(crate) keep: f64,
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

impl Belief {
    /// The same `dt` seconds later, and the derivative of the mean by the mean before.
    pub(crate) fn predicted(&self, dt: f64, motion: &Motion) -> (Self, StateMatrix) {
        let (mean, f) = moved(&self.mean, dt, motion);
        let covariance = f * self.covariance * f.transpose() + noise(&self.mean, dt, motion);
        (Self { mean, covariance: symmetric(&covariance) }, f)
    }

    /// The mean alone `dt` seconds later.
    pub(crate) fn expected(&self, dt: f64, motion: &Motion) -> State {
        moved(&self.mean, dt, motion).0
    }

    /// Takes in a measurement: `h` derivative by the state, `residual` measured minus expected, `noise` its covariance.
    pub(crate) fn update<const M: usize>(
        &mut self,
        h: &SMatrix<f64, M, TRACK_NUMBERS>,
        residual: &SVector<f64, M>,
        noise: &SMatrix<f64, M, M>,
    ) {
        let ph = self.covariance * h.transpose();
        let expected = h * ph + noise;
        let Some(inverse) = expected.try_inverse() else { return };
        let gain = ph * inverse;
        self.mean += gain * residual;
        self.covariance = symmetric(&(self.covariance - gain * ph.transpose()));
    }

    /// Takes in one number.
    pub(crate) fn update_one(&mut self, h: &State, residual: f64, variance: f64) {
        let ph = self.covariance * h;
        let gain = ph / (h.dot(&ph) + variance);
        self.mean += gain * residual;
        self.covariance = symmetric(&(self.covariance - gain * ph.transpose()));
    }

    /// Variance of a linear function of the state.
    pub(crate) fn variance(&self, h: &State) -> f64 {
        h.dot(&(self.covariance * h)).max(0.0)
    }

    /// Velocity along the axis, and its derivative by the state.
    pub(crate) fn along(&self) -> (f64, State) {
        let (s, c) = (sin(self.mean[AXIS]), cos(self.mean[AXIS]));
        let mut h = State::zeros();
        (h[VX], h[VZ]) = (s, c);
        h[AXIS] = self.mean[VX] * c - self.mean[VZ] * s;
        (self.mean[VX] * s + self.mean[VZ] * c, h)
    }

    /// Velocity to the right of the axis, and its derivative by the state.
    pub(crate) fn sideways(&self) -> (f64, State) {
        let (s, c) = (sin(self.mean[AXIS]), cos(self.mean[AXIS]));
        let mut h = State::zeros();
        (h[VX], h[VZ]) = (c, -s);
        h[AXIS] = -(self.mean[VX] * s + self.mean[VZ] * c);
        (self.mean[VX] * c - self.mean[VZ] * s, h)
    }
}

pub(crate) fn symmetric(m: &StateMatrix) -> StateMatrix {
    (m + m.transpose()) * 0.5
}

/// Along an arc of constant yaw rate, where a vehicle moves along its axis; on a line else.
fn moved(x: &State, dt: f64, motion: &Motion) -> (State, StateMatrix) {
    let turning = if motion.along_axis { x[TURNING] } else { 0.0 };
    let (s, c) = (sin(x[AXIS]), cos(x[AXIS]));
    let arc = Turned::within(dt, turning);
    let keep = exp(-dt / ACCELERATION_TIME);
    let faster = ACCELERATION_TIME * (1.0 - keep);
    let farther = ACCELERATION_TIME * (dt - faster);
    // In the scale of the pictures the camera moves farther too.
    let grown = exp(x[SCALE].clamp(-1.0, 1.0));
    let mut f = StateMatrix::identity();
    let mut y = *x;
    y[X] += arc.along * x[VX] + arc.across * x[VZ] + farther * x[ACCELERATION] * s;
    y[Z] += arc.along * x[VZ] - arc.across * x[VX] + farther * x[ACCELERATION] * c;
    y[VX] = arc.cos * x[VX] + arc.sin * x[VZ] + faster * x[ACCELERATION] * s;
    y[VZ] = arc.cos * x[VZ] - arc.sin * x[VX] + faster * x[ACCELERATION] * c;
    for (k, shift) in [(X, motion.shift[0]), (Z, motion.shift[1])] {
        y[k] -= grown * shift;
        f[(k, SCALE)] = -grown * shift;
    }
    y[AXIS] += dt * x[TURNING];
    y[ACCELERATION] *= keep;
    (f[(X, VX)], f[(X, VZ)], f[(Z, VX)], f[(Z, VZ)]) = (arc.along, arc.across, -arc.across, arc.along);
    (f[(VX, VX)], f[(VX, VZ)], f[(VZ, VX)], f[(VZ, VZ)]) = (arc.cos, arc.sin, -arc.sin, arc.cos);
    (f[(X, AXIS)], f[(Z, AXIS)]) = (farther * x[ACCELERATION] * c, -farther * x[ACCELERATION] * s);
    (f[(VX, AXIS)], f[(VZ, AXIS)]) = (faster * x[ACCELERATION] * c, -faster * x[ACCELERATION] * s);
    (f[(X, ACCELERATION)], f[(Z, ACCELERATION)]) = (farther * s, farther * c);
    (f[(VX, ACCELERATION)], f[(VZ, ACCELERATION)]) = (faster * s, faster * c);
    f[(AXIS, TURNING)] = dt;
    if motion.along_axis {
        f[(X, TURNING)] = arc.along_slope * x[VX] + arc.across_slope * x[VZ];
        f[(Z, TURNING)] = arc.along_slope * x[VZ] - arc.across_slope * x[VX];
        f[(VX, TURNING)] = dt * (arc.cos * x[VZ] - arc.sin * x[VX]);
        f[(VZ, TURNING)] = -dt * (arc.cos * x[VX] + arc.sin * x[VZ]);
    }
    f[(ACCELERATION, ACCELERATION)] = keep;
    for k in ERRORS {
        y[k] *= motion.keep;
        f[(k, k)] = motion.keep;
    }
    (y, f)
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

/// What happens within `dt` that nobody foresees.
fn noise(x: &State, dt: f64, motion: &Motion) -> StateMatrix {
    let mut q = StateMatrix::zeros();
    let (s, c) = (sin(x[AXIS]), cos(x[AXIS]));
    let along = square(motion.acceleration_sigma);
    // Relative to a camera that moves as it likes there is no axis to move along.
    let beside = if motion.along_axis { SIDEWAYS * SIDEWAYS * along } else { along };
    let sides = if motion.along_axis { 0.1 * along } else { along };
    let xx = sides * s * s + beside * c * c;
    let zz = sides * c * c + beside * s * s;
    let xz = (sides - beside) * s * c;
    for (i, j, density) in [(0, 0, xx), (1, 1, zz), (0, 1, xz), (1, 0, xz)] {
        q[(X + i, X + j)] = density * dt * dt * dt / 3.0;
        q[(X + i, VX + j)] = density * dt * dt / 2.0;
        q[(VX + i, X + j)] = density * dt * dt / 2.0;
        q[(VX + i, VX + j)] = density * dt;
    }
    let turning = square(motion.turning_sigma);
    q[(AXIS, AXIS)] = turning * dt * dt * dt / 3.0 + WANDER * WANDER * dt;
    q[(AXIS, TURNING)] = turning * dt * dt / 2.0;
    q[(TURNING, AXIS)] = q[(AXIS, TURNING)];
    q[(TURNING, TURNING)] = turning * dt;
    q[(ACCELERATION, ACCELERATION)] = along * (1.0 - exp(-2.0 * dt / ACCELERATION_TIME));
    q[(SCALE, SCALE)] = 1e-8 * dt;
    for (k, variance) in ERRORS.into_iter().zip(motion.errors) {
        q[(k, k)] = variance * (1.0 - square(motion.keep));
    }
    q
}
