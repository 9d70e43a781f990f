//! The tracker on motions whose truth is known.

use core::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::track::options::{CameraMotion, TrackOptions};
use crate::track::row::{TrackRow, wrapped};
use crate::track::sighting::{Reading, Sighting};
use crate::track::tracker::Tracker;

const DT: f64 = 0.1;

struct Random(Xoshiro256PlusPlus);

impl Random {
    fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (2.0 * PI * self.uniform()).cos()
    }
}

/// Place, heading, speed along it and yaw rate.
#[derive(Clone, Copy)]
struct Truth([f64; 2], f64, f64, f64);

impl Truth {
    fn later(self, dt: f64, acceleration: f64, turning: f64) -> Self {
        let Self([x, z], heading, speed, rate) = self;
        // Small steps stand in for the integral.
        let (mut x, mut z, mut heading, mut speed, mut rate) = (x, z, heading, speed, rate);
        for _ in 0..20 {
            let h = dt / 20.0;
            (x, z) =
                (x + h * speed * (heading + 0.5 * h * rate).sin(), z + h * speed * (heading + 0.5 * h * rate).cos());
            (heading, speed, rate) = (heading + h * rate, speed + h * acceleration, rate + h * turning);
        }
        Self([x, z], heading, speed, rate)
    }
}

/// A sighting with errors as it states them: of the scale of all its frames, of this second, of this frame.
fn seen(truth: &Truth, camera: [f64; 3], errors: [f64; 3], sigmas: (f64, f64)) -> Sighting {
    let (distance_sigma, heading_sigma) = sigmas;
    let [dx, dz] = [truth.0[0] - camera[0], truth.0[1] - camera[1]];
    let (s, c) = camera[2].sin_cos();
    let rel = [dx * c - dz * s, dx * s + dz * c];
    let distance = rel[0].hypot(rel[1]);
    let ray = Vector3::new(rel[0], rel[1], 0.0) / distance;
    let across = 0.003 * distance;
    let along = ray * ray.transpose();
    let plane = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
    let covariance = along * (distance_sigma * distance).powi(2)
        + (plane - along) * across * across
        + Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, heading_sigma * heading_sigma));
    let grown = errors[0].exp();
    let side = Vector3::new(-ray[1], ray[0], 0.0) * across * errors[1];
    let place = [rel[0] * grown + side[0], rel[1] * grown + side[1]];
    let heading = truth.1 - camera[2] + errors[2];
    Sighting { turned: 0.1, ..Sighting::new(Reading { place, heading, covariance }) }
}

fn rows(tracker: &mut Tracker) -> Vec<TrackRow> {
    tracker.finish();
    let mut rows = tracker.take_finished();
    rows.sort_by_key(|row| (row.id, row.frame));
    rows
}

#[test]
fn a_line_and_an_arc_are_followed_exactly() {
    for rate in [0.0, 0.3] {
        let mut tracker = Tracker::new(TrackOptions::default()).unwrap();
        // The middle of a vehicle that turns about its rear axle slips; this one turns about its middle.
        let mut truths = vec![Truth([-8.0, 20.0], 0.4, 7.0, rate)];
        for k in 0..40 {
            let truth = truths[k];
            tracker.update(DT * k as f64, None, &[seen(&truth, [0.0; 3], [0.0; 3], (0.002, 0.01))]).unwrap();
            truths.push(truth.later(DT, 0.0, 0.0));
        }
        let rows = rows(&mut tracker);
        assert_eq!(rows.len(), 40);
        for (row, truth) in rows.iter().zip(&truths) {
            let off = (row.place[0] - truth.0[0]).hypot(row.place[1] - truth.0[1]);
            assert!(off < 0.1, "{rate}: {off} m");
            assert!(wrapped(row.heading - truth.1).abs() < 0.02, "{rate}: {} for {}", row.heading, truth.1);
            assert!((row.speed - 7.0).abs() < 0.25, "{rate}: {}", row.speed);
            assert!((row.yaw_rate - rate).abs() < 0.1, "{rate}: {}", row.yaw_rate);
        }
    }
}

