//! What a picture says of a vehicle, as a measurement of its state: beside what is expected of it, with the errors that the
//! vehicle's pictures usually have.

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};

use crate::geometry::math::{exp, log, sqrt, square};
use crate::track::model::{
    AXIS, BEARING_ERROR, Belief, Camera2, DISTANCE_ERROR, HEADING_ERROR, TRACK_NUMBERS, X, Z, sum_of,
};
use crate::track::row::wrapped;
use crate::track::sighting::{Reading, Sighting};

/// What is constant, slow and of a frame adds up to the error of a distance: of the last half as much as of others.
pub(crate) const OF_DISTANCE: f64 = 0.5;
/// And of what is slow a quarter: a network that turns a vehicle or shifts it aside does so in most of its pictures, by more
/// than a picture states; distances it errs less by.
pub(crate) const SLOW_OF_DISTANCE: f64 = 0.25;
/// Errors larger than usual by this, a logarithm, are believed.
const FAR_MORE: f64 = 0.7;
/// Usual errors differ from stated ones by at most this, a logarithm.
const MOST_USUAL: f64 = 3.0;
/// Twice that, as a factor of variances: `exp(6)`, rounded up.
#[cfg(feature = "std")]
const MOST_USUAL_VARIANCE: f64 = 404.0;

/// A reading in the plane of the first frame, with what is the same for every vehicle that it may be.
#[derive(Clone, Copy)]
pub(crate) struct PlacedReading {
    pub(crate) reading: Reading,
    /// From the camera, along the axes of the first frame.
    pub(crate) there: Vector2<f64>,
    /// Length of that, not zero.
    away: f64,
    pub(crate) heading: f64,
    /// Of the camera's yaw.
    sin: f64,
    cos: f64,
    /// Variances that it states: of distance and bearing, in distances, and of heading.
    #[cfg(feature = "std")]
    variances: Vector3<f64>,
    /// Logarithms of their roots.
    pub(crate) spread: Vector3<f64>,
    log_distance: f64,
    /// Square of the distance as that logarithm takes it.
    #[cfg(feature = "std")]
    distance2: f64,
}

impl PlacedReading {
    pub(crate) fn of(camera: &Camera2, reading: &Reading) -> Self {
        let [x, z] = reading.place;
        let there = Vector2::from(turned_by(camera, reading.place));
        let variances = variances_of(reading);
        let distance2 = (square(x) + square(z)).max(1.0);
        Self {
            reading: *reading,
            there,
            away: there.norm().max(1e-9),
            heading: reading.heading + camera.yaw,
            sin: camera.sin,
            cos: camera.cos,
            spread: variances.map(|x| 0.5 * log(x)),
            log_distance: 0.5 * log(distance2),
            #[cfg(feature = "std")]
            variances,
            #[cfg(feature = "std")]
            distance2,
        }
    }
}

/// A sighting with its readings placed.
pub(crate) struct PlacedSighting<'a> {
    pub(crate) seen: &'a Sighting,
    pub(crate) reading: PlacedReading,
    /// With the probability that it is the right one.
    pub(crate) other: Option<(PlacedReading, f64)>,
}

impl<'a> PlacedSighting<'a> {
    pub(crate) fn of(camera: &Camera2, seen: &'a Sighting) -> Self {
        let place = |reading: &Reading| PlacedReading::of(camera, reading);
        Self { seen, reading: place(&seen.reading), other: seen.other.map(|(other, p)| (place(&other), p)) }
    }
}

/// What a vehicle leads one to expect of its readings: the same for all of them.
pub(crate) struct Expected {
    /// Means of the logarithms of stated standard deviations, as [`PlacedReading::spread`].
    stated: Vector3<f64>,
    /// Of a stated variance, the part of a frame alone.
    #[cfg(feature = "std")]
    own_fraction: f64,
    /// Directions of the place, and to the right of it.
    ray: Vector2<f64>,
    side: Vector2<f64>,
    log_distance: f64,
    /// Variances that are usual at this distance: along the ray and across it, square metres.
    #[cfg(feature = "std")]
    variances: [f64; 2],
    /// Place and heading.
    reading: Vector3<f64>,
    /// The belief's covariance times the transpose of their derivative by the state.
    pub(crate) ph: SMatrix<f64, TRACK_NUMBERS, 3>,
    /// Their covariance.
    spread: Matrix3<f64>,
    /// From the error that a reading states to that of its frame alone.
    own: Matrix3<f64>,
}

