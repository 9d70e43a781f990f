//! Every mistake of a caller gives a text that names it, and every reason for no pose occurs with some data.

mod common;

use std::collections::BTreeSet;

use common::{Case, Random};
use groundpose::synthetic::{Kind, Protocol};
use groundpose::{
    Bbox, Camera, EstimateError, Estimator, FixedWorkspace, Footprint, InputError, MAX_CORNERS, MAX_MODES, NoPose,
    Observation, Options, Refinement, ShapeModel, Solver, Tilt, View,
};

const NAN: f64 = f64::NAN;
const INF: f64 = f64::INFINITY;
const BOX: [[f64; 3]; 2] = [[-1.0; 3], [1.0; 3]];

fn camera() -> Camera {
    Camera::new(800.0, 800.0, 320.0, 240.0).unwrap()
}

fn view() -> View {
    View::new(camera(), Tilt::default()).unwrap()
}

/// Runs a table of mistakes: the result, and the argument that the text must name.
#[track_caller]
fn assert_named<const N: usize>(rows: [(Result<(), InputError>, &str, &str); N]) {
    for (result, argument, got) in rows {
        let error = result.expect_err(argument);
        assert_eq!(error.argument, argument);
        let text = error.to_string();
        assert!(text.starts_with(&format!("{argument}: expected {}, got ", error.expected)), "{text}");
        assert!(text.ends_with(&format!("got {got}")), "{text}");
        assert!(error.expected.len() > 5, "{text}");
    }
}

fn done<T>(result: Result<T, InputError>) -> Result<(), InputError> {
    result.map(drop)
}

#[test]
fn cameras_and_views() {
    let tilted = |pitch, roll| done(View::new(camera(), Tilt { pitch, roll }));
    let gravity = |g| done(View::from_gravity(camera(), g));
    assert_named([
        (done(Camera::new(0.0, 1.0, 0.0, 0.0)), "fx", "0"),
        (done(Camera::new(-5.0, 1.0, 0.0, 0.0)), "fx", "-5"),
        (done(Camera::new(INF, 1.0, 0.0, 0.0)), "fx", "inf"),
        (done(Camera::new(1.0, NAN, 0.0, 0.0)), "fy", "NaN"),
        (done(Camera::new(1.0, 1.0, NAN, 0.0)), "cx", "NaN"),
        (done(Camera::new(1.0, 1.0, 0.0, -INF)), "cy", "-inf"),
        (done(camera().with_distortion([0.0, 0.0, NAN, 0.0, 0.0])), "distortion", "NaN"),
        (done(camera().with_image_size(0.0, 480.0)), "image_size", "0"),
        (done(camera().with_image_size(640.0, INF)), "image_size", "inf"),
        (tilted(1.6, 0.0), "pitch", "1.6"),
        (tilted(NAN, 0.0), "pitch", "NaN"),
        (tilted(0.0, -4.0), "roll", "-4"),
        (tilted(0.0, INF), "roll", "inf"),
        (gravity([0.0; 3]), "gravity", "0"),
        (gravity([0.0, 1.0, NAN]), "gravity", "NaN"),
        (gravity([0.0, 0.0, 9.81]), "gravity", "1"),
        (done(view().with_height(0.0)), "height", "0"),
        (done(view().with_height(INF)), "height", "inf"),
    ]);
}

