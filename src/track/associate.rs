//! Which sighting is which vehicle: the assignment of least cost among pairs that can be.

use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix;

use crate::geometry::math::norm2;
use crate::track::options::TrackOptions;
use crate::track::sighting::Sighting;
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

/// For each vehicle the sighting that it is, if any.
pub(crate) fn assign(
    options: &TrackOptions,
    vehicles: &[Vehicle],
    sightings: &[Sighting],
    moment: &Moment,
) -> Vec<Option<usize>> {
    let mut found = vec![None; vehicles.len()];
    let worths = worths(options, vehicles, sightings, moment);
    for (rows, columns) in groups(vehicles.len(), sightings.len(), &worths) {
        // A column of no worth for each vehicle that stays alone.
        let mut matrix = Matrix::new(rows.len(), columns.len() + rows.len(), 0_i64);
        for (i, &row) in rows.iter().enumerate() {
            for &(column, worth) in &worths[row] {
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

/// For each vehicle the sightings that it can be, with what each pair is worth.
fn worths(
    options: &TrackOptions,
    vehicles: &[Vehicle],
    sightings: &[Sighting],
    moment: &Moment,
) -> Vec<Vec<(usize, i64)>> {
    let of = |vehicle: &Vehicle| {
        let expected = vehicle.expected_box(moment.time);
        let gap = OF_GAP * (moment.time - vehicle.last_seen);
        let row = vehicle.filter.row(moment.camera);
        let pair = |(k, seen): (usize, &Sighting)| {
            let overlap = overlap(&expected, &seen.bbox);
            let worth = worth(options, vehicle, &row.seen_from, seen, moment, overlap) - gap;
            (worth > 0.0).then_some((k, (worth * UNITS) as i64))
        };
        sightings.iter().enumerate().filter_map(pair).collect()
    };
    vehicles.iter().map(of).collect()
}

fn worth(
    options: &TrackOptions,
    vehicle: &Vehicle,
    seen_from: &[f64; 3],
    seen: &Sighting,
    moment: &Moment,
    overlap: Option<f64>,
) -> f64 {
    let [x, z] = seen.reading.place;
    let apart = norm2(x - seen_from[0], z - seen_from[1]);
    let one_by_box = overlap.is_some_and(|o| o > OVERLAP);
    // Most pairs are far apart, and cost nothing.
    if !one_by_box && apart > 10.0 + 0.6 * norm2(x, z) {
        return 0.0;
    }
    let (d2, facing) = vehicle.filter.disagreement(moment.camera, seen);
    if !one_by_box && d2 > options.gate {
        return 0.0;
    }
    let of_class = if seen.class == vehicle.class() { 0.0 } else { OF_CLASS };
    let (of_place, of_facing) = match one_by_box {
        true => ((0.5 * d2).min(MOST_OF_PLACE), facing.min(MOST_OF_FACING)),
        false => (0.5 * d2, facing),
    };
    MOST - of_place - of_facing - OF_BOX * (1.0 - overlap.unwrap_or(0.5)) - of_class
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
fn groups(vehicles: usize, sightings: usize, worths: &[Vec<(usize, i64)>]) -> Vec<(Vec<usize>, Vec<usize>)> {
    let mut seen_by: Vec<Vec<usize>> = vec![vec![]; sightings];
    for (row, pairs) in worths.iter().enumerate() {
        pairs.iter().for_each(|&(column, _)| seen_by[column].push(row));
    }
    let (mut done_rows, mut done_columns) = (vec![false; vehicles], vec![false; sightings]);
    let mut found = vec![];
    for first in 0..vehicles {
        if done_rows[first] || worths[first].is_empty() {
            continue;
        }
        done_rows[first] = true;
        let (mut rows, mut columns, mut at) = (vec![first], vec![], 0);
        while at < rows.len() {
            for &(column, _) in &worths[rows[at]] {
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