/// A reading as a measurement of the state, in the plane of the first frame.
pub(crate) struct Measured {
    pub(crate) residual: Vector3<f64>,
    pub(crate) noise: Matrix3<f64>,
    /// What the belief alone leaves open.
    pub(crate) spread: Matrix3<f64>,
}

impl Measured {
    /// Whitened difference of places, and its square.
    pub(crate) fn place_distance2(&self) -> (Vector2<f64>, f64) {
        let s: Matrix2<f64> = (self.spread + self.noise).fixed_view::<2, 2>(0, 0).into();
        let residual = Vector2::new(self.residual[0], self.residual[1]);
        let Some(root) = s.cholesky() else { return (residual, f64::INFINITY) };
        let white = root.l().solve_lower_triangular(&residual).unwrap_or(residual);
        (white, white.norm_squared())
    }

    /// Covariance of the residual.
    pub(crate) fn covariance(&self) -> Matrix3<f64> {
        self.spread + self.noise
    }
}

impl Expected {
    pub(crate) fn of(belief: &Belief, stated: &Vector3<f64>, own_fraction: f64) -> Self {
        let mean = &belief.mean;
        let there = Vector2::new(mean[X], mean[Z]);
        let away = there.norm().max(0.1);
        // Along the expected ray, not the measured one: an axis that errs as the measurement does would make every
        // vehicle nearer.
        let ray = there / away;
        let side = Vector2::new(ray[1], -ray[0]);
        // Of each number the others that it is a sum of, and how many times. The shared errors are numbers of the state, the
        // rest is noise.
        let of_place = |k: usize| [(X + k, 1.0), (DISTANCE_ERROR, ray[k] * away), (BEARING_ERROR, side[k] * away)];
        let by_state = [of_place(0), of_place(1), [(AXIS, 1.0), (HEADING_ERROR, 1.0), (HEADING_ERROR, 0.0)]];
        let ph = by_state.map(|terms| belief.times(&terms));
        let distance2 = (square(mean[X]) + square(mean[Z])).max(1.0);
        Self {
            stated: *stated,
            #[cfg(feature = "std")]
            own_fraction,
            ray,
            side,
            log_distance: 0.5 * log(distance2),
            #[cfg(feature = "std")]
            variances: [0, 1].map(|k| exp(2.0 * stated[k]) * distance2),
            reading: Vector3::from_fn(|k, _| sum_of(&by_state[k], mean)),
            spread: Matrix3::from_fn(|i, j| sum_of(&by_state[j], &ph[i])),
            ph: SMatrix::from_columns(&ph),
            own: own_noise(&ray, own_fraction),
        }
    }

    /// The reading that this vehicle explains best.
    pub(crate) fn likeliest<'a>(&self, seen: &'a PlacedSighting<'_>) -> &'a PlacedReading {
        let Some((other, p)) = &seen.other else { return &seen.reading };
        let fit = |reading: &PlacedReading, p: f64| {
            let m = self.measured(reading);
            let s = m.covariance();
            let inverse = s.try_inverse().unwrap_or_else(Matrix3::zeros);
            let d2 = m.residual.dot(&(inverse * m.residual));
            // As Student's t, so that two bad fits do not differ by much.
            log(p.max(1e-3)) - 0.5 * log(s.determinant().max(1e-300)) - 3.5 * log(1.0 + d2 / 4.0)
        };
        if fit(other, *p) > fit(&seen.reading, 1.0 - p) { other } else { &seen.reading }
    }