#[test]
fn objects() {
    let flat = [[-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]];
    let points = [[0.0; 3]; 2];
    let model = || ShapeModel::rigid(&points, BOX).unwrap();
    let modes = |basis: &[[f64; 3]], eigenvalues: &[f64]| done(model().with_modes(basis, eigenvalues));
    let ten_modes = || model().with_modes(&[[0.0; 3]; 2 * MAX_MODES], &[1.0; MAX_MODES]).unwrap();
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let outline = |corners: &[[f64; 2]]| done(Footprint::new(corners));
    assert_named([
        (done(Bbox::new([0.0, 0.0, INF, 1.0])), "bbox", "inf"),
        (done(Bbox::new([5.0, 0.0, 5.0, 1.0])), "bbox", "5 and 5"),
        (done(Bbox::new([0.0, 3.0, 1.0, 2.0])), "bbox", "3 and 2"),
        (outline(&square[..2]), "footprint", "2"),
        (outline(&[[0.0; 2]; MAX_CORNERS + 1]), "footprint", "17"),
        (outline(&[[0.0, 0.0], [1.0, 0.0], [NAN, 1.0]]), "footprint", "NaN or infinite"),
        (outline(&[square[0], square[1], [0.2, 0.2], square[3]]), "footprint", "a reflex or straight corner"),
        (outline(&[square[0], square[1], [2.0, 0.0], square[2]]), "footprint", "a reflex or straight corner"),
        (outline(&[square[0]; 3]), "footprint", "a reflex or straight corner"),
        (done(ShapeModel::rigid(&[], BOX)), "keypoints_3d", "0"),
        (done(ShapeModel::rigid(&[[0.0, INF, 0.0]], BOX)), "keypoints_3d", "NaN or infinite"),
        (done(ShapeModel::rigid(&points, flat)), "bbox_3d", "0 and 0"),
        (done(ShapeModel::rigid(&points, [[NAN; 3], [1.0; 3]])), "bbox_3d", "NaN or infinite"),
        (modes(&[[0.0; 3]; 2 * (MAX_MODES + 1)], &[1.0; MAX_MODES + 1]), "eigenvalues", "11"),
        (modes(&[[0.0; 3]; 3], &[1.0]), "basis", "3"),
        (modes(&[[0.0, NAN, 0.0]; 2], &[1.0]), "basis", "NaN or infinite"),
        (modes(&[[0.0; 3]; 2], &[0.0]), "eigenvalues", "0"),
        (done(model().with_bbox_basis(&[[[0.0; 3]; 2]])), "bbox_basis", "1"),
        (done(ten_modes().with_bbox_basis(&[[[0.0, INF, 0.0]; 2]; MAX_MODES])), "bbox_basis", "NaN or infinite"),
    ]);
}

/// Five corners that all turn the same way but go round twice.
#[test]
fn an_outline_that_winds_twice_is_not_convex() {
    let corner = |k: u32| {
        let angle = f64::from(k) * 4.0 * core::f64::consts::PI / 5.0;
        [angle.cos(), angle.sin()]
    };
    let star = [0, 1, 2, 3, 4].map(corner);
    assert_named([(done(Footprint::new(&star)), "footprint", "a reflex or straight corner")]);
}

#[test]
fn observations() {
    let (points, pixels) = ([[0.0; 3]; 2], [[0.0; 2]; 3]);
    let model = ShapeModel::rigid(&points, BOX).unwrap();
    let observation = Observation::new(&pixels[..2], &model).unwrap();
    let scores = |scores: &[f64]| done(Observation::new(&pixels[..2], &model).unwrap().with_scores(scores));
    assert_named([
        (done(Observation::new(&pixels, &model)), "keypoints_2d", "3"),
        (done(Observation::new(&[[0.0, INF], [0.0; 2]], &model)), "keypoints_2d", "inf"),
        (scores(&[1.0]), "keypoint_scores", "1"),
        (scores(&[1.0, -0.5]), "keypoint_scores", "-0.5"),
        (scores(&[INF, 1.0]), "keypoint_scores", "inf"),
        (done(observation.with_inlier_threshold(0.0)), "inlier_threshold", "0"),
        (done(observation.with_inlier_threshold(NAN)), "inlier_threshold", "NaN"),
        (done(observation.with_inlier_threshold(INF)), "inlier_threshold", "inf"),
    ]);
}

