//! Properties of every answer to any input. `PROPTEST_CASES=1000000` for a longer run.

mod common;

use common::{Case, Random};
use groundpose::minimal::p1p::Cases;
use groundpose::synthetic::{Kind, Outliers, Protocol};
use groundpose::{
    Camera, Estimate, EstimateError, Estimator, GrowingWorkspace, InputError, NoPose, Options, Pose, Refinement,
    Scoring, Solver, Tilt, View, Workspace,
};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// The same cases in every run; with `PROPTEST_CASES` other ones, as many as it says.
fn cases(default: u32) -> ProptestConfig {
    let mut config = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    if std::env::var_os("PROPTEST_CASES").is_none() {
        config.cases = default;
        config.rng_seed = RngSeed::Fixed(1);
    }
    config
}

/// Checks every property of an answer; the text names the one that fails.
fn broken_promise(case: &Case, options: &Options, e: &Estimate, residuals: &[f64]) -> Option<String> {
    let mut broken = vec![];
    let mut promise = |kept: bool, what: &str| {
        if !kept {
            broken.push(what.to_owned());
        }
    };
    let r = e.pose.r;
    promise(e.pose.is_finite(), "pose finite");
    promise((r.transpose() * r - Matrix3::identity()).norm() < 1e-12, "R orthonormal");
    promise((r.determinant() - 1.0).abs() < 1e-12, "det R = 1");
    let numbers = [e.yaw, e.reprojection_rmse, e.score, e.log10_nfa, e.noise_sigma, e.ambiguity, e.ransac.confidence];
    promise(numbers.iter().chain(&e.shape_coefficients).all(|x| x.is_finite()), "statistics finite");
    promise((0.0..=1.0).contains(&e.ambiguity), "ambiguity between 0 and 1");
    promise((0.0..=1.0).contains(&e.ransac.confidence), "confidence between 0 and 1");
    promise((0.0..=1.0 + 1e-12).contains(&e.score), "score between 0 and 1");
    promise(e.noise_sigma > 0.0 && e.inlier_threshold > 0.0, "noise and threshold positive");
    promise(e.log10_nfa <= options.max_log10_nfa, "better than chance");
    promise(e.ransac.hypotheses > 0 && e.ransac.iterations > 0, "a hypothesis");
    promise(e.shape_coefficients[case.eigenvalues.len()..].iter().all(|&x| x == 0.0), "no modes the model lacks");
    let forward = case.view.r_camera_from_ground.transpose() * r.column(2);
    promise((e.yaw - forward.x.atan2(forward.z)).sin().abs() < 1e-9, "yaw of the pose");
    if let Some(covariance) = e.covariance {
        promise(covariance.iter().all(|x| x.is_finite()), "covariance finite");
        promise((0..6).all(|i| covariance[(i, i)] > 0.0), "variances positive");
        let skew = (covariance - covariance.transpose()).abs().max();
        promise(skew <= 1e-6 * covariance.abs().max(), "covariance symmetric");
    }
    promise(e.covariance.is_some() == options.covariance, "covariance when asked for");

    // Residuals, inliers and RMSE belong to the pose that is returned.
    let expected = case.residuals(&e.pose, &e.shape_coefficients);
    promise(expected.len() == residuals.len(), "a residual per keypoint");
    // The square of a residual beyond 1e154 pixels is infinite, and projecting loses digits in proportion to the
    // numbers of the camera and the pixel, and to the distance of a point over its depth.
    let points = case.points_in_camera(&e.pose, &e.shape_coefficients);
    let pixels = case.ideal_keypoints();
    let rounding = |i: usize| {
        let ([u, v], [x, y, z], camera) = (pixels[i], points[i], case.view.camera);
        let slope = 1.0 + (x.abs() + y.abs()) / z.abs();
        let distance = e.pose.t.norm() + Vector3::from(points[i]).norm();
        let projected = (camera.fx + camera.fy) * slope * (1.0 + distance / z.abs());
        1e-12 * (projected + camera.cx.abs() + camera.cy.abs() + u.abs() + v.abs())
    };
    let same = |i: usize| {
        let (a, b) = (residuals[i], expected[i]);
        let near = (a - b).abs() <= 1e-7 * (1.0 + b.abs()) + rounding(i);
        a.is_nan() && b.is_nan() || a > 1e150 && b > 1e150 || near || rounding(i) > 1e100
    };
    promise((0..expected.len()).all(same), "residuals of the pose");
    let inliers: Vec<f64> = residuals.iter().copied().filter(|&r| r <= e.inlier_threshold).collect();
    promise(inliers.len() == e.inlier_count && e.inlier_count > 0, "inlier count");
    let rmse = (inliers.iter().map(|r| r * r).sum::<f64>() / inliers.len() as f64).sqrt();
    promise((e.reprojection_rmse - rmse).abs() <= 1e-12 * rmse, "RMSE over the inliers");
    let agree = |i: usize| {
        let (a, b, threshold) = (residuals[i], expected[i], e.inlier_threshold);
        let open = (b - threshold).abs() <= 1e-6 * threshold + rounding(i);
        open || (a <= threshold) == (b <= threshold)
    };
    promise((0..expected.len()).all(agree), "mask of the pose");
    (!broken.is_empty()).then(|| format!("{}\n{e:?}\n{residuals:?}\n{expected:?}", broken.join("; ")))
}

