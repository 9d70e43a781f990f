//! One camera over many frames.

use groundpose::{CameraState, FrameAnswer, FramePriors, View};

use crate::common::Random;
use crate::scene::{Scene, camera_scene, drive};

/// Log errors of distances, root mean square, and the fraction within 1.96 of their stated standard deviations.
fn errors(scene: &Scene, answers: &[FrameAnswer], squares: &mut Vec<f64>, held: &mut Vec<bool>) {
    for (answer, (truth, _)) in answers.iter().zip(&scene.true_objects) {
        let ray = answer.pose.t.normalize();
        let variance = (answer.covariance.fixed_view::<3, 3>(3, 3) * ray).dot(&ray);
        let off = answer.pose.t.norm() - truth.t.norm();
        squares.push((answer.pose.t.norm() / truth.t.norm()).ln().powi(2));
        held.push(off.abs() < 1.96 * variance.sqrt());
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn a_camera_learns_from_frame_to_frame() {
    let mut random = Random(11);
    let (mut first, mut last, mut held) = (vec![], vec![], vec![]);
    for _ in 0..30 {
        let (nominal, truth, sizes) = drive(&mut random);
        let mut state = CameraState::new(&nominal, FramePriors::default()).unwrap();
        for k in 0..80 {
            let scene = camera_scene(&mut random, &nominal, &truth, &sizes);
            let mut answers = vec![FrameAnswer::default(); scene.objects.len()];
            let before = state.covariance();
            state.solve(&scene.frame_objects(), &mut answers).unwrap();
            let after = state.covariance();
            assert!((0..11).all(|i| after[i][i] <= before[i][i] * (1.0 + 1e-9)), "it never knows less");
            match k {
                0..10 => errors(&scene, &answers, &mut first, &mut vec![]),
                60.. => errors(&scene, &answers, &mut last, &mut held),
                _ => {}
            }
        }
        let pitch = state.covariance()[0][0].sqrt();
        assert!((state.mean()[0] - truth.tilt.pitch).abs() < 4.0 * pitch.max(0.001), "{pitch}");
    }
    assert!(mean(&last) < 0.85 * mean(&first), "{} {}", mean(&last), mean(&first));
    let held = held.iter().filter(|&&h| h).count() as f64 / held.len() as f64;
    assert!((0.92..0.99).contains(&held), "{held}");
}

#[test]
fn another_drive_forgets_the_tilt_alone() {
    let mut random = Random(12);
    let (nominal, truth, sizes) = drive(&mut random);
    let mut state = CameraState::new(&nominal, FramePriors::default()).unwrap();
    let first = state;
    for _ in 0..40 {
        let scene = camera_scene(&mut random, &nominal, &truth, &sizes);
        let mut answers = vec![FrameAnswer::default(); scene.objects.len()];
        state.solve(&scene.frame_objects(), &mut answers).unwrap();
    }
    let learned = state;
    state.start_drive();
    assert_eq!(state.mean()[..2], first.mean()[..2]);
    assert_eq!(state.mean()[2..], learned.mean()[2..]);
    assert_eq!(state.covariance()[0], first.covariance()[0]);
    assert_eq!(state.covariance()[2][2..], learned.covariance()[2][2..]);
}

#[test]
fn without_a_height_only_the_tilt_is_carried() {
    let mut random = Random(13);
    let (nominal, truth, sizes) = drive(&mut random);
    let nominal = View { height: None, ..nominal };
    let mut state = CameraState::new(&nominal, FramePriors::default()).unwrap();
    let first = state;
    for _ in 0..150 {
        let scene = camera_scene(&mut random, &nominal, &truth, &sizes);
        let mut answers = vec![FrameAnswer::default(); scene.objects.len()];
        let frame = state.solve(&scene.frame_objects(), &mut answers).unwrap();
        assert!((frame.view.height.unwrap() / truth.height.unwrap()).ln().abs() < 0.4);
    }
    assert_eq!(state.mean()[2..], first.mean()[2..]);
    assert!(state.covariance()[0][0] < 0.5 * first.covariance()[0][0]);
}

/// A tenth of a height that is wrong for all frames: one frame hardly notices, a drive does.
#[test]
fn a_drive_notices_a_wrong_height() {
    let mut random = Random(14);
    let mut noticed = 0;
    for _ in 0..20 {
        let (nominal, truth, _) = drive(&mut random);
        let wrong = nominal.with_height(1.25 * nominal.height.unwrap()).unwrap();
        let mut priors = FramePriors::default();
        priors.scales[0].sigma = 0.02;
        priors.scales[1].sigma = 0.02;
        let mut state = CameraState::new(&wrong, priors).unwrap();
        for _ in 0..200 {
            let scene = camera_scene(&mut random, &wrong, &truth, &[0.0, 0.0]);
            let mut answers = vec![FrameAnswer::default(); scene.objects.len()];
            state.solve(&scene.frame_objects(), &mut answers).unwrap();
        }
        noticed += usize::from(state.height_conflict().unwrap() < -2.0);
    }
    assert!(noticed >= 18, "{noticed}");
}

#[test]
fn numbers_are_kept() {
    let mut random = Random(15);
    let (nominal, truth, sizes) = drive(&mut random);
    let mut state = CameraState::new(&nominal, FramePriors::default()).unwrap();
    let scene = camera_scene(&mut random, &nominal, &truth, &sizes);
    let mut answers = vec![FrameAnswer::default(); scene.objects.len()];
    state.solve(&scene.frame_objects(), &mut answers).unwrap();
    let fresh = CameraState::new(&nominal, FramePriors::default()).unwrap();
    let again = fresh.with_numbers(state.mean(), state.covariance());
    assert_eq!((again.mean(), again.covariance()), (state.mean(), state.covariance()));
    let broken = fresh.with_numbers([f64::NAN; 11], state.covariance());
    assert_eq!(broken.mean(), fresh.mean());
}