    /// A reading against the belief.
    pub(crate) fn measured(&self, given: &PlacedReading) -> Measured {
        let (s, c) = (given.sin, given.cos);
        let turn = self.aligned(given) * Matrix3::new(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0);
        let usual = self.usual(given);
        let covariance = usual * turn * given.reading.covariance * turn.transpose() * usual;
        let off = self.place_off(given);
        let residual = Vector3::new(off[0], off[1], folded(given.heading - self.reading[2]));
        Measured { residual, noise: self.own * covariance * self.own, spread: self.spread }
    }

    /// No more than the squared statistical distance of the places, up to rounding, at hardly any cost: the spread along no
    /// direction is larger than the sum along two, and the noise along none larger than what its parts can do at most.
    #[cfg(feature = "std")]
    pub(crate) fn least_distance2(&self, given: &PlacedReading) -> f64 {
        let covariance = &given.reading.covariance;
        let widest =
            covariance[(0, 0)].max(covariance[(1, 1)]) + covariance[(1, 0)].abs().max(covariance[(0, 1)].abs());
        let usual = |k: usize| self.variances[k] / (given.variances[k] * given.distance2);
        let more = usual(0).max(usual(1)).clamp(1.0, MOST_USUAL_VARIANCE);
        let most = self.spread[(0, 0)] + self.spread[(1, 1)] + self.own_fraction * more * widest;
        self.place_off(given).norm_squared() / most
    }

    fn place_off(&self, given: &PlacedReading) -> Vector2<f64> {
        Vector2::new(given.there[0] - self.reading[0], given.there[1] - self.reading[1])
    }

    /// From the errors that a reading states to those that its vehicle's pictures usually have at this distance; readings
    /// that state far larger ones are believed.
    fn usual(&self, given: &PlacedReading) -> Matrix3<f64> {
        let nearer = self.log_distance - given.log_distance;
        let factor = |k: usize, more: f64| {
            let usual = self.stated[k] - given.spread[k];
            if usual < -FAR_MORE { 1.0 } else { exp((usual + more).clamp(-MOST_USUAL, MOST_USUAL)) }
        };
        let (along, across) = (factor(0, nearer), factor(1, nearer));
        let mut all = Matrix3::identity() * factor(2, 0.0);
        let plane = self.ray * self.ray.transpose() * along + self.side * self.side.transpose() * across;
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(&plane);
        all
    }

    /// The turn in the plane that lays where a reading is on where it should be.
    fn aligned(&self, given: &PlacedReading) -> Matrix3<f64> {
        let (from, to) = (&given.there, &self.ray);
        let length = given.away * to.norm().max(1e-9);
        let (c, s) = (from.dot(to) / length, (from[0] * to[1] - from[1] * to[0]) / length);
        Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
    }
}

/// From the error that a reading states to that of its frame alone.
fn own_noise(ray: &Vector2<f64>, own_fraction: f64) -> Matrix3<f64> {
    let own = sqrt(own_fraction);
    let plane = Matrix2::identity() + ray * ray.transpose() * (sqrt(OF_DISTANCE) - 1.0);
    let mut all = Matrix3::identity() * own;
    all.fixed_view_mut::<2, 2>(0, 0).copy_from(&(plane * own));
    all
}

/// A place right and forward of the camera, along the axes of the first frame.
pub(crate) fn turned_by(camera: &Camera2, [x, z]: [f64; 2]) -> [f64; 2] {
    let (s, c) = (camera.sin, camera.cos);
    [x * c + z * s, z * c - x * s]
}

/// The difference of two axes, between -pi / 2 and pi / 2.
fn folded(angle: f64) -> f64 {
    0.5 * wrapped(2.0 * angle)
}

/// Variances that a reading states: of distance and bearing, in distances, and of heading.
fn variances_of(reading: &Reading) -> Vector3<f64> {
    let there = Vector2::from(reading.place);
    let distance2 = there.norm_squared().max(0.01);
    let side = Vector2::new(there[1], -there[0]);
    let plane = reading.covariance.fixed_view::<2, 2>(0, 0);
    let of = |along: &Vector2<f64>| along.dot(&(plane * along)) / square(distance2);
    Vector3::new(of(&there), of(&side), reading.covariance[(2, 2)]).map(|x| x.max(1e-12))
}