fn check(case: &Case, options: Options) -> Result<(), TestCaseError> {
    let Ok(estimator) = Estimator::new(options) else { return Ok(()) };
    let mut workspace = GrowingWorkspace::new();
    let result = case.try_with_observation(|o| estimator.estimate(&case.view, o, &mut workspace));
    let failure = match result {
        Err(InputError { argument, expected, .. }) => (argument.is_empty() || expected.is_empty()).then(String::new),
        Ok(Err(EstimateError::Input(error))) => {
            let has_no_height = options.solver == Solver::P1pHeight && case.view.height.is_none();
            (!has_no_height || error.argument != "view").then(|| format!("a mistake that nobody made: {error}"))
        }
        Ok(Err(EstimateError::NoPose(NoPose::InvalidInput))) => Some("a reason that cannot be".to_owned()),
        Ok(Err(_)) => None,
        Ok(Ok(estimate)) => broken_promise(case, &options, &estimate, workspace.residuals()),
    };
    match failure {
        None => Ok(()),
        Some(text) => Err(TestCaseError::fail(format!("{text}\n{case:?}\n{options:?}"))),
    }
}

/// One of a list.
fn pick<T: Copy>(random: &mut Random, of: &[T]) -> T {
    of[random.next() as usize % of.len()]
}

/// An ordinary number or one passed by mistake.
fn odd_number(random: &mut Random, low: f64, high: f64) -> f64 {
    match random.next() % 16 {
        0 => f64::NAN,
        1 => pick(random, &[0.0, -0.0, 1.0, -1.0, 1e-12, 1e-320, f64::MIN_POSITIVE]),
        2 => pick(random, &[1e6, -1e6, 1e15, 1e100, -1e100, 1e160, f64::MAX, f64::MIN]),
        3 if random.next().is_multiple_of(64) => f64::INFINITY,
        _ => random.between(low, high),
    }
}

fn odd_options(random: &mut Random) -> Options {
    let flip = |random: &mut Random| random.next().is_multiple_of(2);
    let maybe = |random: &mut Random, values: &[f64]| flip(random).then(|| pick(random, values));
    let solvers = [Solver::Auto, Solver::Auto, Solver::P1p, Solver::P3p, Solver::Up2p, Solver::P1pHeight];
    let refinements = [Refinement::Default, Refinement::Default, Refinement::Hre, Refinement::Re, Refinement::Gn];
    let hre = [[1.0, 1.5, 3.0], [1.0, 1.5, 3.0], [1e-9, 1.0, 1e9], [0.5, 0.6, 0.7]];
    Options {
        inlier_threshold: maybe(random, &[1e-300, 1e-9, 0.5, 4.0, 100.0, 1e9, 1e200]),
        relative_threshold: pick(random, &[0.0375, 0.0375, 1e-12, 0.5, 1e12, 1e300]),
        confidence: pick(random, &[0.99, 0.5, 1e-9, 1.0 - 1e-16]),
        solver: pick(random, &solvers),
        cases: pick(random, &[Cases::All, Cases::Paper]),
        scoring: pick(random, &[Scoring::Msac, Scoring::Inliers]),
        refinement: if random.next().is_multiple_of(8) { Refinement::None } else { pick(random, &refinements) },
        hre_thresholds: pick(random, &hre),
        tilt_sigma: maybe(random, &[0.0, 1e-300, 1e-3, 0.05, 10.0, 1e300, f64::INFINITY]),
        shape_prior: flip(random).then(|| flip(random)),
        bbox_sigma: maybe(random, &[1e-300, 1e-3, 5.0, 1e300, f64::INFINITY]),
        covariance: flip(random),
        max_iterations: pick(random, &[1, 2, 20, 50]),
        min_keypoints: pick(random, &[3, 4, 4, 6]),
        max_log10_nfa: pick(random, &[1.0, -3.0, f64::INFINITY, f64::NEG_INFINITY]),
        keypoint_error_factor: pick(random, &[None, Some(1.0), Some(15.0), Some(1e6)]),
        keypoint_error_dof: pick(random, &[None, Some(5.0)]),
        keypoint_error_shift: pick(random, &[None, Some(0.0), Some(0.01), Some(1e300)]),
        keypoint_error_turn: pick(random, &[None, Some(0.02), Some(1e300)]),
        ambiguity_coefficients: pick(random, &[None, Some([-0.6, 0.96]), Some([1e300, -1e300])]),
        probability_coefficients: pick(random, &[None, Some([0.0; 7]), Some([-1e300; 7])]),
        min_probability: pick(random, &[None, Some(0.0), Some(0.5), Some(1.0)]),
        score_weights: flip(random),
        seed: random.next(),
    }
}

