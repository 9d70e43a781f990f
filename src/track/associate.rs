//! Which sighting is which vehicle: the assignment of least cost among pairs that can be.

use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix;

use crate::geometry::math::norm2;
use crate::track::measure::{Expected, PlacedSighting};
use crate::track::options::TrackOptions;
use crate::track::row::where_seen;
use crate::track::vehicle::{Moment, Vehicle};

/// Costs are log probabilities: nothing costs more than this, and a pair that costs more is none.
const MOST: f64 = 17.0;
/// A place, and axis and front, say no more than this of boxes that overlap.
const MOST_OF_PLACE: f64 = 3.0;
const MOST_OF_FACING: f64 = 3.0;
/// 2D boxes that do not overlap.
const OF_BOX: f64 = 12.0;
/// Another class.
const OF_CLASS: f64 = 1.5;
/// A second in which it was not seen.
const OF_GAP: f64 = 2.0;
/// Boxes that overlap so far are one vehicle, wherever the pose puts it.
const OVERLAP: f64 = 0.4;
/// For whole numbers: costs are compared exactly, on every machine alike.
const UNITS: f64 = 1e6;

/// Distances differ by less from rounding, in themselves.
const ROUNDING: f64 = 1e-6;

/// For each vehicle the sighting that it is, if any.
pub(crate) fn assign(
    options: &TrackOptions,
    vehicles: &[Vehicle],
    sightings: &[PlacedSighting],
    moment: &Moment,
) -> Vec<Option<usize>> {
    let mut found = vec![None; vehicles.len()];
    let worths = Worths::of(options, vehicles, sightings, moment);
    let mut wanted = vec![0; sightings.len()];
    worths.pairs.iter().for_each(|&(column, _)| wanted[column] += 1);
    let mut is_done = vec![false; vehicles.len()];
    for row in 0..vehicles.len() {
        match worths.row(row) {
            [] => is_done[row] = true,
            // Most vehicles can be one sighting alone, which nobody else can be.
            &[(column, _)] if wanted[column] == 1 => (found[row], is_done[row]) = (Some(column), true),
            _ => {}
        }
    }
    for (rows, columns) in groups(is_done, sightings.len(), &worths) {
        // A column of no worth for each vehicle that stays alone.
        let mut matrix = Matrix::new(rows.len(), columns.len() + rows.len(), 0_i64);
        for (i, &row) in rows.iter().enumerate() {
            for &(column, worth) in worths.row(row) {
                let j = columns.binary_search(&column).expect("a column of the group");
                matrix[(i, j)] = worth;
            }
        }
        let (_, chosen) = kuhn_munkres(&matrix);
        for (i, j) in chosen.into_iter().enumerate() {
            if j < columns.len() && matrix[(i, j)] > 0 {
                found[rows[i]] = Some(columns[j]);
            }
        }
    }
    found
}

/// For each vehicle, a row, the sightings that it can be, with what each pair is worth.
struct Worths {
    pairs: Vec<(usize, i64)>,
    /// Of the pairs of each row.
    ends: Vec<usize>,
}

impl Worths {
    fn of(options: &TrackOptions, vehicles: &[Vehicle], sightings: &[PlacedSighting], moment: &Moment) -> Self {
        let mut found = Self { pairs: vec![], ends: Vec::with_capacity(vehicles.len()) };
        for vehicle in vehicles {
            let candidate = Candidate::of(options, vehicle, moment);
            for (k, seen) in sightings.iter().enumerate() {
                let worth = (candidate.worth(seen) * UNITS) as i64;
                if worth > 0 {
                    found.pairs.push((k, worth));
                }
            }
            found.ends.push(found.pairs.len());
        }
        found
    }

    fn row(&self, k: usize) -> &[(usize, i64)] {
        let start = if k == 0 { 0 } else { self.ends[k - 1] };
        &self.pairs[start..self.ends[k]]
    }
}

