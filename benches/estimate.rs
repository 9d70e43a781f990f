//! Time per object of the whole estimate and of its variants. The answers are compared with the truth before timing.
//!
//! `cargo bench --bench estimate`; `cargo test --bench estimate` runs every case once.

mod common;

use common::with_objects;
use common::{CUBE_50, CUBE_90, CUBE_90_BOX, Setting, VEHICLE, VEHICLE_5, VEHICLE_10, assert_right, named, searches};
use divan::Bencher;
use groundpose::GrowingWorkspace;

const SETTINGS: [&Setting; 6] = [&VEHICLE, &VEHICLE_5, &VEHICLE_10, &CUBE_50, &CUBE_90, &CUBE_90_BOX];

/// Every setting with every method.
fn cases() -> impl Iterator<Item = String> {
    SETTINGS.iter().flat_map(|s| searches().into_iter().map(|(method, _)| format!("{}, {method}", s.name)))
}

#[divan::bench(args = cases())]
fn object(bencher: Bencher, name: &str) {
    let (setting, method) = name.split_once(", ").expect("setting, method");
    let setting = SETTINGS.iter().find(|s| s.name == setting).expect("a setting");
    let work = named(searches(), method);
    with_objects(setting, |objects| {
        assert_right(name, &work, objects);
        let mut workspace = GrowingWorkspace::new();
        let mut next = objects.indices().cycle();
        bencher.bench_local(|| next.next().map(|index| work.run(objects, index, &mut workspace)));
    });
}

fn main() {
    divan::main();
}