/// `count` points of which none, some or all are odd: identical, on a line, in a plane, of any size.
fn odd_points<const N: usize>(random: &mut Random, count: usize, ranges: [[f64; 2]; N]) -> Vec<[f64; N]> {
    let ordinary = |random: &mut Random| ranges.map(|[low, high]| random.between(low, high));
    let (origin, direction) = (ordinary(random), ordinary(random));
    let kind = random.next() % 8;
    let scale = pick(random, &[1.0, 1.0, 1e-9, 1e9]);
    let point = |random: &mut Random| match kind {
        0 => ranges.map(|[low, high]| odd_number(random, low, high)),
        1 => origin,
        2 => {
            let along = random.between(-1.0, 1.0);
            core::array::from_fn(|axis| origin[axis] + along * direction[axis])
        }
        3 => {
            let mut point = ordinary(random);
            point[N - 1] = origin[N - 1];
            point
        }
        4 if random.next().is_multiple_of(2) => origin,
        5 => ordinary(random).map(|x| x * scale),
        _ => ordinary(random),
    };
    (0..count).map(|_| point(random)).collect()
}

fn odd_view(random: &mut Random) -> Result<View, InputError> {
    let focal = pick(random, &[700.0, 1000.0, 1000.0, 1e-6, 1e9, 1e-300, 1e300]);
    let mut camera =
        Camera::new(focal, odd_number(random, 0.9, 1.1).abs() * focal, 640.0, odd_number(random, 0.0, 500.0))?;
    if random.next().is_multiple_of(2) {
        camera = camera.with_image_size(1280.0, 720.0)?;
    }
    if random.next().is_multiple_of(4) {
        let coefficient = [(); 5].map(|()| odd_number(random, -0.3, 0.3) * 0.5);
        camera = camera.with_distortion(coefficient)?;
    }
    let limit = pick(random, &[0.1, 0.7, 1.57]);
    let tilt = Tilt { pitch: random.between(-limit, limit), roll: random.between(-2.0 * limit, 2.0 * limit) };
    let view = View::new(camera, tilt)?;
    if random.next().is_multiple_of(2) { view.with_height(odd_number(random, 0.5, 8.0)) } else { Ok(view) }
}

