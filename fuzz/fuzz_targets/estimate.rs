//! For any camera, keypoints, model and options there is no panic, and every answer is a rotation and finite numbers.
#![no_main]

use arbitrary::Arbitrary;
use groundpose::minimal::p1p::Cases;
use groundpose::{
    Bbox, Camera, Estimate, Estimator, FixedWorkspace, Footprint, InputError, Observation, Options, Refinement,
    Scoring, ShapeModel, Solver, Tilt, View, Workspace,
};
use libfuzzer_sys::fuzz_target;

/// Mostly numbers of an ordinary size, so that the fuzzer gets past the checks.
#[derive(Arbitrary, Clone, Copy, Debug)]
enum Number {
    Hundredths(i16),
    Tens(i8),
    Unknown,
    Any(f64),
}

impl Number {
    fn value(self) -> f64 {
        match self {
            Self::Hundredths(x) => f64::from(x) * 0.01,
            Self::Tens(x) => f64::from(x) * 10.0,
            Self::Unknown => f64::NAN,
            Self::Any(x) => x,
        }
    }
}

fn values<const N: usize>(numbers: [Number; N]) -> [f64; N] {
    numbers.map(Number::value)
}

#[derive(Arbitrary, Debug)]
struct Keypoint {
    pixel: [Number; 2],
    point: [Number; 3],
    displacement: [Number; 3],
    score: Number,
}

#[derive(Arbitrary, Debug)]
struct Choices {
    inlier_threshold: Option<Number>,
    relative_threshold: Number,
    confidence: u16,
    solver: u8,
    paper_cases: bool,
    count_inliers: bool,
    refinement: u8,
    tilt_sigma: Option<Number>,
    shape_prior: Option<bool>,
    bbox_sigma: Option<Number>,
    covariance: bool,
    max_log10_nfa: Number,
    score_weights: bool,
    seed: u64,
}

#[derive(Arbitrary, Debug)]
struct Input {
    camera: [Number; 4],
    image_size: Option<[Number; 2]>,
    distortion: Option<[Number; 5]>,
    tilt: [i8; 2],
    height: Option<Number>,
    keypoints: Vec<Keypoint>,
    with_scores: bool,
    bbox: Option<[Number; 4]>,
    bbox_3d: [[Number; 3]; 2],
    footprint: Option<Vec<[Number; 2]>>,
    modes: u8,
    eigenvalue: Number,
    own_threshold: Option<Number>,
    options: Choices,
}

const MOST_KEYPOINTS: usize = 64;

fn options(choices: &Choices) -> Options {
    let solvers = [Solver::Auto, Solver::P1p, Solver::P3p, Solver::Up2p, Solver::P1pHeight];
    let refinements = [Refinement::Default, Refinement::Hre, Refinement::Re, Refinement::Gn, Refinement::None];
    Options {
        inlier_threshold: choices.inlier_threshold.map(Number::value),
        relative_threshold: choices.relative_threshold.value().abs(),
        confidence: (f64::from(choices.confidence) + 1.0) / 65538.0,
        solver: solvers[usize::from(choices.solver) % solvers.len()],
        cases: if choices.paper_cases { Cases::Paper } else { Cases::All },
        scoring: if choices.count_inliers { Scoring::Inliers } else { Scoring::Msac },
        refinement: refinements[usize::from(choices.refinement) % refinements.len()],
        tilt_sigma: choices.tilt_sigma.map(Number::value),
        shape_prior: choices.shape_prior,
        bbox_sigma: choices.bbox_sigma.map(Number::value),
        covariance: choices.covariance,
        max_iterations: 50,
        min_keypoints: 3,
        max_log10_nfa: choices.max_log10_nfa.value(),
        score_weights: choices.score_weights,
        seed: choices.seed,
        ..Options::default()
    }
}

fn run(input: &Input) -> Result<(), InputError> {
    let [fx, fy, cx, cy] = values(input.camera);
    let mut camera = Camera::new(fx.abs() * 10.0, fy.abs() * 10.0, cx, cy)?;
    if let Some(size) = input.image_size {
        let [width, height] = values(size);
        camera = camera.with_image_size(width, height)?;
    }
    if let Some(coefficients) = input.distortion {
        camera = camera.with_distortion(values(coefficients).map(|x| 0.01 * x))?;
    }
    let [pitch, roll] = input.tilt.map(|x| f64::from(x) / 82.0);
    let mut view = View::new(camera, Tilt { pitch, roll })?;
    if let Some(height) = input.height {
        view = view.with_height(height.value())?;
    }
    let keypoints = &input.keypoints[..input.keypoints.len().min(MOST_KEYPOINTS)];
    let points: Vec<[f64; 3]> = keypoints.iter().map(|k| values(k.point)).collect();
    let pixels: Vec<[f64; 2]> = keypoints.iter().map(|k| values(k.pixel)).collect();
    let scores: Vec<f64> = keypoints.iter().map(|k| k.score.value().abs()).collect();
    let modes = usize::from(input.modes) % 11;
    let mode = |m: usize| keypoints.iter().map(move |k| values(k.displacement).map(|x| x / (m + 1) as f64));
    let basis: Vec<[f64; 3]> = (0..modes).flat_map(mode).collect();
    let eigenvalues = vec![input.eigenvalue.value().abs(); modes];

    let mut model = ShapeModel::rigid(&points, input.bbox_3d.map(values))?.with_modes(&basis, &eigenvalues)?;
    if let Some(corners) = &input.footprint {
        let corners: Vec<[f64; 2]> = corners.iter().map(|&c| values(c)).collect();
        model = model.with_footprint(Footprint::new(&corners)?);
    }
    let mut observation = Observation::new(&pixels, &model)?;
    if input.with_scores {
        observation = observation.with_scores(&scores)?;
    }
    if let Some(sides) = input.bbox {
        observation = observation.with_bbox(Bbox::new(values(sides))?);
    }
    if let Some(threshold) = input.own_threshold {
        observation = observation.with_inlier_threshold(threshold.value())?;
    }
    let estimator = Estimator::new(options(&input.options))?;
    let mut workspace = FixedWorkspace::<MOST_KEYPOINTS>::new();
    if let Ok(estimate) = estimator.estimate(&view, &observation, &mut workspace) {
        check(&estimate, workspace.residuals());
    }
    Ok(())
}

fn check(estimate: &Estimate, residuals: &[f64]) {
    let r = estimate.pose.r;
    for i in 0..3 {
        for j in 0..3 {
            let dot = r.column(i).dot(&r.column(j));
            assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-12);
        }
    }
    assert!((r.determinant() - 1.0).abs() < 1e-12);
    assert!(estimate.pose.is_finite());
    let numbers = [
        estimate.yaw,
        estimate.reprojection_rmse,
        estimate.score,
        estimate.log10_nfa,
        estimate.noise_sigma,
        estimate.ambiguity,
    ];
    assert!(numbers.iter().chain(&estimate.shape_coefficients).all(|x| x.is_finite()));
    assert!(estimate.covariance.iter().flat_map(|c| c.iter()).all(|x| x.is_finite()));
    let inliers = residuals.iter().filter(|&&r| r <= estimate.inlier_threshold).count();
    assert!(inliers > 0 && inliers == estimate.inlier_count);
}

fuzz_target!(|input: Input| {
    // A reported mistake of the caller is a valid outcome.
    let _ = run(&input);
});
