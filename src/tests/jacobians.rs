//! Every analytic derivative against central differences.

use nalgebra::{Rotation3, Vector3, Vector6};

use super::fixture::{Fixture, NO_PRIORS, Random, linearised};
use crate::geometry::camera::Camera;
use crate::geometry::pose::Pose;
use crate::geometry::view::{Tilt, View};
use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::refine::kernels::Kernel;
use crate::refine::normal::State;
use crate::refine::objective::Objective;
use crate::refine::priors::Priors;

const POINTS: usize = 11;
const MODES: usize = 3;
/// Unknowns of the joint problem: three modes are padded to five.
const JOINT: usize = 11;
/// Rotation vector, translation and coefficients differ in size little enough for one step.
const STEP: f64 = 1e-5;

/// Scale of the kernels, pixels squared.
const SCALE2: f64 = 900.0;
const TUKEY: Kernel = Kernel::Tukey { c2: SCALE2 };

/// Every kernel.
fn kernels() -> impl Iterator<Item = Kernel> {
    Kernel::EXAMPLES.iter().map(|at| at(SCALE2))
}

/// A random object near a random pose: residuals of some ten pixels.
struct Problem {
    view: View,
    mean: Vec<[f64; 3]>,
    basis: Vec<[f64; 3]>,
    bbox_basis: Vec<[[f64; 3]; 2]>,
    pixels: Vec<[f64; 2]>,
    state: State,
    bbox: [f64; 4],
}

const BBOX_3D: [[f64; 3]; 2] = [[-1.0, -0.8, -2.2], [1.0, 0.8, 2.2]];

impl Problem {
    fn random(trial: u64) -> Self {
        Self::of_points(POINTS, trial)
    }

    fn of_points(points: usize, trial: u64) -> Self {
        let mut random = Random::new(trial);
        let camera = Camera::new(900.0, 950.0, 600.0, 400.0).unwrap();
        let tilt = Tilt { pitch: 0.4 * random.next(), roll: 0.2 * random.next() };
        let view = View::new(camera, tilt).unwrap();
        let upright = Pose::upright(&view, 3.0 * random.next(), Vector3::from(random.numbers()) + Vector3::z() * 14.0);
        let pose = upright.perturbed(&(Vector6::from(random.numbers()) * 0.03));
        let mean: Vec<[f64; 3]> = (0..points).map(|_| point(&mut random, [1.0, 0.8, 2.2])).collect();
        let basis: Vec<[f64; 3]> = (0..points * MODES).map(|_| point(&mut random, [0.1; 3])).collect();
        let pixels = mean.iter().map(|&x| {
            let [u, v] = camera.project(&pose.transform(x)).unwrap();
            [u + 12.0 * random.next(), v + 12.0 * random.next()]
        });
        let mut pixels: Vec<[f64; 2]> = pixels.collect();
        pixels[3] = [f64::NAN; 2];
        let mut coefficients = [0.0; MAX_MODES];
        coefficients[..MODES].copy_from_slice(&random.numbers::<MODES>());
        let corners = (0..8).map(|c: usize| {
            let corner = core::array::from_fn(|axis| BBOX_3D[(c >> axis) & 1][axis]);
            camera.project(&pose.transform(corner)).unwrap()
        });
        let extent = corners.fold([f64::INFINITY, f64::INFINITY, -f64::INFINITY, -f64::INFINITY], |b, [u, v]| {
            [b[0].min(u), b[1].min(v), b[2].max(u), b[3].max(v)]
        });
        let bbox_basis: Vec<[[f64; 3]; 2]> =
            (0..MODES).map(|_| [point(&mut random, [0.1; 3]), point(&mut random, [0.1; 3])]).collect();
        let centre = [camera.cx, camera.cy, camera.cx, camera.cy];
        let bbox = core::array::from_fn(|side| extent[side] - centre[side] + 5.0 * random.next());
        Self { view, mean, basis, bbox_basis, pixels, state: State { pose, coefficients }, bbox }
    }

    fn with_objective(&self, modes: usize, priors: Priors, f: impl FnOnce(Objective)) {
        let model = ShapeModel::rigid(&self.mean, BBOX_3D).unwrap();
        let eigenvalues = &[2.0, 1.0, 0.5][..modes];
        let model = model.with_modes(&self.basis[..modes * self.mean.len()], eigenvalues).unwrap();
        let model = model.with_bbox_basis(&self.bbox_basis[..modes]).unwrap();
        let mut fixture = Fixture::new(self.view, &model, &self.pixels, |i| 0.3 + 0.06 * (i % POINTS) as f64);
        fixture.priors = priors;
        f(fixture.objective(&model));
    }

