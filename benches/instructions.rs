//! Counts of the work of an estimate by stage, one line of JSON per row, read by `groundpose bench --instructions`.
//! Every row includes the stages before it.
//!
//! `cargo bench --bench instructions` prints draws, hypotheses, steps, allocations and times. `cargo bench` passes the
//! argument `--bench`; without it every row runs once, so that instructions can be counted from outside, one dump per
//! row in the same order:
//!
//! ```text
//! valgrind --tool=callgrind --toggle-collect=instructions::measured --dump-after=instructions::measured EXE
//! ```
//!
//! `--only TEXT` leaves out the rows in whose `SETTING, WORK` the text does not occur: `--only "M = 5, search + hre"`.

mod common;

use std::hint::black_box;
use std::time::Instant;

use common::{CUBE_50, CUBE_90, Method, Methods, Objects, Setting, VEHICLE, VEHICLE_5, VEHICLE_10};
use common::{Work, assert_right, searches, stages, whole, with_objects};
use groundpose::GrowingWorkspace;

/// Timed passes over all objects; the median counts.
const PASSES: usize = 31;

/// Sets of objects, and the methods that are run on each.
const TABLE: [(&Setting, Methods); 6] = [
    (&VEHICLE, stages),
    (&VEHICLE_5, stages),
    (&VEHICLE_10, stages),
    (&CUBE_50, stages),
    (&VEHICLE, searches),
    (&CUBE_90, whole),
];

/// Works on all objects once. The profiler finds it by its name, so it is not inlined and has no generic arguments.
#[inline(never)]
fn measured(work: &Work, objects: &Objects, workspace: &mut GrowingWorkspace) {
    for index in objects.indices() {
        black_box(work.run(objects, index, workspace));
    }
}

/// Counts of the search and the refinement, summed over the objects.
#[derive(Default)]
struct Done {
    keypoints: usize,
    draws: usize,
    hypotheses: usize,
    steps: usize,
}

impl Done {
    fn of(work: &Work, objects: &Objects, workspace: &mut GrowingWorkspace) -> Self {
        let mut done = Self::default();
        for index in objects.indices() {
            done.keypoints += objects.observations[index].keypoints_2d().len();
            if let Some(estimate) = work.run(objects, index, workspace) {
                done.draws += estimate.ransac.iterations;
                done.hypotheses += estimate.ransac.hypotheses;
                done.steps += estimate.stages.iter().map(|s| s.iterations).sum::<usize>();
            }
        }
        done
    }
}

/// Median seconds of a pass of every method; the methods are timed alternately.
fn times(methods: &[Method], objects: &Objects, workspace: &mut GrowingWorkspace) -> Vec<f64> {
    let mut seconds = vec![vec![]; methods.len()];
    for _ in 0..PASSES {
        for ((_, work), seconds) in methods.iter().zip(&mut seconds) {
            let start = Instant::now();
            measured(work, objects, workspace);
            seconds.push(start.elapsed().as_secs_f64());
        }
    }
    let median = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all[PASSES / 2]
    };
    seconds.into_iter().map(median).collect()
}

fn main() {
    let is_timed = std::env::args().any(|argument| argument == "--bench");
    let only = std::env::args().skip_while(|argument| argument != "--only").nth(1).unwrap_or_default();
    for (setting, methods) in TABLE {
        let mut methods = methods();
        methods.retain(|(name, _)| format!("{}, {name}", setting.name).contains(&only));
        if methods.is_empty() {
            continue;
        }
        with_objects(setting, |objects| {
            let mut workspace = GrowingWorkspace::new();
            let rows: Vec<(f64, Done)> = methods
                .iter()
                .map(|(name, work)| (assert_right(name, work, objects), Done::of(work, objects, &mut workspace)))
                .collect();
            if !is_timed {
                methods.iter().for_each(|(_, work)| measured(work, objects, &mut workspace));
                return;
            }
            let seconds = times(&methods, objects, &mut workspace);
            for (((name, work), (error, done)), seconds) in methods.iter().zip(rows).zip(seconds) {
                let allocations = allocation_counter::measure(|| measured(work, objects, &mut workspace)).count_total;
                let Done { keypoints, draws, hypotheses, steps } = done;
                let (setting, count) = (setting.name, objects.scenes.len());
                let microseconds = 1e6 * seconds / count as f64;
                println!(
                    "{{\"setting\": \"{setting}\", \"work\": \"{name}\", \"objects\": {count}, \
                     \"keypoints\": {keypoints}, \"draws\": {draws}, \"hypotheses\": {hypotheses}, \
                     \"steps\": {steps}, \"allocations\": {allocations}, \"median e_t\": {error:e}, \
                     \"us per object\": {microseconds:.4}}}"
                );
            }
        });
    }
}
