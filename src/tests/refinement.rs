//! GN, RE and every stage of HRE against the converged minimisers of an independent NumPy implementation
//! (`tests/reference/values.json`; its schema stands at the top of `make_values.py` beside it).

use nalgebra::{Matrix3, Matrix6, Vector3};
use serde_json::Value;

use super::fixture::{Fixture, linearised};
use crate::geometry::camera::Camera;
use crate::geometry::math::square;
use crate::geometry::pose::Pose;
use crate::geometry::view::{Tilt, View};
use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::refine::kernels::Kernel;
use crate::refine::normal::State;
use crate::refine::objective::Objective;
use crate::refine::schedule::{MAX_STAGES, Refinement, Schedule, Stage, StageKernel, refine, schedule};
use crate::search::score;
use crate::simd::projection::Projection;

/// Unknowns with the three modes of the reference's models, padded.
const JOINT: usize = 11;

fn number(value: &Value) -> f64 {
    if value.is_null() { f64::NAN } else { value.as_f64().expect("a number or null") }
}

fn list<T>(value: &Value, item: impl Fn(&Value) -> T) -> Vec<T> {
    value.as_array().expect("a list").iter().map(item).collect()
}

fn row<const N: usize>(value: &Value) -> [f64; N] {
    core::array::from_fn(|i| number(&value[i]))
}

fn pose(value: &Value) -> Pose {
    Pose { r: Matrix3::from_fn(|i, j| number(&value["R"][i][j])), t: Vector3::from(row::<3>(&value["t"])) }
}

/// One case of the reference, and what is needed to run it.
struct Case {
    value: Value,
    view: View,
    keypoints_2d: Vec<[f64; 2]>,
    is_inlier: Vec<bool>,
    mean: Vec<[f64; 3]>,
    basis: Vec<[f64; 3]>,
    bbox_3d: [[f64; 3]; 2],
    threshold: f64,
}

impl Case {
    fn all() -> Vec<Self> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/values.json");
        let all: Value = serde_json::from_str(&std::fs::read_to_string(path).expect(path)).expect("JSON");
        list(&all["refine"], |case| Self::new(case, &all["models"]))
    }

    fn new(case: &Value, models: &Value) -> Self {
        let camera = &case["view"]["camera"];
        let [fx, fy, cx, cy] = ["fx", "fy", "cx", "cy"].map(|name| number(&camera[name]));
        let tilt = Tilt { pitch: number(&case["view"]["pitch"]), roll: number(&case["view"]["roll"]) };
        let model = &models[case["model"].as_u64().expect("an index") as usize];
        Self {
            value: case.clone(),
            view: View::new(Camera::new(fx, fy, cx, cy).unwrap(), tilt).unwrap(),
            keypoints_2d: list(&case["keypoints_2d"], row),
            is_inlier: list(&case["inlier_truth"], |x| x.as_bool().expect("a bool")),
            mean: list(&model["mean"], row),
            basis: list(&model["basis"], |mode| list(mode, row)).concat(),
            bbox_3d: [row(&model["bbox_3d"][0]), row(&model["bbox_3d"][1])],
            threshold: number(&case["inlier_threshold"]),
        }
    }

    fn has_shape(&self) -> bool {
        self.value["shape_in_data"].as_bool().expect("a bool")
    }

    fn start(&self) -> State {
        State { pose: pose(&self.value["start"]), coefficients: [0.0; MAX_MODES] }
    }

    /// Runs `f` with all keypoints or with the true inliers alone.
    fn with_objective(&self, inliers_only: bool, f: impl FnOnce(&mut Objective, &mut [f64])) {
        let mut model = ShapeModel::rigid(&self.mean, self.bbox_3d).unwrap();
        if self.has_shape() {
            model = model.with_modes(&self.basis, &[1.0; 3]).unwrap();
        }
        let weight = |i: usize| if inliers_only && !self.is_inlier[i] { 0.0 } else { 1.0 };
        let mut fixture = Fixture::new(self.view, &model, &self.keypoints_2d, weight);
        let mut scratch = vec![0.0; self.mean.len()];
        f(&mut fixture.objective(&model), &mut scratch);
    }

    /// Runs stages from the start and compares with the reference's result of that name.
    fn check(&self, name: &str, stages: &Schedule, inliers_only: bool, tolerance: f64) {
        let expected = &self.value["results"][name];
        self.with_objective(inliers_only, |objective, scratch| {
            let (state, statistics) = refine(objective, scratch, &self.start().pose, stages, |_, _| true);
            let truth = pose(expected);
            let (e_r, e_t) = ((state.pose.r - truth.r).norm(), (state.pose.t - truth.t).norm() / truth.t.norm());
            assert!(e_r < tolerance && e_t < tolerance, "{name}: e_r {e_r:e}, e_t {e_t:e}");
            let last = statistics.iter().rfind(|s| s.iterations > 0).expect("a stage");
            let cost = number(&expected["cost"]);
            assert!((last.cost / cost - 1.0).abs() < 1e-6_f64.max(tolerance), "{name}: {} {cost}", last.cost);
            for (m, lambda) in list(&expected["shape"], number).into_iter().enumerate() {
                assert!((state.coefficients[m] - lambda).abs() < 100.0 * tolerance, "{name}: shape {m}");
            }
        });
    }
}

