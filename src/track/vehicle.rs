//! A vehicle with its history.

use std::collections::VecDeque;

use crate::track::filter::VehicleFilter;
use crate::track::measure::PlacedSighting;
use crate::track::model::{Belief, Camera2, Transition};
use crate::track::options::TrackOptions;
use crate::track::row::{Told, TrackRow, row_of};
use crate::track::sighting::Sighting;
use crate::track::smooth::{Step, smoothed};

/// How much a new box changes how its sides move.
const BOX_RATE: f64 = 0.2;

/// When a vehicle was looked for, and from where.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    pub(crate) frame: u64,
    pub(crate) time: f64,
    pub(crate) camera: Camera2,
}

/// A frame in the history.
#[derive(Clone, Copy, Debug)]
struct Past {
    moment: Moment,
    sighting: Option<usize>,
    step: Step,
}

/// A vehicle with its history.
#[derive(Clone, Debug)]
pub(crate) struct Vehicle {
    pub(crate) id: u64,
    pub(crate) filter: VehicleFilter,
    pub(crate) last_seen: f64,
    pub(crate) sightings: usize,
    /// 2D box when it was last seen, and how its sides move, pixels per second.
    pub(crate) bbox: [f64; 4],
    pub(crate) bbox_rate: [f64; 4],
    classes: Vec<f64>,
    by_before: Transition,
    predicted: Belief,
    history: VecDeque<Past>,
}

impl Vehicle {
    pub(crate) fn new(id: u64, options: &TrackOptions, moment: &Moment, placed: &PlacedSighting) -> Self {
        let filter = VehicleFilter::first(options, moment.camera, placed);
        let seen = placed.seen;
        let mut vehicle = Self {
            id,
            filter,
            last_seen: moment.time,
            sightings: 1,
            bbox: seen.bbox,
            bbox_rate: [0.0; 4],
            classes: vec![],
            by_before: Transition::none(),
            predicted: filter.belief,
            history: VecDeque::new(),
        };
        vehicle.count_class(seen);
        vehicle.keep(moment, Some(seen.number));
        vehicle
    }

    /// `dt` seconds later.
    pub(crate) fn predict(&mut self, dt: f64, camera: &Camera2) {
        self.by_before = self.filter.advance(dt, camera);
        self.predicted = self.filter.belief;
    }

    /// It was seen, or not.
    pub(crate) fn update(&mut self, moment: &Moment, dt: f64, placed: Option<&PlacedSighting>) {
        if let Some(placed) = placed {
            self.filter.notice(dt, placed);
            self.predicted = self.filter.belief;
            self.filter.absorb(dt, placed);
            let seen = placed.seen;
            self.count_class(seen);
            self.move_box(&seen.bbox, moment.time);
            self.last_seen = moment.time;
            self.sightings += 1;
        }
        self.keep(moment, placed.map(|placed| placed.seen.number));
    }

    fn keep(&mut self, moment: &Moment, sighting: Option<usize>) {
        let step = Step {
            by_before: self.by_before,
            predicted: (&self.predicted).into(),
            updated: (&self.filter.belief).into(),
            standing: self.filter.stands(),
        };
        self.history.push_back(Past { moment: *moment, sighting, step });
    }

    fn count_class(&mut self, seen: &Sighting) {
        if self.classes.len() <= seen.class {
            self.classes.resize(seen.class + 1, 0.0);
        }
        self.classes[seen.class] += seen.probability.max(0.01);
    }

    /// The class it was seen as most; the first of equals.
    pub(crate) fn class(&self) -> usize {
        (0..self.classes.len()).fold(0, |best, k| if self.classes[k] > self.classes[best] { k } else { best })
    }

    fn move_box(&mut self, bbox: &[f64; 4], time: f64) {
        let dt = (time - self.last_seen).max(1e-3);
        for k in 0..4 {
            let rate = (bbox[k] - self.bbox[k]) / dt;
            self.bbox_rate[k] =
                if rate.is_finite() { self.bbox_rate[k] + BOX_RATE * (rate - self.bbox_rate[k]) } else { 0.0 };
        }
        self.bbox = *bbox;
    }

    /// Where its 2D box should be; NaN = not known.
    pub(crate) fn expected_box(&self, time: f64) -> [f64; 4] {
        core::array::from_fn(|k| self.bbox[k] + self.bbox_rate[k] * (time - self.last_seen))
    }

    /// What is known of it now.
    pub(crate) fn row(&self) -> Option<TrackRow> {
        let last = self.history.back()?;
        Some(self.completed(last, self.filter.row_seen_from(&last.moment.camera)))
    }

    fn completed(&self, past: &Past, row: TrackRow) -> TrackRow {
        let Moment { frame, time, .. } = past.moment;
        TrackRow { id: self.id, frame, time, class: self.class(), sighting: past.sighting, ..row }
    }

    /// The oldest frame of its history.
    pub(crate) fn first_frame(&self) -> Option<u64> {
        self.history.front().map(|past| past.moment.frame)
    }

    pub(crate) fn frames(&self) -> usize {
        self.history.len()
    }

    /// The oldest frames but the newest `kept`, smoothed by all; they leave the history. Those at the end in which it was
    /// not seen are none of its.
    pub(crate) fn hand_out(&mut self, kept: usize, rows: &mut Vec<TrackRow>) {
        let last_seen = self.history.iter().rposition(|past| past.sighting.is_some()).map_or(0, |k| k + 1);
        let known = if kept == 0 { last_seen } else { self.history.len() };
        let told = self.filter.told();
        let out = self.history.len().saturating_sub(kept).min(known);
        let newest_first = self.history.range(..known).rev();
        let smoothed = smoothed(newest_first.clone().map(|past| &past.step), self.filter.moving_sigma());
        let first = rows.len();
        for (past, (belief, standing)) in newest_first.zip(smoothed).skip(known - out) {
            let told = Told { standing, ..told };
            rows.push(self.completed(past, row_of(&belief, &told, &past.moment.camera)));
        }
        rows[first..].reverse();
        self.history.drain(..out);
    }
}