/// A random object; every other one is a valid scene with some of its numbers replaced.
fn odd_case(random: &mut Random, size: usize) -> Result<Case, InputError> {
    let view = odd_view(random)?;
    let mut case = if random.next().is_multiple_of(2) {
        let kind = pick(random, &[Kind::Cube, Kind::Vehicle]);
        let protocol = Protocol { kind, n_points: size.max(1), ..Protocol::default() };
        Case::of(&protocol, &protocol.scene(random.next(), 0))
    } else {
        let low = odd_points(random, 1, [[-3.0, 0.0]; 3])[0];
        Case {
            view,
            keypoints_2d: odd_points(random, size, [[0.0, 1280.0], [0.0, 720.0]]),
            keypoints_3d: odd_points(random, size, [[-2.0, 2.0], [-1.0, 1.0], [-4.0, 4.0]]),
            basis: vec![],
            eigenvalues: vec![],
            bbox_3d: [low, low.map(|x| x + odd_number(random, 0.5, 5.0))],
            bbox_basis: vec![],
            footprint: None,
            bbox: None,
            scores: None,
            inlier_threshold: None,
            truth: Pose { r: Matrix3::identity(), t: Vector3::zeros() },
        }
    };
    let count = case.keypoints_2d.len();
    for _ in 0..random.next() % 4 {
        let [u, v] = [odd_number(random, 0.0, 1280.0), odd_number(random, 0.0, 720.0)];
        case.keypoints_2d[random.next() as usize % count.max(1)..].iter_mut().take(1).for_each(|p| *p = [u, v]);
    }
    if random.next().is_multiple_of(2) {
        case.scores = Some((0..count).map(|_| odd_number(random, 0.0, 1.0).abs()).collect());
    }
    if random.next().is_multiple_of(3) {
        let (left, top) = (odd_number(random, 0.0, 900.0), odd_number(random, 0.0, 500.0));
        case.bbox = Some([left, top, left + odd_number(random, 1.0, 400.0), top + odd_number(random, 1.0, 300.0)]);
    }
    if random.next().is_multiple_of(4) {
        case.inlier_threshold = Some(odd_number(random, 1.0, 30.0));
    }
    if random.next().is_multiple_of(4) {
        let modes = pick(random, &[1, 3, 5, 8, 10]);
        case.basis = odd_points(random, modes * count, [[-0.2, 0.2]; 3]);
        case.eigenvalues = (0..modes).map(|_| odd_number(random, 0.1, 2.0).abs()).collect();
        if random.next().is_multiple_of(2) {
            let corners = odd_points(random, 2 * modes, [[-0.5, 0.5]; 3]);
            case.bbox_basis = corners.as_chunks().0.to_vec();
        }
    }
    Ok(case)
}

proptest! {
    // Half of the cases pass the checks of the input and reach the solver.
    #![proptest_config(cases(200_000))]

    /// A finite and consistent answer or a reason for none; never a panic.
    #[test]
    fn garbage_gets_an_error_a_reason_or_a_consistent_answer(seed: u64, size in 0_usize..40) {
        let mut random = Random(seed);
        let options = odd_options(&mut random);
        if let Ok(case) = odd_case(&mut random, size) {
            check(&case, options)?;
        }
    }
}

proptest! {
    #![proptest_config(cases(2_000))]

    #[test]
    fn answers_keep_their_promises(
        seed: u64,
        kind in prop_oneof![Just(Kind::Cube), Just(Kind::Vehicle)],
        outliers in prop_oneof![Just(Outliers::Image), Just(Outliers::Box)],
        outlier_ratio in 0.0..0.9,
        n_points in 4_usize..100,
        modes in 0_usize..=10,
    ) {
        let protocol = Protocol { kind, n_points, outlier_ratio, outliers, ..Protocol::default() };
        let mut random = Random(seed);
        let mut case = Case::of(&protocol, &protocol.scene(seed, 1));
        case.basis = (0..modes * case.keypoints_3d.len()).map(|_| random.point([[-0.1; 3], [0.1; 3]])).collect();
        case.eigenvalues = vec![1.0; modes];
        let options = odd_options(&mut random);
        let ordinary = Options { inlier_threshold: None, hre_thresholds: [1.0, 1.5, 3.0], ..options };
        check(&case, ordinary)?;
    }
}

/// Random keypoints in the box hold no information: at most one object in a hundred may get an answer.
#[test]
fn random_keypoints_are_refused() {
    const OBJECTS: u64 = 1000;
    for (kind, n_points) in [(Kind::Vehicle, 0), (Kind::Cube, 8), (Kind::Cube, 30), (Kind::Cube, 300)] {
        let protocol = Protocol { kind, n_points: n_points.max(1), ..Protocol::default() };
        let is_answered = |k: &u64| {
            let mut random = Random(*k);
            let scene = protocol.scene(*k, 0);
            let mut case = Case::of(&protocol, &scene);
            let [left, top, right, bottom] = scene.bbox;
            case.keypoints_2d.fill_with(|| [random.between(left, right), random.between(top, bottom)]);
            case.estimate(Options::default()).is_ok()
        };
        let answers = (0..OBJECTS).filter(is_answered).count() as u64;
        println!("{kind:?} with {n_points} points: {answers} of {OBJECTS} answered");
        assert!(answers <= OBJECTS / 100, "{kind:?} with {n_points} points: {answers} of {OBJECTS}");
    }
}
