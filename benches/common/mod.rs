//! Tables common to the benches: objects with known truth, and the work done on them.
#![allow(dead_code, reason = "every bench uses its own part")]

use std::hint::black_box;

use groundpose::minimal::MinimalSolver;
use groundpose::minimal::p1p::{Cases, P1p};
use groundpose::synthetic::{Kind, Outliers, Protocol, Scene};
use groundpose::{
    Bbox, Estimate, Estimator, GrowingWorkspace, Observation, Options, Refinement, ShapeModel, Solver, Tilt, View,
};

/// A set of objects of one difficulty.
pub struct Setting {
    pub name: &'static str,
    /// Number of objects: many, so that no single one dominates.
    objects: u64,
    kind: Kind,
    outlier_ratio: f64,
    outliers: Outliers,
    /// Modes of variation of the model; the true shape is the mean.
    modes: usize,
}

impl Setting {
    /// Vehicle-like: 20 to 30 keypoints, 20 to 50 % of them wrong.
    const fn vehicle(name: &'static str, modes: usize) -> Self {
        Self { name, objects: 100, kind: Kind::Vehicle, outlier_ratio: 0.35, outliers: Outliers::Box, modes }
    }

    /// The paper's: 300 keypoints.
    const fn cube(name: &'static str, outlier_ratio: f64, outliers: Outliers) -> Self {
        Self { name, objects: 20, kind: Kind::Cube, outlier_ratio, outliers, modes: 0 }
    }

    fn protocol(&self) -> Protocol {
        let Self { kind, outlier_ratio, outliers, .. } = *self;
        Protocol { kind, outlier_ratio, outliers, ..Protocol::default() }
    }
}

pub const VEHICLE: Setting = Setting::vehicle("vehicle", 0);
pub const VEHICLE_5: Setting = Setting::vehicle("vehicle M = 5", 5);
pub const VEHICLE_10: Setting = Setting::vehicle("vehicle M = 10", 10);
pub const CUBE_50: Setting = Setting::cube("cube 50 %", 0.5, Outliers::Image);
pub const CUBE_90: Setting = Setting::cube("cube 90 % image", 0.9, Outliers::Image);
pub const CUBE_90_BOX: Setting = Setting::cube("cube 90 % box", 0.9, Outliers::Box);

/// Most that a mode moves a coordinate, metres.
const MODE_SIZE: f64 = 0.05;

/// Repeatable numbers between -1 and 1 (SplitMix64), as random as modes must be: independent. Where the inliers leave a
/// combination of modes free and no shape prior holds it, an estimate has no covariance and is refused as degenerate.
/// With modes that depend on each other (a golden-ratio sequence) HRE, which has no prior, found the pose of every
/// vehicle with ten modes and yet answered for one in three. Independent modes leave only objects with fewer than eight
/// inliers, which cannot determine six numbers of a pose and ten of a shape.
fn spread(k: usize) -> f64 {
    let mut z = (k as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z ^ (z >> 31)) as f64 / 2.0_f64.powi(63) - 1.0
}

/// Objects, made and checked once.
pub struct Objects<'a> {
    pub view: View,
    pub scenes: &'a [Scene],
    pub observations: &'a [Observation<'a>],
}

/// Runs `f` with the objects of a setting.
pub fn with_objects<R>(setting: &Setting, f: impl FnOnce(&Objects) -> R) -> R {
    let protocol = setting.protocol();
    let scenes: Vec<Scene> = (0..setting.objects).map(|trial| protocol.scene(0, trial)).collect();
    let most = scenes.iter().map(|s| s.keypoints_3d.len()).max().unwrap_or(0);
    let basis: Vec<[f64; 3]> =
        (0..setting.modes * most).map(|k| [1, 2, 3].map(|axis| MODE_SIZE * spread(3 * k + axis))).collect();
    let eigenvalues = vec![1.0; setting.modes];
    let models: Vec<ShapeModel> = scenes
        .iter()
        .map(|scene| {
            let count = scene.keypoints_3d.len();
            let model = ShapeModel::rigid(&scene.keypoints_3d, protocol.bbox_3d()).expect("a model");
            model.with_modes(&basis[..setting.modes * count], &eigenvalues).expect("modes")
        })
        .collect();
    let observations: Vec<Observation> = scenes
        .iter()
        .zip(&models)
        .map(|(scene, model)| {
            Observation::new(&scene.keypoints_2d, model)
                .and_then(|o| Ok(o.with_bbox(Bbox::new(scene.bbox)?)))
                .and_then(|o| o.with_inlier_threshold(scene.inlier_threshold))
                .expect("an observation")
        })
        .collect();
    let view = View::new(protocol.camera(), Tilt::default()).expect("a view");
    f(&Objects { view, scenes: &scenes, observations: &observations })
}

