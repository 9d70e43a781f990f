//! `Tracker`: vehicles over time.

use nalgebra::Matrix3;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::arrays::{flat, require_shape, rows};
use super::classes::PyView;
use super::{choose, input_error};
use crate::error::InputError;
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::refine::covariance::PoseCovariance;
use crate::track::options::{CameraMotion, TrackOptions};
use crate::track::row::TrackRow;
use crate::track::sighting::{Reading, Sighting};
use crate::track::tracker::Tracker;

/// Poses of N objects with their covariances: R (N, 3, 3), t (N, 3), covariance (N, 6, 6).
type Poses<'py> = (PyReadonlyArray3<'py, f64>, PyReadonlyArray2<'py, f64>, PyReadonlyArray3<'py, f64>);
/// Objects that were left out, and why.
type Skipped = Vec<(usize, String)>;

/// A field of the options: its name, and where it is kept.
type Number = (&'static str, fn(&mut TrackOptions) -> &mut f64);
const NUMBERS: [Number; 9] = [
    ("acceleration_sigma", |o| &mut o.acceleration_sigma),
    ("turning_sigma", |o| &mut o.turning_sigma),
    ("speed_sigma", |o| &mut o.speed_sigma),
    ("constant_fraction", |o| &mut o.constant_fraction),
    ("own_fraction", |o| &mut o.own_fraction),
    ("slow_fraction", |o| &mut o.slow_fraction),
    ("error_time", |o| &mut o.error_time),
    ("gate", |o| &mut o.gate),
    ("longest_gap", |o| &mut o.longest_gap),
];
type Count = (&'static str, fn(&mut TrackOptions) -> &mut usize);
const COUNTS: [Count; 2] =
    [("least_sightings", |o| &mut o.least_sightings), ("longest_history", |o| &mut o.longest_history)];

/// Names and defaults of the options.
#[pyfunction]
pub(crate) fn default_track_options(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let mut options = TrackOptions::default();
    let dict = PyDict::new(py);
    dict.set_item("camera_motion", CameraMotion::NAMES[options.camera_motion as usize])?;
    for (name, field) in NUMBERS {
        dict.set_item(name, *field(&mut options))?;
    }
    for (name, field) in COUNTS {
        dict.set_item(name, *field(&mut options))?;
    }
    Ok(dict)
}

#[pyclass(name = "Tracker", module = "groundpose._core")]
pub(crate) struct PyTracker(Tracker);

#[pymethods]
impl PyTracker {
    #[new]
    fn new(given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut options = TrackOptions::default();
        let motions = CameraMotion::NAMES.into_iter().zip(CameraMotion::ALL).collect::<Vec<_>>();
        let item = |name: &str| -> PyResult<Bound<'_, PyAny>> {
            given.get_item(name)?.ok_or_else(|| input_error(name, "an option", "none"))
        };
        options.camera_motion = choose("camera_motion", &item("camera_motion")?.extract::<String>()?, &motions)?;
        for (name, field) in NUMBERS {
            *field(&mut options) = item(name)?.extract()?;
        }
        for (name, field) in COUNTS {
            *field(&mut options) = item(name)?.extract()?;
        }
        Ok(Self(Tracker::new(options)?))
    }

    /// Columns of this frame's vehicles, and the objects that were left out with the reason.
    #[pyo3(signature = (time, ego_motion, view, poses, others, bottom_centres, numbers, classes, error_dof))]
    #[expect(clippy::too_many_arguments, reason = "one private call with everything a frame has")]
    fn update<'py>(
        &mut self,
        py: Python<'py>,
        time: f64,
        ego_motion: Option<[f64; 3]>,
        view: &PyView,
        poses: Poses<'py>,
        others: Poses<'py>,
        bottom_centres: PyReadonlyArray2<'py, f64>,
        numbers: PyReadonlyArray2<'py, f64>,
        classes: Vec<usize>,
        error_dof: f64,
    ) -> PyResult<(Bound<'py, PyDict>, Skipped)> {
        let count = classes.len();
        let (pose, other) = (Stack::of("R", &poses, count)?, Stack::of("alternative_R", &others, count)?);
        let centres = rows::<3, _>("bottom_centres", &bottom_centres)?;
        let numbers = rows::<NUMBERS_OF_OBJECT, _>("numbers", &numbers)?;
        if centres.len() != count || numbers.len() != count {
            return Err(input_error("numbers", &format!("{count} rows"), &numbers.len().to_string()));
        }
        let (mut sightings, mut skipped) = (vec![], vec![]);
        for k in 0..count {
            let of = |stack: &Stack| stack.reading(&view.0, k, centres[k]);
            // Most objects have no other reading.
            let p_other = numbers[k][OTHER_PROBABILITY];
            let other = if p_other > 0.0 { of(&other).ok().map(|reading| (reading, p_other)) } else { None };
            match sighting(of(&pose), other, &numbers[k], classes[k], error_dof) {
                Ok(sighting) => sightings.push(Sighting { number: k, ..sighting }),
                Err(error) => skipped.push((k, error.to_string())),
            }
        }
        let now = columns(py, self.0.update(time, ego_motion, &sightings)?)?;
        Ok((now, skipped))
    }

    /// All vehicles leave.
    fn finish(&mut self) {
        self.0.finish();
    }

    /// Columns of smoothed rows that were not handed out before.
    fn take_finished<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        columns(py, &self.0.take_finished())
    }

    /// The frame before which no row is to come any more.
    fn open_frame(&self) -> u64 {
        self.0.open_frame()
    }
}