/// Until nothing changes: the reference has converged.
fn to_the_end(kernel: StageKernel, joint: bool) -> Stage {
    Stage { kernel, joint, bbox: false, max_iterations: 300, tolerance: 0.0 }
}

fn one(stage: Stage) -> Schedule {
    let mut stages = [None; MAX_STAGES];
    stages[0] = Some(stage);
    stages
}

#[test]
fn gauss_newton_on_the_true_inliers() {
    for case in Case::all() {
        let name = if case.has_shape() { "gn_shape" } else { "gn" };
        let everything = StageKernel::Inliers { tau: f64::INFINITY };
        case.check(name, &one(to_the_end(everything, true)), true, 1e-7);
    }
}

#[test]
fn robust_estimation() {
    for case in Case::all().iter().filter(|case| !case.has_shape()) {
        let mad = StageKernel::MadTukey { lowest: 1e-9, highest: f64::INFINITY };
        case.check("re_updated", &one(to_the_end(mad, false)), false, 1e-6);
        let c = number(&case.value["results"]["re_fixed"]["c"]);
        case.check("re_fixed", &one(to_the_end(StageKernel::FixedTukey { c }, false)), false, 1e-7);
        // As it ships: it may stop a little earlier.
        let shipped = schedule(Refinement::Re, case.threshold, [1.0, 1.5, 3.0]);
        case.check("re_updated", &shipped, false, 2e-4);
    }
}

#[test]
fn hierarchical_robust_estimation_stage_by_stage() {
    for case in Case::all() {
        let [t1, t2, t3] = row::<3>(&case.value["taus"]).map(|tau| tau / case.threshold);
        let shipped = schedule(Refinement::Hre, case.threshold, [t1, t2, t3]);
        let converged = shipped.map(|stage| stage.map(|s| to_the_end(s.kernel, s.joint)));
        let name = if case.has_shape() { "hre_shape" } else { "hre" };
        for last in 0..MAX_STAGES {
            let first = |stages: &Schedule| core::array::from_fn(|k| if k <= last { stages[k] } else { None });
            case.check(&format!("{name}{}", last + 1), &first(&converged), false, 1e-6);
            case.check(&format!("{name}{}", last + 1), &first(&shipped), false, 2e-4);
        }
    }
}

#[test]
fn score_of_the_start() {
    for case in Case::all() {
        case.with_objective(false, |objective, _| {
            let projection = Projection::new(&case.view.camera, &case.start().pose);
            let (unit, tau2) = (objective.keypoints.unit, square(case.threshold));
            let blocks = objective.keypoints.of_shape(&[0.0; MAX_MODES]);
            let cost = score::cost(unit, blocks, &projection, score::Scoring::Msac, tau2, f64::INFINITY);
            let expected = number(&case.value["msac_start"]);
            assert!((tau2 * cost - expected).abs() < 1e-9 * expected, "{} {expected}", tau2 * cost);
        });
    }
}

#[test]
fn covariance_of_gauss_newton() {
    for case in Case::all() {
        let name = if case.has_shape() { "gn_shape" } else { "gn" };
        let result = &case.value["results"][name];
        let mut state = State { pose: pose(result), ..case.start() };
        for (m, lambda) in list(&result["shape"], number).into_iter().enumerate() {
            state.coefficients[m] = lambda;
        }
        let variance = square(number(&result["noise_sigma"]));
        case.with_objective(true, |objective, _| {
            let found: Matrix6<f64> = if case.has_shape() {
                let h = linearised::<JOINT>(objective, &state, Kernel::LeastSquares).h;
                let h = nalgebra::SMatrix::<f64, JOINT, JOINT>::from_fn(|i, j| h[i.min(j)][i.max(j)]);
                (h.try_inverse().unwrap() * variance).fixed_view::<6, 6>(0, 0).into_owned()
            } else {
                let h = linearised::<6>(objective, &state, Kernel::LeastSquares).h;
                Matrix6::from_fn(|i, j| h[i.min(j)][i.max(j)]).try_inverse().unwrap() * variance
            };
            let expected = Matrix6::from_fn(|i, j| number(&case.value["covariance"][i][j]));
            assert!((found - expected).norm() < 1e-6 * expected.norm(), "{name}: {found} {expected}");
        });
    }
}
