//! All vehicles before one camera, frame after frame.

use crate::error::{Got, InputError, require};
use crate::track::associate::assign;
use crate::track::measure::PlacedSighting;
use crate::track::model::Camera2;
use crate::track::options::{CameraMotion, TrackOptions};
use crate::track::row::TrackRow;
use crate::track::sighting::Sighting;
use crate::track::vehicle::{Moment, Vehicle};

/// A vehicle that is hardly one leaves when it is not seen for this fraction of the longest gap.
const HARDLY: f64 = 0.4;

/// Follows all vehicles before one camera.
///
/// Memory is bounded: a vehicle's history is handed out when it leaves, and piece by piece when it stays long.
///
/// ```
/// use groundpose::{Reading, Sighting, TrackOptions, Tracker};
///
/// let mut tracker = Tracker::new(TrackOptions::default())?;
/// let covariance = nalgebra::Matrix3::identity() * 0.01;
/// let car = |x: f64, z: f64| Sighting::new(Reading { place: [x, z], heading: 0.0, covariance });
/// for k in 0..20 {
///     // Two cars, given in another order in every second frame.
///     let mut cars = vec![car(-2.0, 20.0 + f64::from(k)), car(3.0, 30.0)];
///     if k % 2 == 1 {
///         cars.reverse();
///     }
///     let now = tracker.update(0.1 * f64::from(k), None, &cars)?;
///     assert!(k < 2 || now.len() == 2);
/// }
/// assert!(tracker.update(1.0, None, &[]).is_err(), "time runs backwards");
/// assert_eq!(tracker.open_frame(), 0, "both are still there");
/// tracker.finish();
/// assert_eq!(tracker.open_frame(), 20);
/// let rows = tracker.take_finished();
/// assert_eq!(rows.iter().filter(|row| row.id == 1).count(), 20);
/// assert!(rows.iter().all(|row| (row.id == 1) == (row.place[0] < 0.0)));
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Tracker {
    options: TrackOptions,
    vehicles: Vec<Vehicle>,
    /// Where it stands in the plane of the first frame.
    camera: Camera2,
    time: Option<f64>,
    frame: u64,
    last_id: u64,
    now: Vec<TrackRow>,
    finished: Vec<TrackRow>,
}

impl Tracker {
    /// One that has seen nothing.
    ///
    /// # Errors
    /// Options that cannot be.
    pub fn new(options: TrackOptions) -> Result<Self, InputError> {
        options.check()?;
        let (vehicles, now, finished) = (vec![], vec![], vec![]);
        Ok(Self { options, vehicles, camera: [0.0; 3].into(), time: None, frame: 0, last_id: 0, now, finished })
    }

    /// The next frame: its vehicles, those that are not seen for a moment too.
    ///
    /// `ego_motion` is where the camera is now as the camera before saw it: right and forward in metres, and how far it
    /// turned to the right in radians; in the first frame it is not looked at.
    ///
    /// # Errors
    /// A time that is not after that of the frame before; ego-motion that is missing, or given for a camera that stands
    /// or moves unknown; numbers of a sighting that cannot be. Nothing has changed then.
    pub fn update(
        &mut self,
        time: f64,
        ego_motion: Option<[f64; 3]>,
        sightings: &[Sighting],
    ) -> Result<&[TrackRow], InputError> {
        let dt = self.checked(time, ego_motion)?;
        sightings.iter().try_for_each(Sighting::check)?;
        if let (Some(moved), Some(_)) = (ego_motion, dt) {
            self.camera = moved_by(&self.camera, moved);
        }
        let moment = Moment { frame: self.frame, time, camera: self.camera };
        self.drop_lost(time);
        let dt = dt.unwrap_or(0.0);
        self.vehicles.iter_mut().for_each(|vehicle| vehicle.predict(dt, &moment.camera));
        let placed: Vec<_> = sightings.iter().map(|seen| PlacedSighting::of(&moment.camera, seen)).collect();
        let chosen = assign(&self.options, &self.vehicles, &placed, &moment);
        let mut is_new = vec![true; sightings.len()];
        for (vehicle, k) in self.vehicles.iter_mut().zip(chosen) {
            vehicle.update(&moment, dt, k.map(|k| &placed[k]));
            k.into_iter().for_each(|k| is_new[k] = false);
        }
        for k in (0..sightings.len()).filter(|&k| is_new[k]) {
            self.last_id += 1;
            self.vehicles.push(Vehicle::new(self.last_id, &self.options, &moment, &placed[k]));
        }
        (self.time, self.frame) = (Some(time), self.frame + 1);
        self.hand_out_old();
        let least = self.options.least_sightings;
        self.now.clear();
        self.now.extend(self.vehicles.iter().filter(|v| v.sightings >= least).filter_map(Vehicle::row));
        Ok(&self.now)
    }

