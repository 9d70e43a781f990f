//! Time of the stages of an estimate; every row includes the stages before it. The answers are compared with the
//! truth before timing.
//!
//! `cargo bench --bench stages`; `cargo test --bench stages` runs every case once.

mod common;

use common::{CUBE_50, Setting, VEHICLE, VEHICLE_5, assert_right, named, stages, with_objects};
use divan::Bencher;
use groundpose::GrowingWorkspace;

const SETTINGS: [&Setting; 3] = [&VEHICLE, &VEHICLE_5, &CUBE_50];

fn cases() -> impl Iterator<Item = &'static str> {
    stages().into_iter().map(|(stage, _)| stage)
}

fn stage(bencher: Bencher, setting: &Setting, name: &str) {
    let work = named(stages(), name);
    with_objects(setting, |objects| {
        assert_right(name, &work, objects);
        let mut workspace = GrowingWorkspace::new();
        let mut next = objects.indices().cycle();
        bencher.bench_local(|| next.next().map(|index| work.run(objects, index, &mut workspace)));
    });
}

#[divan::bench(args = cases())]
fn vehicle(bencher: Bencher, name: &str) {
    stage(bencher, SETTINGS[0], name);
}

#[divan::bench(args = cases())]
fn vehicle_with_5_modes(bencher: Bencher, name: &str) {
    stage(bencher, SETTINGS[1], name);
}

#[divan::bench(args = cases())]
fn cube_50_percent_outliers(bencher: Bencher, name: &str) {
    stage(bencher, SETTINGS[2], name);
}

fn main() {
    divan::main();
}