/// Length, height, width, their standard deviations, 2D box, ambiguity, probability of the other reading, and of the answer.
const NUMBERS_OF_OBJECT: usize = 13;
const OTHER_PROBABILITY: usize = 11;

fn sighting(
    reading: Result<Reading, InputError>,
    other: Option<(Reading, f64)>,
    numbers: &[f64; NUMBERS_OF_OBJECT],
    class: usize,
    error_dof: f64,
) -> Result<Sighting, InputError> {
    let part = |from: usize| [numbers[from], numbers[from + 1], numbers[from + 2]];
    let [turned, _, probability] = part(10);
    let sighting = Sighting {
        other,
        turned: if turned.is_finite() { turned } else { 0.5 },
        error_dof,
        class,
        size: part(0),
        size_sigma: part(3),
        bbox: [numbers[6], numbers[7], numbers[8], numbers[9]],
        probability: if probability.is_finite() { probability } else { 0.5 },
        ..Sighting::new(reading?)
    };
    sighting.check().map(|()| sighting)
}

/// Poses of all objects of a frame.
struct Stack<'a> {
    rotations: &'a [f64],
    places: &'a [[f64; 3]],
    covariances: &'a [f64],
}

impl<'a> Stack<'a> {
    fn of(argument: &str, (r, t, covariance): &'a Poses<'_>, count: usize) -> PyResult<Self> {
        require_shape(argument, &r.as_array(), &[count, 3, 3])?;
        require_shape("covariance", &covariance.as_array(), &[count, 6, 6])?;
        if t.shape() != [count, 3] {
            return Err(input_error("t", &format!("shape ({count}, 3)"), &format!("{:?}", t.shape())));
        }
        Ok(Self {
            rotations: flat(argument, r)?,
            places: rows::<3, _>("t", t)?,
            covariances: flat("covariance", covariance)?,
        })
    }

    fn reading(&self, view: &View, k: usize, bottom_centre: [f64; 3]) -> Result<Reading, InputError> {
        let r = Matrix3::from_row_slice(&self.rotations[9 * k..9 * (k + 1)]);
        let covariance = PoseCovariance::from_row_slice(&self.covariances[36 * k..36 * (k + 1)]);
        Reading::of(view, &Pose { r, t: self.places[k].into() }, &covariance, bottom_centre)
    }
}

/// A column of numbers: its name, and what it holds of a row.
type Column = (&'static str, fn(&TrackRow) -> f64);

/// Rows as columns by name.
fn columns<'py>(py: Python<'py>, rows: &[TrackRow]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let whole = |of: fn(&TrackRow) -> i64| rows.iter().map(of).collect::<Vec<i64>>().into_pyarray(py);
    dict.set_item("id", whole(|row| row.id as i64))?;
    dict.set_item("frame", whole(|row| row.frame as i64))?;
    dict.set_item("class", whole(|row| row.class as i64))?;
    dict.set_item("index", whole(|row| row.sighting.map_or(-1, |k| k as i64)))?;
    dict.set_item("standing", rows.iter().map(|row| row.standing).collect::<Vec<bool>>().into_pyarray(py))?;
    let numbers: [Column; 10] = [
        ("time", |row| row.time),
        ("heading", |row| row.heading),
        ("heading_sigma", |row| row.heading_sigma),
        ("facing_probability", |row| row.facing_probability),
        ("speed", |row| row.speed),
        ("speed_sigma", |row| row.speed_sigma),
        ("yaw_rate", |row| row.yaw_rate),
        ("yaw_rate_sigma", |row| row.yaw_rate_sigma),
        ("acceleration", |row| row.acceleration),
        ("acceleration_sigma", |row| row.acceleration_sigma),
    ];
    for (name, of) in numbers {
        dict.set_item(name, rows.iter().map(of).collect::<Vec<f64>>().into_pyarray(py))?;
    }
    let table = |width: usize, of: fn(&TrackRow, usize) -> f64| {
        Array2::from_shape_fn((rows.len(), width), |(k, j)| of(&rows[k], j)).into_pyarray(py)
    };
    dict.set_item("place", table(2, |row, j| row.place[j]))?;
    dict.set_item("place_covariance", table(4, |row, j| row.place_covariance[(j / 2, j % 2)]))?;
    dict.set_item("size", table(3, |row, j| row.size[j]))?;
    dict.set_item("size_sigma", table(3, |row, j| row.size_sigma[j]))?;
    dict.set_item("seen_from", table(3, |row, j| row.seen_from[j]))?;
    Ok(dict)
}