    /// Seconds since the frame before.
    fn checked(&self, time: f64, ego_motion: Option<[f64; 3]>) -> Result<Option<f64>, InputError> {
        require(time.is_finite(), "time", "finite seconds", Got::Number(time))?;
        if let Some(last) = self.time {
            require(time > last, "time", "seconds after the last frame's", Got::Pair(time, last))?;
        }
        let moves = self.options.camera_motion == CameraMotion::Odometry;
        match ego_motion {
            Some(moved) => {
                let got = Got::Text("an ego-motion");
                require(moves, "ego_motion", "none unless camera_motion is odometry", got)?;
                let finite = moved.iter().all(|x| x.is_finite());
                require(finite, "ego_motion", "finite numbers", Got::Text("NaN or infinite"))?;
            }
            None => {
                let first = self.time.is_none();
                require(!moves || first, "ego_motion", "the camera's motion since the last frame", Got::Text("none"))?;
            }
        }
        Ok(self.time.map(|last| time - last))
    }

    /// Vehicles that were not seen for too long leave.
    fn drop_lost(&mut self, time: f64) {
        let TrackOptions { least_sightings, longest_gap, .. } = self.options;
        let finished = &mut self.finished;
        self.vehicles.retain_mut(|vehicle| {
            let sure = vehicle.sightings >= least_sightings;
            let patience = if sure { longest_gap } else { HARDLY * longest_gap };
            // Rounding of times must not decide.
            let stays = time - vehicle.last_seen <= patience + 1e-9;
            if !stays && sure {
                vehicle.hand_out(0, finished);
            }
            stays
        });
    }

    /// The older half of long histories.
    fn hand_out_old(&mut self) {
        let TrackOptions { least_sightings, longest_history, .. } = self.options;
        for vehicle in &mut self.vehicles {
            if vehicle.frames() >= longest_history && vehicle.sightings >= least_sightings {
                vehicle.hand_out(longest_history / 2, &mut self.finished);
            }
        }
    }

    /// All vehicles leave. Frames may follow; their vehicles are new ones.
    pub fn finish(&mut self) {
        for mut vehicle in self.vehicles.drain(..) {
            if vehicle.sightings >= self.options.least_sightings {
                vehicle.hand_out(0, &mut self.finished);
            }
        }
        self.now.clear();
    }

    /// The frame, from 0, before which no row is to come any more, but those that wait for
    /// [`take_finished`](Self::take_finished).
    pub fn open_frame(&self) -> u64 {
        self.vehicles.iter().filter_map(Vehicle::first_frame).min().unwrap_or(self.frame)
    }

    /// Smoothed rows of vehicles that have left, and the older ones of those that stay long; each is handed out once.
    pub fn take_finished(&mut self) -> Vec<TrackRow> {
        core::mem::take(&mut self.finished)
    }
}

/// Where a camera is that has moved as it says itself.
fn moved_by(camera: &Camera2, [right, forward, turned]: [f64; 3]) -> Camera2 {
    let &Camera2 { place: [x, z], yaw, sin: s, cos: c } = camera;
    [x + right * c + forward * s, z + forward * c - right * s, yaw + turned].into()
}
