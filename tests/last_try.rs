//! A nominal tilt that is wrong, or an object that does not stand on the ground, misleads every search that uses the
//! ground; the last search does not use it.

mod common;

use common::{Case, angle_deg};
use groundpose::synthetic::{Kind, Protocol};
use groundpose::{NoPose, Options, Refinement, Solver, Tilt, View};
use nalgebra::{Matrix3, Vector3};

const OBJECTS: u64 = 300;
fn vehicle(k: u64) -> Case {
    let protocol = Protocol { kind: Kind::Vehicle, ..Protocol::default() };
    Case::of(&protocol, &protocol.scene(13, k))
}

/// The image turned by half a turn, of which the view knows nothing.
fn upside_down(k: u64) -> Case {
    let mut case = vehicle(k);
    let camera = case.view.camera;
    let turn = |u: f64, v: f64| [2.0 * camera.cx - u, 2.0 * camera.cy - v];
    for pixel in &mut case.keypoints_2d {
        *pixel = turn(pixel[0], pixel[1]);
    }
    case.bbox = case.bbox.map(|[left, top, right, bottom]| {
        let ([a, b], [c, d]) = (turn(right, bottom), turn(left, top));
        [a, b, c, d]
    });
    let half_turn = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
    (case.truth.r, case.truth.t) = (half_turn * case.truth.r, half_turn * case.truth.t);
    case
}

/// The nominal pitch is off.
fn pitched(k: u64, degrees: f64) -> Case {
    let mut case = vehicle(k);
    case.view = View::new(case.view.camera, Tilt { pitch: degrees.to_radians(), roll: 0.0 }).unwrap();
    case
}

/// Fractions of answers within and beyond 15 degrees of the truth.
fn right_and_wrong(case: impl Fn(u64) -> Case, options: Options) -> [f64; 2] {
    let mut counts = [0, 0];
    for k in 0..OBJECTS {
        let case = case(k);
        if let Ok((estimate, _)) = case.estimate(options) {
            counts[usize::from(angle_deg(&estimate.pose.r, &case.truth.r) > 15.0)] += 1;
        }
    }
    counts.map(|count| f64::from(count) / OBJECTS as f64)
}

#[test]
fn an_image_upside_down_is_seen_as_it_is() {
    let [right, wrong] = right_and_wrong(upside_down, Options::default());
    println!("right {right}, wrong {wrong}");
    assert!(right > 0.95 && wrong < 0.02, "right {right}, wrong {wrong}");
}

#[test]
fn a_wrong_pitch_misleads_few() {
    for (degrees, least_right) in [(20.0, 0.9), (-30.0, 0.95)] {
        let [right, wrong] = right_and_wrong(|k| pitched(k, degrees), Options::default());
        // The ground alone, with the same standard deviation: who says it means it.
        let grounded = Options { tilt_sigma: Some(Options::OBJECT_TILT_SIGMA), ..Options::default() };
        let [right_on_ground, wrong_on_ground] = right_and_wrong(|k| pitched(k, degrees), grounded);
        println!("{degrees} deg: right {right}, wrong {wrong}; on the ground {right_on_ground}, {wrong_on_ground}");
        assert!(right > least_right && right > right_on_ground + 0.05);
        assert!(2.0 * wrong < wrong_on_ground);
    }
}

/// Where the first answer convinces nothing else is tried: all numbers are those of the solver held to the ground.
#[test]
fn what_convinces_stays_as_it_is() {
    let grounded = Options { tilt_sigma: Some(Options::OBJECT_TILT_SIGMA), ..Options::default() };
    let changed = |k: &u64| {
        let case = vehicle(*k);
        let (free, held) = (case.estimate(Options::default()), case.estimate(grounded));
        free.map(|(e, _)| (e.pose, e.log10_nfa.to_bits())) != held.map(|(e, _)| (e.pose, e.log10_nfa.to_bits()))
    };
    let changed = (0..OBJECTS).filter(changed).count();
    assert!(changed <= 1, "{changed} of {OBJECTS} vehicles on the ground have another answer");
}

/// An answer without the ground says so, and its covariance is that of a pose that no ground holds.
#[test]
fn without_the_ground_the_pose_is_less_sure() {
    let (mut free, mut held) = (vec![], vec![]);
    for k in 0..50 {
        let tilt = |case: Case, from: &mut Vec<f64>, solver| {
            if let Ok((estimate, _)) = case.estimate(Options::default())
                && estimate.solver == solver
            {
                from.push(estimate.covariance.unwrap()[(0, 0)].sqrt());
            }
        };
        tilt(upside_down(k), &mut free, Solver::P3p);
        tilt(vehicle(k), &mut held, Solver::P1p);
    }
    let median = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    assert!(free.len() > 40 && held.len() > 40);
    let (free, held) = (median(free), median(held));
    println!("standard deviation of the tilt: free {free}, held {held}");
    assert!(free > 1.2 * held);
}

#[test]
fn only_the_default_forgets_the_ground() {
    let narrow = Options { tilt_sigma: Some(0.01), ..Options::default() };
    let solver = |solver| Options { solver, ..Options::default() };
    let refined = |refinement| Options { refinement, ..Options::default() };
    let all = [narrow, solver(Solver::P1p), solver(Solver::Up2p), refined(Refinement::Hre), refined(Refinement::None)];
    for options in all {
        for k in 0..30 {
            if let Ok((estimate, _)) = upside_down(k).estimate(options) {
                assert_ne!(estimate.solver, Solver::P3p);
            }
        }
    }
}

/// Keypoints that a detector puts in one place of the box have no pose.
#[test]
fn keypoints_in_one_place_are_degenerate() {
    for k in 0..50 {
        let mut case = vehicle(k);
        let [left, top, right, bottom] = case.bbox.unwrap();
        let longer = (right - left).max(bottom - top);
        let mut random = common::Random(k);
        for pixel in &mut case.keypoints_2d {
            *pixel = [left, top].map(|corner| corner + 0.01 * longer * random.normal());
        }
        assert_eq!(case.estimate(Options::default()).unwrap_err(), NoPose::Degenerate);
        // Without a box nothing says how large they should be.
        case.bbox = None;
        assert_ne!(case.estimate(Options::default()).err(), Some(NoPose::Degenerate));
    }
}