    /// Nothing but one prior, or all.
    fn priors(&self) -> [Priors; 4] {
        let tilt = Priors { noise_sigma: 3.0, tilt_sigma: 0.02, ..NO_PRIORS };
        let shape = Priors { noise_sigma: 3.0, shape: true, ..NO_PRIORS };
        let [left, top, right, _] = self.bbox;
        let bbox = [left, top, right, f64::NAN];
        let bbox = Priors { noise_sigma: 3.0, bbox, use_bbox: true, bbox_sigma: 6.0, ..NO_PRIORS };
        [tilt, shape, bbox, Priors { tilt_sigma: 0.02, shape: true, ..bbox }]
    }
}

fn point(random: &mut Random, half: [f64; 3]) -> [f64; 3] {
    half.map(|h| h * random.next())
}

fn moved<const D: usize>(state: &State, unknown: usize, step: f64) -> State {
    let mut direction = [0.0; D];
    direction[unknown] = step;
    let mut next = *state;
    next.pose = state.pose.perturbed(&Vector6::from_column_slice(&direction[..6]));
    for m in 0..D - 6 {
        next.coefficients[m] += direction[6 + m];
    }
    next
}

#[track_caller]
fn assert_close(analytic: f64, numeric: f64, scale: f64, what: &str) {
    assert!((analytic - numeric).abs() < 1e-6 * scale, "{what}: {analytic} {numeric}");
}

/// Gradient of the whole cost against differences of the cost.
fn check_gradient<const D: usize>(objective: &mut Objective, state: &State, kernel: Kernel) {
    let mut normal = |state: &State| linearised::<D>(objective, state, kernel);
    let analytic = normal(state);
    for k in 0..D {
        let difference = normal(&moved::<D>(state, k, STEP)).cost - normal(&moved::<D>(state, k, -STEP)).cost;
        let scale = 1.0 + analytic.cost + analytic.gradient[k].abs();
        assert_close(
            analytic.gradient[k],
            difference / (2.0 * STEP),
            10.0 * scale,
            &format!("{kernel:?}, unknown {k}"),
        );
    }
}

#[test]
fn of_the_cost_by_pose() {
    for trial in 0..40 {
        let p = Problem::random(trial);
        let state = State { coefficients: [0.0; MAX_MODES], ..p.state };
        for kernel in kernels() {
            p.with_objective(0, NO_PRIORS, |mut o| check_gradient::<6>(&mut o, &state, kernel));
        }
    }
}

#[test]
fn of_the_cost_by_pose_and_shape() {
    for trial in 0..40 {
        let p = Problem::random(trial);
        for kernel in kernels() {
            p.with_objective(MODES, NO_PRIORS, |mut o| check_gradient::<JOINT>(&mut o, &p.state, kernel));
            p.with_objective(MODES, NO_PRIORS, |mut o| {
                check_gradient::<{ 6 + MAX_MODES }>(&mut o, &p.state, kernel);
            });
        }
    }
}

#[test]
fn of_every_prior() {
    for trial in 0..40 {
        let p = Problem::random(trial);
        for priors in p.priors() {
            p.with_objective(MODES, priors, |mut o| {
                // The keypoints have had their tests: alone, small gradients of priors show.
                o.keypoints.activate_within(&p.state, f64::NAN);
                check_gradient::<JOINT>(&mut o, &p.state, Kernel::LeastSquares);
                let cost = linearised::<JOINT>(&mut o, &p.state, Kernel::LeastSquares).cost;
                let alone = o.truncated_cost(&p.state, 1e-9, f64::INFINITY);
                assert!(cost > 0.0 && (alone - cost).abs() < 1e-12 * cost);
            });
            p.with_objective(MODES, priors, |mut o| check_gradient::<JOINT>(&mut o, &p.state, TUKEY));
            let rigid = State { coefficients: [0.0; MAX_MODES], ..p.state };
            p.with_objective(0, priors, |mut o| check_gradient::<6>(&mut o, &rigid, TUKEY));
        }
    }
}

