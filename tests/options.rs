//! No option is ignored: a change of any single field changes some answer.

mod common;

use common::{Case, Random};
use groundpose::minimal::p1p::Cases;
use groundpose::synthetic::{Kind, Outliers, Protocol};
use groundpose::{Options, Refinement, Scoring, Solver};

/// Objects with scores and shape, with so few inliers that the test against false alarms matters.
fn cases() -> Vec<Case> {
    let case = |trial: u64| {
        let protocol = Protocol { kind: Kind::Vehicle, outliers: Outliers::Box, ..Protocol::default() };
        let mut case = Case::of(&protocol, &protocol.scene(9, trial));
        let (mut random, count) = (Random(trial), case.keypoints_2d.len());
        case.inlier_threshold = None;
        case.scores = Some((0..count).map(|_| random.between(0.2, 1.0)).collect());
        case.basis = (0..2 * count).map(|_| random.point([[-0.2; 3], [0.2; 3]])).collect();
        case.eigenvalues = vec![1.0; 2];
        case
    };
    (0..20).map(case).collect()
}

fn answers(options: Options) -> Vec<String> {
    cases().iter().map(|case| format!("{:?}", case.estimate(options))).collect()
}

#[test]
fn every_option_has_an_effect() {
    let default = Options::default();
    // A new field does not compile until it has its row below.
    let Options {
        inlier_threshold: _,
        relative_threshold: _,
        confidence: _,
        solver: _,
        cases: _,
        scoring: _,
        refinement: _,
        hre_thresholds: _,
        tilt_sigma: _,
        shape_prior: _,
        bbox_sigma: _,
        covariance: _,
        max_iterations: _,
        min_keypoints: _,
        max_log10_nfa: _,
        keypoint_error_factor: _,
        keypoint_error_dof: _,
        keypoint_error_shift: _,
        keypoint_error_turn: _,
        ambiguity_coefficients: _,
        probability_coefficients: _,
        min_probability: _,
        score_weights: _,
        seed: _,
    } = default;
    let p3p = Options { solver: Solver::P3p, ..default };
    let hre = Options { refinement: Refinement::Hre, ..default };
    let pairs = [
        ("inlier_threshold", default, Options { inlier_threshold: Some(3.0), ..default }),
        ("relative_threshold", default, Options { relative_threshold: 0.05, ..default }),
        ("confidence", p3p, Options { confidence: 0.5, ..p3p }),
        ("solver", default, p3p),
        ("cases", default, Options { cases: Cases::Paper, ..default }),
        ("scoring", default, Options { scoring: Scoring::Inliers, ..default }),
        ("refinement", default, hre),
        ("hre_thresholds", hre, Options { hre_thresholds: [1.0, 2.0, 4.0], ..hre }),
        ("tilt_sigma", default, Options { tilt_sigma: Some(0.001), ..default }),
        ("tilt_sigma", hre, Options { tilt_sigma: Some(0.001), ..hre }),
        ("shape_prior", default, Options { shape_prior: Some(false), ..default }),
        ("shape_prior", hre, Options { shape_prior: Some(true), ..hre }),
        ("bbox_sigma", default, Options { bbox_sigma: Some(f64::INFINITY), ..default }),
        ("bbox_sigma", hre, Options { bbox_sigma: Some(2.0), ..hre }),
        ("covariance", default, Options { covariance: false, ..default }),
        ("max_iterations", p3p, Options { max_iterations: 2, ..p3p }),
        ("max_iterations", default, Options { max_iterations: 2, ..default }),
        ("min_keypoints", default, Options { min_keypoints: 25, ..default }),
        ("max_log10_nfa", default, Options { max_log10_nfa: -8.0, ..default }),
        ("keypoint_error_factor", default, Options { keypoint_error_factor: Some(9.0), ..default }),
        ("keypoint_error_shift", default, Options { keypoint_error_shift: Some(0.01), ..default }),
        ("keypoint_error_turn", default, Options { keypoint_error_turn: Some(0.02), ..default }),
        ("probability_coefficients", default, Options { probability_coefficients: Some([1.0; 7]), ..default }),
        ("min_probability", default, Options { min_probability: Some(1.0), ..default }),
        ("score_weights", default, Options { score_weights: false, ..default }),
        ("seed", p3p, p3p.with_seed(1)),
    ];
    for (name, before, after) in pairs {
        assert_ne!(answers(before), answers(after), "{name}");
    }
    let heavy = Options { keypoint_error_dof: Some(5.0), ..default };
    assert_ne!(heavy.region_radius2(0.95, 6), default.region_radius2(0.95, 6), "keypoint_error_dof");
}

/// Infinite: the paper's six degrees of freedom; zero: an upright object.
#[test]
fn tilt_sigma_goes_from_free_to_upright() {
    for case in cases() {
        let tilt = |sigma: f64| {
            let (e, _) = case.estimate(Options { tilt_sigma: Some(sigma), ..Options::default() }).ok()?;
            Some((case.view.r_camera_from_ground.transpose() * e.pose.r)[(1, 1)].clamp(-1.0, 1.0).acos())
        };
        if let (Some(free), Some(upright)) = (tilt(f64::INFINITY), tilt(0.0)) {
            assert!(upright < 1e-4 && free > upright, "{free} {upright}");
        }
    }
}

/// `None` has the same effect as the value that it stands for.
#[test]
fn what_none_stands_for() {
    let default = Options::default();
    let written = Options { tilt_sigma: Some(1.5_f64.to_radians()), shape_prior: Some(true), ..default };
    assert_eq!(answers(default), answers(written));
    let hre = Options { refinement: Refinement::Hre, ..default };
    let infinite = Some(f64::INFINITY);
    let written = Options { tilt_sigma: infinite, shape_prior: Some(false), bbox_sigma: infinite, ..hre };
    assert_eq!(answers(hre), answers(written));
    // An object's own threshold comes before the option's.
    let mut case = cases().remove(0);
    let by_option = case.estimate(Options { inlier_threshold: Some(5.0), ..default }).unwrap().0;
    case.inlier_threshold = Some(5.0);
    let by_object = case.estimate(Options { inlier_threshold: Some(50.0), ..default }).unwrap().0;
    assert_eq!(format!("{by_option:?}"), format!("{by_object:?}"));
}