/// A vehicle that looks for its sighting, with what is the same for all of them.
struct Candidate<'a> {
    options: &'a TrackOptions,
    vehicle: &'a Vehicle,
    expected: Expected,
    bbox: [f64; 4],
    place: [f64; 2],
    class: usize,
    /// What it costs not to have been seen before.
    gap: f64,
}

impl<'a> Candidate<'a> {
    fn of(options: &'a TrackOptions, vehicle: &'a Vehicle, moment: &Moment) -> Self {
        Self {
            options,
            vehicle,
            expected: vehicle.filter.expected(),
            bbox: vehicle.expected_box(moment.time),
            place: where_seen(&vehicle.filter.belief, &moment.camera),
            class: vehicle.class(),
            gap: OF_GAP * (moment.time - vehicle.last_seen),
        }
    }

    /// Of a pair; not above 0: it is none.
    fn worth(&self, seen: &PlacedSighting) -> f64 {
        let overlap = overlap(&self.bbox, &seen.seen.bbox);
        if self.is_far(seen, overlap) { 0.0 } else { self.worth_of_all(seen, overlap) }
    }

    fn of_class(&self, seen: &PlacedSighting) -> f64 {
        if seen.seen.class == self.class { 0.0 } else { OF_CLASS }
    }

    /// Most pairs are so far apart that nothing else could make them one: told at hardly any cost.
    fn is_far(&self, seen: &PlacedSighting, overlap: Option<f64>) -> bool {
        let left = MOST - of_box(overlap) - self.of_class(seen) - self.gap;
        let farthest = self.options.gate.min(2.0 * left) * (1.0 + ROUNDING) + ROUNDING;
        let is_far = |reading| self.expected.least_distance2(reading) > farthest;
        !is_one_by_box(overlap) && is_far(&seen.reading) && seen.other.as_ref().is_none_or(|(other, _)| is_far(other))
    }

    fn worth_of_all(&self, seen: &PlacedSighting, overlap: Option<f64>) -> f64 {
        let [x, z] = seen.seen.reading.place;
        let apart = norm2(x - self.place[0], z - self.place[1]);
        let is_one = is_one_by_box(overlap);
        if !is_one && apart > 10.0 + 0.6 * norm2(x, z) {
            return 0.0;
        }
        let (d2, facing) = self.vehicle.filter.disagreement(&self.expected, seen);
        if !is_one && d2 > self.options.gate {
            return 0.0;
        }
        let (of_place, of_facing) = match is_one {
            true => ((0.5 * d2).min(MOST_OF_PLACE), facing.min(MOST_OF_FACING)),
            false => (0.5 * d2, facing),
        };
        MOST - of_place - of_facing - of_box(overlap) - self.of_class(seen) - self.gap
    }
}

fn of_box(overlap: Option<f64>) -> f64 {
    OF_BOX * (1.0 - overlap.unwrap_or(0.5))
}

fn is_one_by_box(overlap: Option<f64>) -> bool {
    overlap.is_some_and(|o| o > OVERLAP)
}

/// Intersection over union; none for boxes that are not known.
fn overlap(a: &[f64; 4], b: &[f64; 4]) -> Option<f64> {
    let side = |low: f64, high: f64| (high - low).max(0.0);
    let both = side(a[0].max(b[0]), a[2].min(b[2])) * side(a[1].max(b[1]), a[3].min(b[3]));
    let area = |c: &[f64; 4]| side(c[0], c[2]) * side(c[1], c[3]);
    let known = a.iter().chain(b).all(|x| x.is_finite());
    let union = area(a) + area(b) - both;
    (known && union > 0.0).then(|| both / union)
}