/// The second derivative of a quadratic cost is the normal matrix: near zero residuals nothing is left out.
#[test]
fn normal_matrix_is_the_hessian_where_residuals_vanish() {
    for trial in 0..20 {
        let mut p = Problem::random(trial);
        let model = ShapeModel::rigid(&p.mean, BBOX_3D).unwrap();
        let model = model.with_modes(&p.basis, &[2.0, 1.0, 0.5]).unwrap();
        for (i, pixel) in p.pixels.iter_mut().enumerate() {
            let x = model.keypoint(i, &p.state.coefficients);
            *pixel = p.view.camera.project(&p.state.pose.transform(x)).unwrap();
        }
        p.with_objective(MODES, NO_PRIORS, |mut o| check_hessian::<JOINT>(&mut o, &p.state));
        let rigid = State { coefficients: [0.0; MAX_MODES], ..p.state };
        for (i, pixel) in p.pixels.iter_mut().enumerate() {
            *pixel = p.view.camera.project(&p.state.pose.transform(p.mean[i])).unwrap();
        }
        p.with_objective(0, NO_PRIORS, |mut o| check_hessian::<6>(&mut o, &rigid));
    }
}

fn check_hessian<const D: usize>(objective: &mut Objective, state: &State) {
    let mut normal = |state: &State| linearised::<D>(objective, state, Kernel::LeastSquares);
    let h = normal(state).h;
    for k in 0..6 + MODES.min(D - 6) {
        let (forth, back) = (normal(&moved::<D>(state, k, STEP)), normal(&moved::<D>(state, k, -STEP)));
        for i in 0..6 + MODES.min(D - 6) {
            let numeric = (forth.gradient[i] - back.gradient[i]) / (2.0 * STEP);
            let entry = h[i.min(k)][i.max(k)];
            assert_close(entry, numeric, 100.0 * (1.0 + (h[i][i] * h[k][k]).sqrt()), &format!("{i}, {k}"));
        }
    }
}

/// The loop over lanes and the loop over points are two pieces of code for one thing.
#[test]
fn pose_by_lanes_is_the_pose_block_of_the_joint_problem() {
    for trial in 0..40 {
        // From 65 on, points with a weight are brought together for the pose: groups that end anywhere.
        let p = Problem::of_points(if trial < 20 { POINTS } else { 60 + trial as usize }, trial);
        for kernel in kernels().chain([Kernel::Tukey { c2: 40.0 }]) {
            p.with_objective(MODES, p.priors()[3], |mut o| {
                let (pose, joint) =
                    (linearised::<6>(&mut o, &p.state, kernel), linearised::<JOINT>(&mut o, &p.state, kernel));
                for i in 0..6 {
                    let scale = 1e-6 * (1.0 + pose.gradient[i].abs() + pose.h[i][i]);
                    assert_close(pose.gradient[i], joint.gradient[i], scale, "gradient");
                    for k in 0..6 {
                        let scale = 1e-6 * (1.0 + (pose.h[i][i] * pose.h[k][k]).sqrt());
                        assert_close(pose.h[i][k], joint.h[i][k], scale, "normal matrix");
                    }
                }
            });
        }
    }
}

/// A point behind the camera costs what the kernel says of infinity and pulls nowhere.
#[test]
fn of_a_point_behind_the_camera() {
    let mut p = Problem::random(0);
    p.state.coefficients = [0.0; MAX_MODES];
    let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), 0.3).into_inner();
    p.state.pose = Pose { r: turned, t: Vector3::new(0.0, 0.0, 0.5) };
    let behind = p.mean.iter().filter(|&&x| p.state.pose.transform(x).z <= 0.0).count();
    assert!(behind > 0 && behind < POINTS);
    p.with_objective(0, NO_PRIORS, |mut o| {
        check_gradient::<6>(&mut o, &p.state, TUKEY);
        let normal = linearised::<6>(&mut o, &p.state, TUKEY);
        assert!(normal.gradient.iter().chain(normal.h.iter().flatten()).all(|x| x.is_finite()));
        let joint = linearised::<JOINT>(&mut o, &p.state, TUKEY);
        assert!((normal.cost - joint.cost).abs() < 1e-9 * joint.cost);
        assert_eq!(linearised::<6>(&mut o, &p.state, Kernel::LeastSquares).cost, f64::INFINITY);
    });
}
