//! Comparison of the core with values of an independent NumPy implementation, `tests/reference/values.json`. The top
//! of `tests/reference/make_values.py` describes their schema. The refinement part is tested inside the crate.

use groundpose::minimal::MinimalSolver;
use groundpose::minimal::p1p::{Cases, P1p};
use groundpose::minimal::p1p_height::P1pHeight;
use groundpose::minimal::p3p::P3p;
use groundpose::minimal::up2p::Up2p;
use groundpose::{Bbox, Camera, Footprint, Kernel, Observation, Pose, ShapeModel, Tilt, View};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

/// The values under one name.
fn values(name: &str) -> Vec<Value> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/values.json");
    let text = std::fs::read_to_string(path).expect(path);
    let mut all: Value = serde_json::from_str(&text).expect("JSON");
    let list = all[name].take();
    let Value::Array(list) = list else { panic!("{name}: a list") };
    assert!(!list.is_empty(), "{name}");
    list
}

/// A number; null is NaN.
fn number(value: &Value) -> f64 {
    if value.is_null() { f64::NAN } else { value.as_f64().expect("a number or null") }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(number).collect()
}

fn fixed<const N: usize>(value: &Value) -> [f64; N] {
    numbers(value).try_into().expect("as many numbers")
}

fn rows<const N: usize>(value: &Value) -> Vec<[f64; N]> {
    value.as_array().expect("rows").iter().map(fixed).collect()
}

fn camera(value: &Value) -> Camera {
    let [fx, fy, cx, cy] = ["fx", "fy", "cx", "cy"].map(|name| number(&value[name]));
    let camera = Camera::new(fx, fy, cx, cy).unwrap();
    if value["distortion"].is_null() { camera } else { camera.with_distortion(fixed(&value["distortion"])).unwrap() }
}

fn view(value: &Value) -> View {
    let tilt = Tilt { pitch: number(&value["pitch"]), roll: number(&value["roll"]) };
    let view = View::new(camera(&value["camera"]), tilt).unwrap();
    if value["height"].is_null() { view } else { view.with_height(number(&value["height"])).unwrap() }
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| number(&value[i][j]))
}

fn pose(value: &Value) -> Pose {
    Pose { r: matrix(&value["R"]), t: Vector3::from(fixed::<3>(&value["t"])) }
}

fn bbox(value: &Value) -> Bbox {
    Bbox::new(fixed(value)).unwrap()
}

fn distance(a: &Pose, b: &Pose) -> f64 {
    (a.r - b.r).norm() + (a.t - b.t).norm() / b.t.norm()
}

/// Both sets hold the same poses.
#[track_caller]
fn assert_same_set(found: &[Pose], expected: &[Pose], tolerance: f64, name: &str) {
    assert_eq!(found.len(), expected.len(), "{name}: number of solutions");
    assert_contains(found, expected, tolerance, name);
    assert_contains(expected, found, tolerance, name);
}

#[track_caller]
fn assert_contains(found: &[Pose], expected: &[Pose], tolerance: f64, name: &str) {
    for e in expected {
        let nearest = found.iter().map(|f| distance(f, e)).fold(f64::INFINITY, f64::min);
        assert!(nearest < tolerance, "{name}: {nearest:e} from {e:?}");
    }
}

fn solutions(case: &Value, wanted: impl Fn(&Value) -> bool) -> Vec<Pose> {
    case["solutions"].as_array().unwrap().iter().filter(|s| wanted(s)).map(pose).collect()
}

/// All poses of one sample of all keypoints.
fn solve<const SIZE: usize>(solver: &impl MinimalSolver<SIZE>) -> Vec<Pose> {
    let mut poses = vec![];
    solver.solve(core::array::from_fn(|i| i), &mut |pose| poses.push(pose));
    poses
}

#[test]
fn views_and_planes() {
    for case in values("views") {
        let view = view(&case["view"]);
        assert!((view.r_camera_from_ground - matrix(&case["R_camera_from_ground"])).norm() < 1e-14);

        let from_gravity = View::from_gravity(view.camera, fixed::<3>(&case["gravity"]).map(|x| 9.81 * x)).unwrap();
        assert!((from_gravity.tilt.pitch - view.tilt.pitch).abs() < 1e-14);
        assert!((from_gravity.tilt.roll - view.tilt.roll).abs() < 1e-14);

        let planes = view.side_planes(number(&case["left"]), number(&case["right"]));
        for (plane, expected) in planes.iter().zip(rows::<3>(&case["side_planes"])) {
            assert!((plane - Vector3::from(expected)).norm() < 1e-14);
        }

        let (line, expected) = (Vector3::from(view.horizon()), Vector3::from(fixed::<3>(&case["horizon"])));
        let nearest = (line - expected).norm().min((line + expected).norm());
        assert!(nearest < 1e-11 * expected.norm(), "{line} {expected}");
    }
}