/// Errors of place, heading and speed against stated ones, and how often 95 % regions hold the truth.
fn coverage(smooth: bool, turning: f64) -> [f64; 3] {
    let options = TrackOptions { longest_history: 1000, ..TrackOptions::default() };
    let mut held = [0.0; 3];
    let mut count = 0.0;
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let speed = if seed % 4 == 0 { 0.0 } else { 4.0 + 8.0 * random.uniform() };
        let start = [30.0 * (random.uniform() - 0.5), 20.0 + 20.0 * random.uniform()];
        let mut truth = Truth(start, 2.0 * PI * random.uniform(), speed, 0.0);
        let mut tracker = Tracker::new(options).unwrap();
        let (sigma_d, sigma_h) = (0.06, 0.08);
        let (constant, slow): (f64, f64) = (options.constant_fraction, options.slow_fraction);
        let scale = constant.sqrt() * sigma_d * random.normal();
        let (mut d, mut h) = (random.normal(), random.normal());
        let mut truths = vec![];
        let mut now = vec![];
        for k in 0..50 {
            let own = options.own_fraction;
            let errors = [
                scale + sigma_d * ((0.25 * slow).sqrt() * d + (0.5 * own).sqrt() * random.normal()),
                random.normal(),
                sigma_h * (slow.sqrt() * h + own.sqrt() * random.normal()),
            ];
            let found = tracker.update(DT * f64::from(k), None, &[seen(&truth, [0.0; 3], errors, (sigma_d, sigma_h))]);
            now.extend(found.unwrap().iter().copied());
            truths.push(truth);
            let keep = (-DT / options.error_time).exp();
            let new = (1.0 - keep * keep).sqrt();
            (d, h) = (keep * d + new * random.normal(), keep * h + new * random.normal());
            if speed > 0.0 {
                truth = truth.later(DT, 1.0 * random.normal(), turning * random.normal());
                truth.3 *= 0.9;
            }
        }
        let rows = if smooth { rows(&mut tracker) } else { now };
        for row in rows {
            let Truth([x, z], heading, speed, _) = truths[row.frame as usize];
            let e = nalgebra::Vector2::new(row.place[0] - x, row.place[1] - z);
            let inverse = row.place_covariance.try_inverse().unwrap();
            let turned = wrapped(row.heading - heading);
            held[0] += f64::from(e.dot(&(inverse * e)) < 5.99);
            held[1] += f64::from(turned.abs() < 1.96 * row.heading_sigma);
            held[2] += f64::from((row.speed - speed).abs() < 1.96 * row.speed_sigma);
            count += 1.0;
        }
    }
    held.map(|x| x / count)
}

#[test]
fn stated_regions_hold_the_truth() {
    for smooth in [false, true] {
        for held in coverage(smooth, 0.5) {
            assert!(held > 0.90, "smoothed: {smooth}, {held}");
        }
    }
}

#[test]
fn motion_says_where_the_front_is() {
    let mut tracker = Tracker::new(TrackOptions::default()).unwrap();
    let mut truth = Truth([-10.0, 25.0], PI / 2.0, 8.0, 0.0);
    for k in 0..20 {
        let mut sighting = seen(&truth, [0.0; 3], [0.0; 3], (0.05, 0.05));
        // The network takes its rear for its front, in every frame, and is sure of it.
        sighting.reading.heading += PI;
        tracker.update(DT * f64::from(k), None, &[sighting]).unwrap();
        truth = truth.later(DT, 0.0, 0.0);
    }
    for row in rows(&mut tracker) {
        assert!(wrapped(row.heading - PI / 2.0).abs() < 0.1, "{}", row.heading);
        assert!(row.facing_probability > 0.9 && row.speed > 6.0);
    }
}

#[test]
fn parked_vehicles_stand_and_say_how_large_they_are_to_a_camera_that_passes() {
    let options = TrackOptions { camera_motion: CameraMotion::Odometry, ..TrackOptions::default() };
    let mut tracker = Tracker::new(options).unwrap();
    let truth = Truth([4.0, 40.0], 0.1, 0.0, 0.0);
    // All its distances are 6 % too large: it is smaller than cars are.
    for k in 0..30 {
        let camera = [0.0, f64::from(k), 0.0];
        let mut sighting = seen(&truth, camera, [0.06, 0.0, 0.0], (0.06, 0.05));
        (sighting.size, sighting.size_sigma) = ([4.5, 1.6, 1.9], [0.3, 0.1, 0.12]);
        tracker.update(DT * f64::from(k), Some([0.0, 1.0, 0.0]), &[sighting]).unwrap();
    }
    let rows = rows(&mut tracker);
    for row in &rows[5..] {
        assert!(row.speed.abs() < 0.6, "{}", row.speed);
        let off = (row.place[0] - 4.0).hypot(row.place[1] - 40.0);
        assert!(off < 0.6, "{off}");
    }
    let last = rows[29];
    assert!(last.standing);
    assert!((last.size[0] * 0.06_f64.exp() / 4.5 - 1.0).abs() < 0.03, "{:?}", last.size);
}