#[test]
fn options() {
    let with = |change: fn(&mut Options)| {
        let mut options = Options::default();
        change(&mut options);
        done(Estimator::new(options))
    };
    assert_named([
        (with(|o| o.inlier_threshold = Some(-1.0)), "inlier_threshold", "-1"),
        (with(|o| o.inlier_threshold = Some(NAN)), "inlier_threshold", "NaN"),
        (with(|o| o.relative_threshold = 0.0), "relative_threshold", "0"),
        (with(|o| o.relative_threshold = INF), "relative_threshold", "inf"),
        (with(|o| o.confidence = 1.0), "confidence", "1"),
        (with(|o| o.confidence = 0.0), "confidence", "0"),
        (with(|o| o.confidence = NAN), "confidence", "NaN"),
        (with(|o| o.hre_thresholds = [1.5, 1.0, 3.0]), "hre_thresholds", "1.5 and 3"),
        (with(|o| o.hre_thresholds = [0.0, 1.0, 3.0]), "hre_thresholds", "0 and 3"),
        (with(|o| o.hre_thresholds = [1.0, 2.0, INF]), "hre_thresholds", "1 and inf"),
        (with(|o| o.tilt_sigma = Some(-0.1)), "tilt_sigma", "-0.1"),
        (with(|o| o.tilt_sigma = Some(NAN)), "tilt_sigma", "NaN"),
        (with(|o| o.bbox_sigma = Some(0.0)), "bbox_sigma", "0"),
        (with(|o| o.bbox_sigma = Some(NAN)), "bbox_sigma", "NaN"),
        (with(|o| o.max_iterations = 0), "max_iterations", "0"),
        (with(|o| o.min_keypoints = 2), "min_keypoints", "2"),
        (with(|o| o.max_log10_nfa = NAN), "max_log10_nfa", "NaN"),
        (with(|o| o.keypoint_error_factor = Some(0.9)), "keypoint_error_factor", "0.9"),
        (with(|o| o.keypoint_error_dof = Some(2.0)), "keypoint_error_dof", "2"),
        (with(|o| o.probability_coefficients = Some([NAN; 7])), "probability_coefficients", "NaN"),
        (with(|o| o.keypoint_error_shift = Some(-0.1)), "keypoint_error_shift", "-0.1"),
        (with(|o| o.keypoint_error_turn = Some(f64::INFINITY)), "keypoint_error_turn", "inf"),
        (with(|o| o.ambiguity_coefficients = Some([0.0, f64::NAN])), "ambiguity_coefficients", "NaN"),
        (with(|o| o.min_probability = Some(1.1)), "min_probability", "1.1"),
    ]);
}

#[test]
fn protocols() {
    let with = |change: fn(&mut Protocol)| {
        let mut protocol = Protocol::default();
        change(&mut protocol);
        protocol.check()
    };
    assert_named([
        (with(|p| p.outlier_ratio = 1.0), "outlier_ratio", "1"),
        (with(|p| p.n_points = 0), "n_points", "0"),
        (with(|p| p.noise_sigma = -1.0), "noise_sigma", "-1"),
        (with(|p| p.pitch_error = NAN), "pitch_error_deg", "NaN"),
        (with(|p| p.bbox_error = INF), "bbox_error", "inf"),
    ]);
}

/// A valid object of 24 keypoints, before a row of the table changes it.
fn good() -> Case {
    let protocol = Protocol { kind: Kind::Vehicle, ..Protocol::default() };
    let scene = (0..).map(|k| protocol.scene(0, k)).find(|s| s.keypoints_2d.len() == 24).unwrap();
    let case = Case::of(&protocol, &scene);
    assert!(case.estimate(Options::default()).is_ok());
    case
}

fn reason(change: impl FnOnce(&mut Case), options: Options) -> NoPose {
    let mut case = good();
    change(&mut case);
    case.estimate(options).expect_err("no pose")
}

#[test]
fn every_reason_for_no_pose_is_reached() {
    let default = Options::default();
    let p1p = Options { solver: Solver::P1p, ..default };
    let unseen = |count: usize| move |case: &mut Case| case.keypoints_2d[count..].fill([NAN; 2]);
    let noise = |case: &mut Case| {
        let [left, top, right, bottom] = case.bbox.unwrap();
        let mut random = Random(3);
        case.keypoints_2d.fill_with(|| [random.between(left, right), random.between(top, bottom)]);
    };
    let reasons = [
        ("all unseen", NoPose::TooFewKeypoints, reason(unseen(0), default)),
        ("three seen", NoPose::TooFewKeypoints, reason(unseen(3), default)),
        ("scores of zero", NoPose::TooFewKeypoints, reason(|c| c.scores = Some(vec![0.0; 24]), default)),
        ("scores unknown", NoPose::TooFewKeypoints, reason(|c| c.scores = Some(vec![NAN; 24]), default)),
        ("one pixel", NoPose::Degenerate, reason(|c| c.keypoints_2d.fill([500.0; 2]), default)),
        ("pixels on a line", NoPose::Degenerate, reason(|c| line(&mut c.keypoints_2d), default)),
        ("one point", NoPose::Degenerate, reason(|c| c.keypoints_3d.fill([0.1; 3]), default)),
        ("pixels in one place of the box", NoPose::Degenerate, reason(|c| shrink(&mut c.keypoints_2d, 0.02), default)),
        ("pixels of a far object", NoPose::Improbable, reason(|c| shrink(&mut c.keypoints_2d, 0.3), default)),
        ("points on a line", NoPose::Degenerate, reason(|c| line(&mut c.keypoints_3d), default)),
        ("P1P without a box", NoPose::NoHypothesis, reason(|c| c.bbox = None, p1p)),
        ("a box elsewhere", NoPose::NoHypothesis, reason(|c| c.bbox = Some([-9e5, 0.0, -8.999e5, 9.0]), p1p)),
        ("keypoints anywhere", NoPose::NoConsensus, reason(noise, default)),
        ("asked to be certain", NoPose::Improbable, reason(|_| (), Options { min_probability: Some(1.0), ..default })),
        ("asked too much", NoPose::NoConsensus, reason(|_| (), Options { max_log10_nfa: -1e9, ..default })),
    ];
    let mut reached = BTreeSet::new();
    for (name, expected, found) in reasons {
        assert_eq!(found, expected, "{name}");
        reached.insert(found.name());
    }
    // What is left: no failure, and the reason that only Python's batches give.
    let rest: Vec<&str> = NoPose::NAMES.into_iter().filter(|name| !reached.contains(name)).collect();
    assert_eq!(rest, ["ok", "invalid_input"]);
    assert_eq!(NoPose::InvalidInput.to_string(), "invalid_input");
}

