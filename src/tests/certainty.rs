//! Covariances with a factor against dense matrices; the alternative's pose and covariance against their definitions.

use nalgebra::{SMatrix, Vector3, Vector6};

use super::fixture::{Fixture, Random, linearised};
use crate::estimate::alternative::{turned, turned_covariance, turned_probability};
use crate::geometry::camera::Camera;
use crate::geometry::math::{atan2, square};
use crate::geometry::pose::Pose;
use crate::geometry::view::{Tilt, View};
use crate::model::observation::VIEWING_ANGLES;
use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::refine::covariance::{PoseCovariance, ShapePoseCovariance, SharedErrors, covariance};
use crate::refine::kernels::Kernel;
use crate::refine::normal::State;
use crate::refine::priors::Priors;

const POINTS: usize = 17;
const MODES: usize = 3;
const JOINT: usize = 11;
const BBOX_3D: [[f64; 3]; 2] = [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.4]];

fn view() -> View {
    View::new(Camera::new(900.0, 950.0, 600.0, 400.0).unwrap(), Tilt { pitch: -0.1, roll: 0.05 }).unwrap()
}

fn state(random: &mut Random) -> State {
    let pose = Pose::upright(&view(), 3.0 * random.next(), [3.0 * random.next(), 1.5, 14.0].into());
    let mut coefficients = [0.0; MAX_MODES];
    coefficients[..MODES].copy_from_slice(&random.numbers::<MODES>());
    State { pose, coefficients }
}

/// Calls `f` with a shape model and what was measured of it at a state, for poses with and without a shape.
fn each_case(f: impl Fn(&ShapeModel, &State, &mut Fixture)) {
    for trial in 0..6 {
        let mut random = Random::new(trial);
        let mut state = state(&mut random);
        let mean: Vec<[f64; 3]> = (0..POINTS).map(|_| random.numbers()).collect();
        let basis: Vec<[f64; 3]> = (0..POINTS * MODES).map(|_| random.numbers().map(|x: f64| 0.1 * x)).collect();
        let mut model = ShapeModel::rigid(&mean, BBOX_3D).unwrap();
        if trial % 2 == 0 {
            model = model.with_modes(&basis, &[2.0, 1.0, 0.5]).unwrap();
        } else {
            state.coefficients = [0.0; MAX_MODES];
        }
        let pixel = |i: usize| view().camera.project(&state.pose.transform(model.keypoint(i, &state.coefficients)));
        let pixels: Vec<[f64; 2]> = (0..POINTS).map(|i| pixel(i).unwrap().map(|p| p + 2.0 * random.next())).collect();
        let mut fixture = Fixture::new(view(), &model, &pixels, |i| 0.3 + 0.03 * i as f64);
        let bbox = [-150.0, -120.0, 150.0, f64::NAN];
        fixture.priors =
            Priors { noise_sigma: 2.0, tilt_sigma: 0.02, shape: true, bbox, use_bbox: true, bbox_sigma: 60.0 };
        f(&model, &state, &mut fixture);
    }
}

fn independent(factor: f64) -> SharedErrors {
    SharedErrors { factor, shift: 0.0, turn: 0.0 }
}

#[test]
fn a_shared_shift_and_turn_add_to_the_covariance() {
    each_case(|model, state, fixture| {
        let mut at = |errors: SharedErrors| covariance(&mut fixture.objective(model), state, 1e9, &errors).unwrap().0;
        let (shift, turn) = (3.0, 0.02);
        let more = at(SharedErrors { factor: 1.0, shift, turn }) - at(independent(1.0));
        let (view, t) = (view(), state.pose.t);
        // Moved along a row of the image, as far as the pixels say; not along the ray.
        let beside = t.cross(&Vector3::y()).normalize();
        let translation = more.fixed_view::<3, 3>(3, 3);
        let metres = shift / view.camera.fx * t.z;
        assert!((beside.dot(&(translation * beside)) / square(metres) - 1.0).abs() < 1e-9);
        assert!((translation * t).norm() < 1e-12);
        let rotation = more.fixed_view::<3, 3>(0, 0);
        let normal = view.r_camera_from_ground.column(1).into_owned();
        assert!((rotation * normal - normal * square(turn)).norm() < 1e-12);
        assert!((rotation.trace() - square(turn)).abs() < 1e-12);
        assert!(more.fixed_view::<3, 3>(0, 3).norm() == 0.0);
    });
}

