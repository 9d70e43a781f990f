//! The same bits on every vector unit of the machine that runs the tests.
#![cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]

use super::fixture::{Fixture, Random, linearised};
use crate::geometry::bbox::Bbox;
use crate::geometry::camera::Camera;
use crate::geometry::footprint::Footprint;
use crate::geometry::pose::Pose;
use crate::geometry::view::{Tilt, View};
use crate::minimal::MinimalSolver;
use crate::minimal::p1p::{Cases, P1p};
use crate::model::observation::Observation;
use crate::model::shape_model::{MAX_MODES, ShapeModel};
use crate::refine::kernels::Kernel;
use crate::refine::normal::State;
use crate::refine::priors::Priors;
use crate::search::false_alarms::Consensus;
use crate::search::score::{Scoring, cost, inlier_count};
use crate::simd::dispatch::VectorUnit;
use crate::simd::projection::Projection;

/// Few, and so many that points with a weight are brought together.
const POINTS: [usize; 2] = [23, 101];
const MODES: usize = 3;
const BBOX_3D: [[f64; 3]; 2] = [[-1.0, -0.8, -2.2], [1.0, 0.8, 2.2]];
/// More corners than lanes.
const OUTLINE: [[f64; 2]; 6] = [[-0.6, 2.2], [0.6, 2.2], [1.0, 1.6], [1.0, -2.2], [-1.0, -2.2], [-1.0, 1.6]];

/// Everything that runs on a vector unit, as text with all digits.
fn results(unit: VectorUnit, points: usize, trial: u64) -> String {
    let mut random = Random::new(trial);
    let view = View::new(Camera::new(900.0, 950.0, 600.0, 400.0).unwrap(), Tilt { pitch: -0.1, roll: 0.05 }).unwrap();
    let pose = Pose::upright(&view, 3.0 * random.next(), [2.0 * random.next(), 1.5, 14.0].into());
    let mean: Vec<[f64; 3]> = (0..points).map(|_| random.numbers()).collect();
    let basis: Vec<[f64; 3]> = (0..points * MODES).map(|_| random.numbers().map(|x: f64| 0.1 * x)).collect();
    let model = ShapeModel::rigid(&mean, BBOX_3D).unwrap().with_modes(&basis, &[2.0, 1.0, 0.5]).unwrap();
    let model = model.with_footprint(Footprint::new(&OUTLINE).unwrap());
    let pixels: Vec<[f64; 2]> = mean
        .iter()
        .map(|&x| view.camera.project(&pose.transform(x)).unwrap().map(|p| p + 20.0 * random.next()))
        .collect();
    let mut fixture = Fixture::new(view, &model, &pixels, |i| 0.3 + 0.03 * i as f64);
    let bbox = [-100.0, -80.0, 100.0, f64::NAN];
    let tilt_sigma = 0.02;
    fixture.priors = Priors { noise_sigma: 3.0, tilt_sigma, shape: true, bbox, use_bbox: true, bbox_sigma: 30.0 };
    let mut objective = fixture.objective(&model);
    objective.keypoints.unit = unit;
    let state = State { pose, coefficients: [0.2; MAX_MODES] };

    let mut text = String::new();
    for kernel in Kernel::EXAMPLES.iter().map(|at| at(400.0)) {
        let (pose, joint) =
            (linearised::<6>(&mut objective, &state, kernel), linearised::<11>(&mut objective, &state, kernel));
        text += &format!("{:?} {:?} {:?}\n", pose.h, pose.gradient, pose.cost);
        text += &format!("{:?} {:?} {:?}\n", joint.h, joint.gradient, joint.cost);
        text += &format!("{:?}\n", objective.cost(&state, kernel));
    }
    let noise = objective.estimate_noise(&state);
    let consensus = Consensus {
        unit,
        model: &objective.noise,
        inlier_fraction: noise.inlier_fraction,
        keypoints: points,
        score_sum: Some(10.0),
        hypotheses: 30,
        sample: 1,
    };
    text += &format!("{noise:?} {:?}\n", consensus.log10_nfa(objective.keypoints.measure(&state)));
    let projection = Projection::new(&view.camera, &pose);
    let blocks = objective.keypoints.of_shape(&state.coefficients);
    for scoring in [Scoring::Msac, Scoring::Inliers] {
        text += &format!("{:?}\n", cost(unit, blocks, &projection, scoring, 100.0, f64::INFINITY));
    }
    text += &format!("{}\n", inlier_count(unit, blocks, &projection, 100.0));

    let observation = Observation::new(&pixels, &model).unwrap();
    let corner = |c: usize| core::array::from_fn(|axis| BBOX_3D[(c >> axis) & 1][axis]);
    let columns = (0..8).map(|c| view.camera.project(&pose.transform(corner(c))).unwrap()[0]);
    let left = columns.clone().fold(f64::INFINITY, f64::min);
    let right = columns.fold(f64::NEG_INFINITY, f64::max);
    let bbox = Bbox::new([left, f64::NAN, right, f64::NAN]).unwrap();
    for cases in [Cases::All, Cases::Paper] {
        let solver = P1p::new(&view, &observation, &bbox, cases).on(unit);
        (0..points).for_each(|i| solver.solve([i], &mut |pose| text += &format!("{pose:?}\n")));
    }
    text
}

#[test]
fn give_the_same_bits() {
    let units = VectorUnit::all();
    for (points, trial) in POINTS.into_iter().flat_map(|points| (0..30).map(move |trial| (points, trial))) {
        let expected = results(units[0], points, trial);
        assert!(expected.matches("Pose").count() > 10, "P1P has answers");
        for &unit in &units[1..] {
            assert_eq!(results(unit, points, trial), expected, "{unit:?}, {points} points, trial {trial}");
        }
    }
}
