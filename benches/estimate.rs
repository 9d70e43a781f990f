//! Time per object of the whole estimate and of its variants; the truth is asserted before anything is timed.
//!
//! `cargo bench --features synthetic`

use divan::Bencher;
use groundpose::camera::{Tilt, View};
use groundpose::estimate::Estimator;
use groundpose::object::{Bbox, ShapeModel};
use groundpose::observation::Observation;
use groundpose::options::{Options, Solver};
use groundpose::refine::Refinement;
use groundpose::synthetic::{Kind, Outliers, Protocol, Scene};
use groundpose::workspace::GrowingWorkspace;

/// Objects timed in turn, so that no single easy or hard one decides.
const OBJECTS: u64 = 100;

/// A setting: its name, its scenes.
const SETTINGS: [(&str, Kind, f64, Outliers); 4] = [
    ("vehicle", Kind::Vehicle, 0.35, Outliers::Box),
    ("cube 50 %", Kind::Cube, 0.5, Outliers::Image),
    ("cube 90 % image", Kind::Cube, 0.9, Outliers::Image),
    ("cube 90 % box", Kind::Cube, 0.9, Outliers::Box),
];

/// A method: its name, its options.
fn methods() -> [(&'static str, Options); 5] {
    let default = Options::default();
    let hre = Options { refinement: Refinement::Hre, ..default };
    [
        ("default", default),
        ("p1p + hre", hre),
        ("p1p + gn", Options { refinement: Refinement::Gn, ..default }),
        ("p3p + hre", Options { solver: Solver::P3p, ..hre }),
        ("up2p + hre", Options { solver: Solver::Up2p, ..hre }),
    ]
}

/// Every setting with every method.
fn cases() -> impl Iterator<Item = String> {
    SETTINGS.iter().flat_map(|(setting, ..)| methods().map(|(method, _)| format!("{setting}, {method}")))
}

struct Case {
    view: View,
    bbox_3d: [[f64; 3]; 2],
    scenes: Vec<Scene>,
    estimator: Estimator,
}

impl Case {
    fn new(name: &str) -> Self {
        let (setting, method) = name.split_once(", ").expect("setting, method");
        let &(_, kind, outlier_ratio, outliers) = SETTINGS.iter().find(|s| s.0 == setting).expect("a setting");
        let (_, options) = methods().into_iter().find(|m| m.0 == method).expect("a method");
        let protocol = Protocol { kind, outlier_ratio, outliers, ..Protocol::default() };
        Self {
            view: View::new(protocol.camera(), Tilt::default()).expect("a view"),
            bbox_3d: protocol.bbox_3d(),
            scenes: (0..OBJECTS).map(|trial| protocol.scene(0, trial)).collect(),
            estimator: Estimator::new(options).expect("options"),
        }
    }

    /// Depth error of one object, share of the truth; infinite without an answer.
    fn estimate(&self, scene: &Scene, workspace: &mut GrowingWorkspace) -> f64 {
        let model = ShapeModel::rigid(&scene.keypoints_3d, self.bbox_3d).expect("a model");
        let observation = Observation::new(&scene.keypoints_2d, &model)
            .and_then(|o| Ok(o.with_bbox(Bbox::new(scene.bbox)?)))
            .and_then(|o| o.with_inlier_threshold(scene.inlier_threshold))
            .expect("an observation");
        let estimate = self.estimator.estimate(&self.view, &observation, workspace);
        estimate.map_or(f64::INFINITY, |e| (e.pose.t - scene.pose.t).norm() / scene.pose.t.norm())
    }
}

#[divan::bench(args = cases())]
fn object(bencher: Bencher, name: &str) {
    let case = Case::new(name);
    let mut workspace = GrowingWorkspace::new();
    let mut errors: Vec<f64> = case.scenes.iter().map(|scene| case.estimate(scene, &mut workspace)).collect();
    errors.sort_by(f64::total_cmp);
    let median = errors[errors.len() / 2];
    assert!(median < 0.05, "{name}: median translation error {median}");
    let mut next = case.scenes.iter().cycle();
    bencher.bench_local(|| next.next().map(|scene| case.estimate(scene, &mut workspace)));
}

fn main() {
    divan::main();
}
