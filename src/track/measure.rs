//! What a picture says of a vehicle, as a measurement of its state: beside what is expected of it, with the errors that the
//! vehicle's pictures usually have.

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};

use crate::geometry::math::{cos, exp, log, sin, sqrt, square};
use crate::track::model::{AXIS, BEARING_ERROR, Belief, Camera2, DISTANCE_ERROR, HEADING_ERROR, TRACK_NUMBERS, X, Z};
use crate::track::row::wrapped;
use crate::track::sighting::{Reading, Sighting};

/// What is constant, slow and of a frame adds up to the error of a distance: of the last half as much as of others.
pub(crate) const OF_DISTANCE: f64 = 0.5;
/// And of what is slow a quarter: a network that turns a vehicle or shifts it aside does so in most of its pictures, by more
/// than a picture states; distances it errs less by.
pub(crate) const SLOW_OF_DISTANCE: f64 = 0.25;
/// Errors larger than usual by this, a logarithm, are believed.
const FAR_MORE: f64 = 0.7;

/// What a vehicle leads one to expect of its readings.
pub(crate) struct Expected<'a> {
    pub(crate) belief: &'a Belief,
    /// Means of the logarithms of stated standard deviations, as [`spread_of`].
    pub(crate) stated: &'a Vector3<f64>,
    /// Of a stated variance, the part of a frame alone.
    pub(crate) own_fraction: f64,
}

/// A reading as a measurement of the state, in the plane of the first frame.
pub(crate) struct Measured {
    pub(crate) residual: Vector3<f64>,
    pub(crate) by_state: SMatrix<f64, 3, TRACK_NUMBERS>,
    pub(crate) noise: Matrix3<f64>,
}

impl Measured {
    /// Whitened difference of places, and its square.
    pub(crate) fn place_distance2(&self, belief: &Belief) -> (Vector2<f64>, f64) {
        let h = self.by_state.fixed_rows::<2>(0);
        let s: Matrix2<f64> = h * belief.covariance * h.transpose() + self.noise.fixed_view::<2, 2>(0, 0);
        let residual = Vector2::new(self.residual[0], self.residual[1]);
        let Some(root) = s.cholesky() else { return (residual, f64::INFINITY) };
        let white = root.l().solve_lower_triangular(&residual).unwrap_or(residual);
        (white, white.norm_squared())
    }
}

impl Expected<'_> {
    /// The reading that this vehicle explains best.
    pub(crate) fn likeliest(&self, camera: Camera2, seen: &Sighting) -> Reading {
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
    pub(crate) fn measured(&self, camera: Camera2, reading: &Reading) -> Measured {
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
        let own = sqrt(self.own_fraction);
        let plane = Matrix2::identity() + ray * ray.transpose() * (sqrt(OF_DISTANCE) - 1.0);
        let mut all = Matrix3::identity() * own;
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(&(plane * own));
        all
    }
}

/// A place right and forward of the camera, along the axes of the first frame.
pub(crate) fn turned_by(yaw: f64, [x, z]: [f64; 2]) -> [f64; 2] {
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
pub(crate) fn spread_of(reading: &Reading) -> Vector3<f64> {
    let there = Vector2::from(reading.place);
    let distance2 = there.norm_squared().max(0.01);
    let side = Vector2::new(there[1], -there[0]);
    let plane = reading.covariance.fixed_view::<2, 2>(0, 0);
    let of = |along: &Vector2<f64>| along.dot(&(plane * along)) / square(distance2);
    Vector3::new(of(&there), of(&side), reading.covariance[(2, 2)]).map(|x| 0.5 * log(x.max(1e-12)))
}