/// The work done on one object.
#[expect(clippy::large_enum_variant, reason = "one of each bench")]
pub enum Work {
    /// P1P of every keypoint, nothing scored.
    P1p,
    /// The whole estimate with these options.
    Estimate(Estimator),
}

impl Objects<'_> {
    /// Their numbers.
    pub fn indices(&self) -> std::ops::Range<usize> {
        0..self.scenes.len()
    }
}

impl Work {
    /// Does it for one object; the estimate, if there is one.
    pub fn run(&self, objects: &Objects, index: usize, workspace: &mut GrowingWorkspace) -> Option<Estimate> {
        let observation = &objects.observations[index];
        match self {
            Work::P1p => {
                each_hypothesis(objects, index, |pose| {
                    black_box(pose);
                });
                None
            }
            Work::Estimate(estimator) => estimator.estimate(&objects.view, observation, workspace).ok(),
        }
    }

    /// Relative error of the translation (P1P: of its best hypothesis) of every object, in rising order; infinite where
    /// there is no answer.
    fn errors(&self, objects: &Objects) -> Vec<f64> {
        let mut workspace = GrowingWorkspace::new();
        let error = |index: usize| {
            let truth = objects.scenes[index].pose.t;
            let relative = |t: nalgebra::Vector3<f64>| (t - truth).norm() / truth.norm();
            let mut best = f64::INFINITY;
            match self {
                Work::P1p => each_hypothesis(objects, index, |pose| best = best.min(relative(pose.t))),
                Work::Estimate(_) => {
                    best = self.run(objects, index, &mut workspace).map_or(best, |e| relative(e.pose.t));
                }
            }
            best
        };
        let mut errors: Vec<f64> = objects.indices().map(error).collect();
        errors.sort_by(f64::total_cmp);
        errors
    }
}

fn each_hypothesis(objects: &Objects, index: usize, mut emit: impl FnMut(groundpose::Pose)) {
    let (view, observation) = (&objects.view, &objects.observations[index]);
    let bbox = observation.bbox().expect("a box");
    let solver = P1p::new(view, observation, &bbox, Cases::All);
    for k in 0..observation.keypoints_2d().len() {
        solver.solve([k], &mut emit);
    }
}

/// A method: its name and its work.
pub type Method = (&'static str, Work);

/// A list of methods.
pub type Methods = fn() -> Vec<Method>;

fn estimate(options: Options) -> Work {
    Work::Estimate(Estimator::new(options).expect("options"))
}

/// The stages of an estimate, each including the ones before it; the cost of a stage is a difference.
pub fn stages() -> Vec<Method> {
    let search = Options { refinement: Refinement::None, covariance: false, solver: Solver::P1p, ..Options::default() };
    let plain = Options { covariance: false, ..Options::default() };
    vec![
        ("p1p of every keypoint", Work::P1p),
        // a single draw often finds nothing; the work must continue nevertheless
        ("one draw", estimate(Options { max_iterations: 1, max_log10_nfa: f64::INFINITY, ..search })),
        ("search", estimate(search)),
        ("search + gn", estimate(Options { refinement: Refinement::Gn, ..search })),
        ("search + re", estimate(Options { refinement: Refinement::Re, ..search })),
        ("search + hre", estimate(Options { refinement: Refinement::Hre, ..search })),
        ("search + default", estimate(plain)),
        ("search + default + covariance", estimate(Options::default())),
    ]
}

/// Whole estimates.
pub fn whole() -> Vec<Method> {
    let hre = Options { refinement: Refinement::Hre, ..Options::default() };
    vec![("default", estimate(Options::default())), ("p1p + hre", estimate(hre))]
}

/// Whole estimates by several searches.
pub fn searches() -> Vec<Method> {
    let hre = Options { refinement: Refinement::Hre, ..Options::default() };
    let mut methods = whole();
    methods.push(("p3p + hre", estimate(Options { solver: Solver::P3p, ..hre })));
    methods.push(("up2p + hre", estimate(Options { solver: Solver::Up2p, ..hre })));
    methods
}

/// Finds a method by its name.
pub fn named(methods: Vec<Method>, name: &str) -> Work {
    methods.into_iter().find(|m| m.0 == name).expect("a method").1
}

/// Checks before timing that the work gives right answers (a single draw may be wrong); returns the median error.
pub fn assert_right(name: &str, work: &Work, objects: &Objects) -> f64 {
    let errors = work.errors(objects);
    let (count, answered) = (errors.len(), errors.iter().filter(|error| error.is_finite()).count());
    let median = errors[count / 2];
    if !name.ends_with("one draw") {
        assert!(answered * 10 >= count * 9, "{name}: {answered} of {count} objects have an answer");
        assert!(median < 0.05, "{name}: median translation error {median}");
    }
    median
}