#[test]
fn answers_are_the_same_bits_again_and_memory_stays_flat() {
    let run = || {
        let options = TrackOptions { longest_history: 40, ..TrackOptions::default() };
        let mut tracker = Tracker::new(options).unwrap();
        let mut random = Random::new(7);
        let (mut found, mut open) = (vec![], 0);
        for k in 0..300_u32 {
            let cars: Vec<Sighting> = (0..6)
                .map(|n| {
                    let truth = Truth([6.0 * f64::from(n) - 15.0, 30.0], 0.0, 0.0, 0.0);
                    let errors = [0.02 * random.normal(), random.normal(), 0.05 * random.normal()];
                    seen(&truth, [0.0; 3], errors, (0.05, 0.05))
                })
                .collect();
            tracker.update(DT * f64::from(k), None, &cars).unwrap();
            let rows = tracker.take_finished();
            assert!(rows.len() <= 6 * 40);
            assert!(rows.iter().all(|row| row.frame >= open), "no row of a frame that was complete");
            open = tracker.open_frame();
            assert!(open + 40 > u64::from(k), "complete after the longest history");
            found.extend(rows);
        }
        tracker.finish();
        found.extend(tracker.take_finished());
        found
    };
    let (a, b) = (run(), run());
    assert_eq!(a.len(), 6 * 300);
    assert_eq!(format!("{a:?}"), format!("{b:?}"));
    let mut frames: Vec<(u64, u64)> = a.iter().map(|row| (row.id, row.frame)).collect();
    frames.sort_unstable();
    frames.dedup();
    assert_eq!(frames.len(), a.len(), "every frame of every vehicle once");
}

#[test]
fn mistakes_of_the_caller_change_nothing() {
    let mut tracker = Tracker::new(TrackOptions::default()).unwrap();
    let car = seen(&Truth([0.0, 20.0], 0.0, 0.0, 0.0), [0.0; 3], [0.0; 3], (0.05, 0.05));
    tracker.update(0.0, None, &[car]).unwrap();
    let before = format!("{tracker:?}");
    let mut bad = car;
    bad.reading.place[0] = f64::NAN;
    assert_eq!(tracker.update(0.1, None, &[car, bad]).unwrap_err().argument, "pose");
    for time in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(tracker.update(time, None, &[car]).unwrap_err().argument, "time");
    }
    assert_eq!(tracker.update(0.1, Some([0.0; 3]), &[car]).unwrap_err().argument, "ego_motion");
    assert_eq!(format!("{tracker:?}"), before);
    assert!(tracker.update(1e9, None, &[]).unwrap().is_empty(), "a gap of thirty years");
}

#[test]
fn a_vehicle_that_enters_where_another_left_is_a_new_one() {
    let mut tracker = Tracker::new(TrackOptions::default()).unwrap();
    let mut truth = Truth([6.0, 80.0], 0.0, 12.0, 0.0);
    let seen_with_box = |truth: &Truth, bbox: [f64; 4]| Sighting {
        turned: 0.05,
        bbox,
        ..seen(truth, [0.0; 3], [0.0; 3], (0.08, 0.08))
    };
    for k in 0..30 {
        let left = 700.0 - f64::from(k);
        tracker.update(DT * f64::from(k), None, &[seen_with_box(&truth, [left, 135.0, left + 28.0, 156.0])]).unwrap();
        truth = truth.later(DT, 0.0, 0.0);
    }
    let mut oncoming = Truth([3.0, 112.0], PI, 12.0, 0.0);
    for k in 37..60 {
        let top = 155.0 + 0.5 * f64::from(k - 37);
        tracker.update(DT * f64::from(k), None, &[seen_with_box(&oncoming, [655.0, top, 673.0, top + 17.0])]).unwrap();
        oncoming = oncoming.later(DT, 0.0, 0.0);
    }
    let rows = rows(&mut tracker);
    for row in &rows {
        let away = row.frame < 30;
        assert_eq!(row.id, if away { 1 } else { 2 });
        assert!(wrapped(row.heading - if away { 0.0 } else { PI }).abs() < 0.3, "{}: {}", row.frame, row.heading);
    }
}