#[test]
fn lenses() {
    for case in values("lenses") {
        let camera = camera(&case["camera"]);
        for (ideal, distorted) in rows::<2>(&case["undistorted"]).into_iter().zip(rows::<2>(&case["distorted"])) {
            let forth = camera.distort(ideal);
            let back = camera.undistort(distorted).expect("within the lens");
            for axis in 0..2 {
                assert!((forth[axis] - distorted[axis]).abs() < 1e-10);
                assert!((back[axis] - ideal[axis]).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn p1p_solution_sets() {
    for (k, case) in values("p1p").iter().enumerate() {
        let (name, view, bbox) = (format!("p1p {k}"), view(&case["view"]), bbox(&case["bbox"]));
        let (points, pixels) = ([fixed(&case["keypoint_3d"])], [fixed(&case["keypoint_2d"])]);
        let mut model = ShapeModel::rigid(&points, rows(&case["bbox_3d"]).try_into().unwrap()).unwrap();
        let has_outline = !case["footprint"].is_null();
        if has_outline {
            model = model.with_footprint(Footprint::new(&rows(&case["footprint"])).unwrap());
        }
        let observation = Observation::new(&pixels, &model).unwrap();

        let all = solve(&P1p::new(&view, &observation, &bbox, Cases::All));
        assert_same_set(&all, &solutions(case, |_| true), 1e-9, &name);
        if !has_outline {
            let paper = solve(&P1p::new(&view, &observation, &bbox, Cases::Paper));
            assert_same_set(&paper, &solutions(case, |s| s["paper"].as_bool().unwrap()), 1e-9, &name);
        }
        for pose in &all {
            let expected = case["solutions"].as_array().unwrap();
            let yaws = expected.iter().map(|s| (pose.yaw(&view) - number(&s["yaw"])).sin().abs());
            assert!(yaws.fold(1.0, f64::min) < 1e-9, "{name}: yaw");
        }
        if !case["truth"].is_null() {
            assert_contains(&all, &[self::pose(&case["truth"])], 1e-8, &name);
        }
    }
}

#[test]
fn p1p_height_solutions() {
    for (k, case) in values("p1p_height").iter().enumerate() {
        let (name, view, bbox) = (format!("p1p_height {k}"), view(&case["view"]), bbox(&case["bbox"]));
        let (points, pixels) = ([fixed(&case["keypoint_3d"])], [fixed(&case["keypoint_2d"])]);
        let model = ShapeModel::rigid(&points, rows(&case["bbox_3d"]).try_into().unwrap()).unwrap();
        let observation = Observation::new(&pixels, &model).unwrap();
        let found = solve(&P1pHeight::new(&view, &observation, &bbox, view.height.unwrap()));
        let expected = solutions(case, |_| true);
        if bbox.left.is_nan() || bbox.right.is_nan() {
            assert_same_set(&found, &expected, 1e-9, &name);
        } else {
            // Feasible for both sides; the solver may return more, feasible only for the side they come from.
            assert_contains(&found, &expected, 1e-9, &name);
        }
    }
}

#[test]
fn up2p_solution_sets() {
    for (k, case) in values("up2p").iter().enumerate() {
        let (view, points, pixels) = (view(&case["view"]), rows(&case["points_3d"]), rows(&case["pixels"]));
        let model = ShapeModel::rigid(&points, [[-9.0; 3], [9.0; 3]]).unwrap();
        let observation = Observation::new(&pixels, &model).unwrap();
        let found = solve(&Up2p::new(&view, &observation));
        assert_same_set(&found, &solutions(case, |_| true), 1e-8, &format!("up2p {k}"));
    }
}

#[test]
fn p3p_solution_sets() {
    for (k, case) in values("p3p").iter().enumerate() {
        let (view, points, pixels) = (view(&case["view"]), rows(&case["points_3d"]), rows(&case["pixels"]));
        let model = ShapeModel::rigid(&points, [[-9.0; 3], [9.0; 3]]).unwrap();
        let observation = Observation::new(&pixels, &model).unwrap();
        let found = solve(&P3p::new(&view.camera, &observation));
        assert_same_set(&found, &solutions(case, |_| true), 1e-7, &format!("p3p {k}"));
    }
}

#[test]
fn tukey() {
    for case in values("tukey") {
        let c = number(&case["c"]);
        let (rho, weight) = (numbers(&case["rho"]), numbers(&case["weight"]));
        for (k, r) in numbers(&case["r"]).into_iter().enumerate() {
            let (found, found_weight) = Kernel::Tukey { c2: c * c }.evaluate(r * r);
            // 1 - (1 - r^2 / c^2)^3 loses digits to cancellation near zero.
            assert!((found - rho[k]).abs() < 1e-16 * c * c + 1e-14 * rho[k], "c {c}, r {r}: {found} {}", rho[k]);
            assert!((found_weight - weight[k]).abs() < 1e-14, "c {c}, r {r}");
        }
    }
}