#[test]
fn estimates() {
    let case = good();
    let (default, p1p_height) = (Options::default(), Options { solver: Solver::P1pHeight, ..Options::default() });
    let alone = |options: Options| {
        let mut workspace = FixedWorkspace::<23>::new();
        let estimator = Estimator::new(options).unwrap();
        match case.with_observation(|o| estimator.estimate(&case.view, o, &mut workspace)) {
            Err(EstimateError::Input(error)) => Err(error),
            Ok(_) | Err(EstimateError::NoPose(_)) => Ok(()),
        }
    };
    let many = |options: Options| {
        case.with_observation(|o| done(Estimator::new(options).unwrap().estimate_batch(&case.view, &[*o])))
    };
    let frame = |options: Options, sigma: f64| {
        case.with_observation(|o| done(Estimator::new(options).unwrap().estimate_frame(&case.view, &[*o], sigma)))
    };
    assert_named([
        (alone(default), "keypoints_2d", "24"),
        (alone(p1p_height), "view", "none"),
        (many(p1p_height), "view", "none"),
        (frame(p1p_height, 0.1), "view", "none"),
        (frame(default, 0.0), "frame_tilt_sigma", "0"),
        (frame(default, INF), "frame_tilt_sigma", "inf"),
    ]);
}

/// What is refused is the covariance that was asked for, not the pose.
#[test]
fn a_shape_that_the_inliers_leave_free_has_a_pose_and_no_covariance() {
    let (mut case, mut random) = (good(), Random(5));
    let mode: Vec<_> = case.keypoints_3d.iter().map(|_| random.point([[-0.05; 3], [0.05; 3]])).collect();
    // Two modes that are one: their difference can be anything.
    case.basis = [mode.clone(), mode].concat();
    case.eigenvalues = vec![1.0; 2];
    let hre = Options { refinement: Refinement::Hre, ..Options::default() };
    assert_eq!(case.estimate(hre).unwrap_err(), NoPose::Degenerate);
    let (unsure, _) = case.estimate(Options { covariance: false, ..hre }).expect("a pose");
    let (sure, _) = case.estimate(Options { shape_prior: Some(true), ..hre }).expect("a pose");
    assert!(sure.covariance.is_some());
    for estimate in [unsure, sure] {
        let (t, truth) = (estimate.pose.t, case.truth.t);
        assert!((t - truth).norm() < 0.05 * truth.norm(), "{t} {truth}");
    }
}

fn line<const N: usize>(points: &mut [[f64; N]]) {
    for (k, point) in points.iter_mut().enumerate() {
        *point = core::array::from_fn(|axis| 3.0 + (axis as f64 + 1.0) * k as f64);
    }
}

/// A picture of the object, smaller by this factor, about its first keypoint.
fn shrink(pixels: &mut [[f64; 2]], factor: f64) {
    let first = pixels[0];
    for pixel in pixels {
        *pixel = [0, 1].map(|axis| first[axis] + factor * (pixel[axis] - first[axis]));
    }
}