/// Vehicles and sightings that are connected by pairs, apart from all others; both sorted.
fn groups(mut done_rows: Vec<bool>, sightings: usize, worths: &Worths) -> Vec<(Vec<usize>, Vec<usize>)> {
    let mut found = vec![];
    if done_rows.iter().all(|&done| done) {
        return found;
    }
    let mut seen_by: Vec<Vec<usize>> = vec![vec![]; sightings];
    for row in 0..done_rows.len() {
        worths.row(row).iter().for_each(|&(column, _)| seen_by[column].push(row));
    }
    let mut done_columns = vec![false; sightings];
    for first in 0..done_rows.len() {
        if core::mem::replace(&mut done_rows[first], true) {
            continue;
        }
        let (mut rows, mut columns, mut at) = (vec![first], vec![], 0);
        while at < rows.len() {
            for &(column, _) in worths.row(rows[at]) {
                if core::mem::replace(&mut done_columns[column], true) {
                    continue;
                }
                columns.push(column);
                for &row in &seen_by[column] {
                    if !core::mem::replace(&mut done_rows[row], true) {
                        rows.push(row);
                    }
                }
            }
            at += 1;
        }
        rows.sort_unstable();
        columns.sort_unstable();
        found.push((rows, columns));
    }
    found
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::track::sighting::{Reading, Sighting};

    struct Random(Xoshiro256PlusPlus);

    impl Random {
        fn between(&mut self, low: f64, high: f64) -> f64 {
            low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
        }

        /// Near a place, sure of it or not, in any direction; with a box or none, with another reading or none.
        fn sighting(&mut self, near: [f64; 2], within: f64) -> Sighting {
            let mut seen = Sighting::new(self.reading(near, within));
            if self.between(0.0, 1.0) < 0.5 {
                let (left, top) = (self.between(0.0, 40.0), self.between(0.0, 40.0));
                seen.bbox = [left, top, left + self.between(10.0, 60.0), top + self.between(10.0, 60.0)];
            }
            if self.between(0.0, 1.0) < 0.5 {
                seen.other = Some((self.reading(near, within), self.between(0.0, 1.0)));
            }
            (seen.turned, seen.class) = (self.between(0.0, 1.0), self.between(0.0, 2.0) as usize);
            seen
        }

        fn reading(&mut self, [x, z]: [f64; 2], within: f64) -> Reading {
            let size = self.between(-4.0, 1.5).exp();
            let root = Matrix3::from_fn(|_, _| size * self.between(-1.0, 1.0)) + Matrix3::identity() * 1e-2;
            let place = [x + self.between(-within, within), z + self.between(-within, within)];
            Reading { place, heading: self.between(-4.0, 4.0), covariance: root * root.transpose() }
        }
    }

    #[test]
    fn what_is_told_to_be_far_is_no_pair() {
        let mut random = Random(Xoshiro256PlusPlus::seed_from_u64(5));
        let options = TrackOptions::default();
        let (mut found, mut spared) = (0, 0);
        for k in 0..3000 {
            let camera = [random.between(-5.0, 5.0), random.between(-5.0, 5.0), random.between(-3.0, 3.0)].into();
            let place = [random.between(-20.0, 20.0), random.between(2.0, 80.0)];
            let at = |frame: u64| Moment { frame, time: 0.1 * frame as f64, camera };
            let first = random.sighting(place, 1.0);
            let mut vehicle = Vehicle::new(1, &options, &at(0), &PlacedSighting::of(&camera, &first));
            for frame in 1..k % 7 {
                vehicle.predict(0.1, &camera);
                let seen = random.sighting(place, 1.0);
                vehicle.update(&at(frame), 0.1, Some(&PlacedSighting::of(&camera, &seen)));
            }
            vehicle.predict(0.1, &camera);
            let candidate = Candidate::of(&options, &vehicle, &at(k % 7 + 1));
            for within in [1.0, 5.0, 20.0, 60.0] {
                let seen = random.sighting(place, within);
                let seen = PlacedSighting::of(&camera, &seen);
                let overlap = overlap(&candidate.bbox, &seen.seen.bbox);
                let (is_far, worth) = (candidate.is_far(&seen, overlap), candidate.worth_of_all(&seen, overlap));
                assert!(!is_far || worth <= 0.0, "{worth}");
                found += usize::from(worth > 0.0);
                spared += usize::from(is_far);
            }
        }
        assert!(found > 1000 && spared > 1000, "{found} pairs, {spared} that are far");
    }
}