/// Pose part of `H^-1 (kappa s2 K + s2 P) H^-1` from whole matrices, `K` those of the keypoints alone.
fn dense<const D: usize>(
    model: &ShapeModel,
    state: &State,
    fixture: &mut Fixture,
    factor: f64,
) -> (PoseCovariance, ShapePoseCovariance) {
    let priors = fixture.priors;
    let full = |h: [[f64; D]; D]| SMatrix::<f64, D, D>::from_fn(|i, j| h[i.min(j)][i.max(j)]);
    let h = full(linearised::<D>(&mut fixture.objective(model), state, Kernel::LeastSquares).h);
    fixture.priors = Priors { tilt_sigma: f64::INFINITY, shape: false, use_bbox: false, ..priors };
    let mut keypoints = full(linearised::<D>(&mut fixture.objective(model), state, Kernel::LeastSquares).h);
    fixture.priors = priors;
    for m in 6 + model.eigenvalues().len()..D {
        keypoints[(m, m)] = 0.0;
    }
    let (inverse, s2) = (h.try_inverse().unwrap(), square(priors.noise_sigma));
    let middle = keypoints * (factor * s2) + (h - keypoints) * s2;
    let all = inverse * middle * inverse;
    let mut between = ShapePoseCovariance::zeros();
    for m in 0..model.eigenvalues().len() {
        between.row_mut(m).copy_from(&all.fixed_view::<1, 6>(6 + m, 0));
    }
    (all.fixed_view::<6, 6>(0, 0).into_owned(), between)
}

#[test]
fn error_factor_widens_what_the_keypoints_say() {
    each_case(|model, state, fixture| {
        for factor in [1.0, 7.5, 20.0] {
            let (found, _, between) =
                covariance(&mut fixture.objective(model), state, 1e9, &independent(factor)).unwrap();
            let (expected, expected_between) = match model.eigenvalues().len() {
                0 => dense::<6>(model, state, fixture, factor),
                _ => dense::<JOINT>(model, state, fixture, factor),
            };
            assert!((found - expected).norm() < 1e-9 * expected.norm(), "{factor}: {found} {expected}");
            assert!((found - found.transpose()).norm() < 1e-9 * found.norm());
            assert!((between - expected_between).norm() <= 1e-9 * expected_between.norm(), "{factor}");
        }
    });
}

#[test]
fn priors_limit_what_the_factor_widens() {
    each_case(|model, state, fixture| {
        let mut at = |factor| covariance(&mut fixture.objective(model), state, 1e9, &independent(factor)).unwrap().0;
        let (one, ten) = (at(1.0), at(10.0));
        for k in 0..6 {
            let ratio = ten[(k, k)] / one[(k, k)];
            assert!((1.0..=10.0 + 1e-9).contains(&ratio), "{k}: {ratio}");
        }
    });
}

#[test]
fn turned_round_in_its_place() {
    each_case(|model, state, _| {
        let other = turned(state, model);
        assert!(other.pose.is_rigid());
        assert!((other.pose.forward_cosine(&state.pose) + 1.0).abs() < 1e-12);
        let [min, max] = model.bbox_3d_of(&state.coefficients);
        let middle: [f64; 3] = core::array::from_fn(|i| 0.5 * (min[i] + max[i]));
        assert!((other.pose.transform(middle) - state.pose.transform(middle)).norm() < 1e-12);
        assert!((turned(&other, model).pose.t - state.pose.t).norm() < 1e-12);
    });
}

#[test]
fn its_covariance_follows_from_the_pose() {
    const STEP: f64 = 1e-6;
    each_case(|model, state, _| {
        // the derivative of the turned pose by the pose, column by column
        let other = turned(state, model);
        let jacobian = PoseCovariance::from_columns(&core::array::from_fn::<_, 6, _>(|k| {
            let mut step = Vector6::zeros();
            step[k] = STEP;
            let moved = turned(&State { pose: state.pose.perturbed(&step), ..*state }, model);
            let w = (moved.pose.r * other.pose.r.transpose() - nalgebra::Matrix3::identity()) / STEP;
            let t = (moved.pose.t - other.pose.t) / STEP;
            Vector6::new(w[(2, 1)], w[(0, 2)], w[(1, 0)], t.x, t.y, t.z)
        }));
        let mut random = Random::new(99);
        let root = PoseCovariance::from_fn(|_, _| random.next());
        let own = root * root.transpose();
        let expected = jacobian * own * jacobian.transpose();
        let found = turned_covariance(&own, state, &other, model);
        assert!((found - expected).norm() < 1e-4 * expected.norm(), "{found} {expected}");
    });
}

#[test]
fn viewing_angles_tell_the_half() {
    each_case(|model, state, _| {
        let [min, max] = model.bbox_3d_of(&state.coefficients);
        let bottom = state.pose.transform([0.5 * (min[0] + max[0]), max[1], 0.5 * (min[2] + max[2])]);
        let rotation_y = atan2(state.pose.r[(0, 2)], state.pose.r[(2, 2)]) - core::f64::consts::FRAC_PI_2;
        let bin = 2.0 * core::f64::consts::PI / VIEWING_ANGLES as f64;
        let alpha = (rotation_y - atan2(bottom.x, bottom.z)) / bin;
        let own = (libm::round(alpha) as i64).rem_euclid(VIEWING_ANGLES as i64) as usize;
        let mut angles = [0.0; VIEWING_ANGLES];
        (angles[own], angles[(own + VIEWING_ANGLES / 2) % VIEWING_ANGLES]) = (0.7, 0.3);
        assert!((turned_probability(&angles, state, model) - 0.3).abs() < 1e-12);
        let other = turned(state, model);
        assert!((turned_probability(&angles, &other, model) - 0.7).abs() < 1e-12);
    });
}
