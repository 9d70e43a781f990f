//! The frame solve against an independent one, exact data, noise with known truth, and whatever may go wrong.

mod camera;
#[path = "../common/mod.rs"]
mod common;
mod dense;
mod scene;

use common::Random;
use groundpose::{
    FrameAnswer, FrameObject, FramePriors, MAX_CLASSES, Pose, PoseCovariance, ScalePrior, Tilt, View, solve_frame,
};
use nalgebra::{Vector3, Vector6};
use scene::{Scene, camera, solved};

/// Where a chi-square with one degree of freedom ends for 95 %.
const TWO_SIGMA: f64 = 1.96;

#[test]
fn the_answer_is_that_of_all_unknowns_in_one_normal_matrix() {
    for seed in 0..20 {
        let mut random = Random(seed);
        let mut scene = Scene::draw(&mut random, 1 + seed as usize % 7);
        if seed % 3 == 0 {
            scene.nominal.height = None;
        }
        if seed % 4 == 1 && scene.objects.len() > 3 {
            scene.spoil(0);
        }
        let (frame, answers) = solved(&scene);
        let height = frame.view.height.unwrap();
        let dense = dense::solve(&scene, dense::start_height(&scene));
        let tilt = frame.view.tilt;
        let close = |a: f64, b: f64, what: &str| assert!((a - b).abs() < 2e-4, "seed {seed}, {what}: {a} {b}");
        close(tilt.pitch, dense.theta[0], "pitch");
        close(tilt.roll, dense.theta[1], "roll");
        close(height.ln(), dense.height.ln(), "height");
        for class in 0..2 {
            close(frame.scales[class].log_mean, dense.theta[3 + class], "scale");
            let sigma = dense.covariance[(3 + class, 3 + class)].sqrt();
            assert!((frame.scales[class].sigma / sigma - 1.0).abs() < 1e-3, "seed {seed}: {sigma}");
        }
        let difference = frame.covariance - dense.covariance.fixed_view::<3, 3>(0, 0);
        assert!(difference.amax() < 1e-3 * frame.covariance.amax(), "seed {seed}: {difference}");
        for (k, answer) in answers.iter().enumerate() {
            let (pose, covariance, log_size) = dense.object(&scene, k);
            assert!(
                (answer.pose.t - pose.t).norm() < 3e-4 * pose.t.norm(),
                "seed {seed}: {} {}",
                answer.pose.t,
                pose.t
            );
            assert!((answer.pose.r - pose.r).amax() < 3e-4, "seed {seed}");
            close(answer.log_size, log_size, "size");
            let difference = answer.covariance - covariance;
            assert!(difference.amax() < 3e-3 * covariance.amax(), "seed {seed}: {difference}");
        }
    }
}

#[test]
fn sure_objects_show_an_exact_road() {
    let truth = View::new(camera(), Tilt { pitch: 0.03, roll: -0.02 }).unwrap().with_height(1.7).unwrap();
    let nominal = View::new(camera(), Tilt::default()).unwrap().with_height(1.6).unwrap();
    let objects: Vec<FrameObject> = [[-4.0, 8.0], [3.0, 12.0], [6.0, 25.0], [-2.0, 40.0], [0.0, 18.0], [-9.0, 30.0]]
        .map(|[x, z]| {
            let pose = Pose::upright(&truth, x, [x, 1.7 - 0.2, z].into());
            FrameObject::new(pose, PoseCovariance::identity() * 1e-8, [0.0, 0.2, 0.0], 0).unwrap()
        })
        .into();
    let mut priors = FramePriors {
        roughness: 1e-4,
        slope: 1e-6,
        curvature: 1e-9,
        pitch_sigma: 0.1,
        roll_sigma: 0.1,
        ..FramePriors::default()
    };
    priors.height_sigma = 0.2;
    priors.scales[0] = ScalePrior { log_mean: 0.0, sigma: 1e-6, own_sigma: 1e-6 };
    let mut answers = vec![FrameAnswer::default(); objects.len()];
    for view in [nominal, View { height: None, ..nominal }] {
        let frame = solve_frame(&view, &priors, &objects, &mut answers).unwrap();
        assert!((frame.view.tilt.pitch - 0.03).abs() < 1e-4, "{}", frame.view.tilt.pitch);
        assert!((frame.view.tilt.roll + 0.02).abs() < 1e-4, "{}", frame.view.tilt.roll);
        assert!((frame.view.height.unwrap() - 1.7).abs() < 1e-3, "{:?}", frame.view.height);
        assert!((frame.objects - 6.0).abs() < 1e-6, "{}", frame.objects);
    }
}

/// Truth drawn from the priors: errors are as large as the covariances say, and intervals hold as often.
#[test]
fn uncertainty_is_honest() {
    let mut random = Random(3);
    let (mut tilt, mut pose, mut size, mut inside, mut objects) = (0.0, 0.0, 0.0, 0, 0);
    let frames = 400;
    for _ in 0..frames {
        let scene = Scene::draw(&mut random, 6);
        let (frame, answers) = solved(&scene);
        let height = (frame.view.height.unwrap() / scene.truth.height.unwrap()).ln();
        let error = Vector3::new(
            frame.view.tilt.pitch - scene.truth.tilt.pitch,
            frame.view.tilt.roll - scene.truth.tilt.roll,
            height,
        );
        tilt += error.dot(&(frame.covariance.try_inverse().unwrap() * error)) / 3.0;
        for (answer, (truth, log_size)) in answers.iter().zip(&scene.true_objects) {
            let error = scene::pose_error(&answer.pose, truth);
            pose += error.dot(&answer.covariance.cholesky().unwrap().solve(&error)) / 6.0;
            size += ((answer.log_size - log_size) / answer.log_size_sigma).powi(2);
            let ray = answer.pose.t.normalize();
            let of_ray = answer.covariance.fixed_view::<3, 3>(3, 3) * ray;
            let off = (answer.pose.t - truth.t).dot(&ray) / of_ray.dot(&ray).sqrt();
            inside += usize::from(off.abs() < TWO_SIGMA);
            objects += 1;
        }
    }
    let (tilt, pose, size) = (tilt / f64::from(frames), pose / objects as f64, size / objects as f64);
    let held = inside as f64 / objects as f64;
    for (what, x) in [("tilt and height", tilt), ("pose", pose), ("size", size)] {
        assert!((0.85..1.1).contains(&x), "{what}: {x}");
    }
    assert!((0.93..0.98).contains(&held), "{held}");
}

/// Distances are better than those of the objects alone: much with a height, some without.
#[test]
fn distances_gain_from_the_frame() {
    let mut random = Random(4);
    let mut squares = [0.0; 3];
    for _ in 0..300 {
        let mut scene = Scene::draw(&mut random, 8);
        let with_height = solved(&scene).1;
        scene.nominal.height = None;
        let without = solved(&scene).1;
        for (k, (truth, _)) in scene.true_objects.iter().enumerate() {
            let off = |t: Vector3<f64>| (t.norm() / truth.t.norm()).ln().powi(2);
            squares[0] += off(scene.objects[k].0.t);
            squares[1] += off(with_height[k].pose.t);
            squares[2] += off(without[k].pose.t);
        }
    }
    let [alone, with_height, without] = squares.map(f64::sqrt);
    println!("{with_height} {without} {alone}");
    assert!(with_height < 0.65 * alone, "{with_height} {alone}");
    assert!(without < 0.95 * alone, "{without} {alone}");
}

#[test]
fn one_wrong_object_does_not_decide() {
    let (mut random, mut weight) = (Random(5), 0.0);
    for _ in 0..50 {
        let mut scene = Scene::draw(&mut random, 8);
        let (right, before) = solved(&scene);
        scene.spoil(3);
        let (frame, answers) = solved(&scene);
        weight += answers[3].weight / 50.0;
        assert!((frame.view.tilt.pitch - right.view.tilt.pitch).abs() < 0.01);
        for k in (0..8).filter(|&k| k != 3) {
            let change = (answers[k].pose.t.norm() / before[k].pose.t.norm()).ln().abs();
            assert!(change < 0.1, "{change}");
        }
    }
    assert!(weight < 0.3, "{weight}");
}

/// All objects at distances that have nothing to do with the road: the priors' tilt within their uncertainty, and
/// distances that are no worse than those of the objects alone.
#[test]
fn objects_that_are_all_wrong_leave_the_priors() {
    let (mut random, mut squares) = (Random(6), [0.0; 2]);
    for _ in 0..200 {
        let mut scene = Scene::draw(&mut random, 6);
        (0..6).for_each(|k| scene.scatter(k, &mut random));
        let (frame, answers) = solved(&scene);
        let off = (frame.view.tilt.pitch - scene.nominal.tilt.pitch) / scene.priors.pitch_sigma;
        assert!(off.abs() < 4.0, "{off}");
        let height = frame.view.height.unwrap() / scene.nominal.height.unwrap();
        assert!((height.ln() / scene.priors.height_sigma).abs() < 4.0, "{height}");
        for (k, answer) in answers.iter().enumerate() {
            let distance = scene.true_objects[k].0.t.norm();
            squares[0] += (scene.objects[k].0.t.norm() / distance).ln().powi(2);
            squares[1] += (answer.pose.t.norm() / distance).ln().powi(2);
            assert!(answer.covariance.cholesky().is_some(), "still a covariance");
        }
    }
    let [alone, together] = squares;
    assert!(together < alone, "{together} {alone}");
}

#[test]
fn one_object_or_many_at_one_distance_are_no_more_than_they_are() {
    for count in [1, 5] {
        let mut random = Random(count);
        let mut scene = Scene::draw(&mut random, 1);
        scene.objects = vec![scene.objects[0]; count as usize];
        for height in [scene.nominal.height, None] {
            scene.nominal.height = height;
            let (frame, answers) = solved(&scene);
            let sigma = |k: usize| frame.covariance[(k, k)].sqrt();
            assert!(sigma(0) <= scene.priors.pitch_sigma && sigma(0) > 0.3 * scene.priors.pitch_sigma, "{}", sigma(0));
            assert!(sigma(1) <= scene.priors.roll_sigma && sigma(2) > 0.005, "{} {}", sigma(1), sigma(2));
            assert!(answers.iter().all(|a| a.pose.is_finite() && a.log_size_sigma > 0.01));
        }
    }
}

#[test]
fn a_frame_without_objects_is_as_before() {
    let nominal = View::new(camera(), Tilt { pitch: 0.1, roll: 0.02 }).unwrap();
    let frame = solve_frame(&nominal, &FramePriors::default(), &[], &mut []).unwrap();
    assert_eq!(frame.view, nominal);
    assert_eq!((frame.objects, frame.height_conflict), (0.0, None));
}

/// A right height and the vehicles differ by their standard deviation, a wrong one of a camera whose tilt is well known
/// by many.
#[test]
fn a_height_that_disagrees_is_noticed() {
    let (mut random, mut noticed, mut squares) = (Random(8), 0, 0.0);
    for _ in 0..200 {
        let mut scene = Scene::draw(&mut random, 8);
        squares += solved(&scene).0.height_conflict.unwrap().powi(2) / 200.0;
        (scene.priors.pitch_sigma, scene.priors.roll_sigma) = (0.002, 0.002);
        scene.nominal = View { height: scene.truth.height.map(|h| 1.4 * h), ..scene.truth };
        noticed += usize::from(solved(&scene).0.height_conflict.unwrap() < -2.0);
    }
    assert!((0.8..1.2).contains(&squares), "{squares}");
    assert!(noticed > 180, "{noticed}");
}

/// Cameras above a road whose nominal tilt is several standard deviations off: contacts alone set it right.
#[test]
fn a_tilt_that_is_far_off_is_found() {
    let mut random = Random(9);
    for _ in 0..50 {
        let scene = Scene::road_side(&mut random, 12);
        let (frame, _) = solved(&scene);
        let off = (frame.view.tilt.pitch - scene.truth.tilt.pitch).to_degrees();
        assert!(off.abs() < 1.5, "{off}");
    }
}

#[test]
fn mistakes_are_named() {
    let view = View::new(camera(), Tilt::default()).unwrap();
    let refused = |view: View, priors: FramePriors| solve_frame(&view, &priors, &[], &mut []).unwrap_err().argument;
    let wrong = [0.0, -1.0, f64::NAN, f64::INFINITY, 10.0];
    for x in wrong {
        let default = FramePriors::default();
        assert_eq!(refused(view, FramePriors { pitch_sigma: x, ..default }), "pitch_sigma");
        assert_eq!(refused(view, FramePriors { roll_sigma: x, ..default }), "roll_sigma");
        assert_eq!(refused(view, FramePriors { height_sigma: x, ..default }), "height_sigma");
        assert_eq!(refused(view, FramePriors { roughness: x, ..default }), "roughness");
        assert_eq!(refused(view, FramePriors { slope: x, ..default }), "slope");
        assert_eq!(refused(view, FramePriors { curvature: x, ..default }), "curvature");
        let scales = |prior| FramePriors { scales: [prior; MAX_CLASSES], ..default };
        assert_eq!(refused(view, scales(ScalePrior { sigma: x, ..ScalePrior::default() })), "sigma");
        assert_eq!(refused(view, scales(ScalePrior { own_sigma: x, ..ScalePrior::default() })), "own_sigma");
    }
    let scales = [ScalePrior { log_mean: f64::NAN, ..ScalePrior::default() }; MAX_CLASSES];
    assert_eq!(refused(view, FramePriors { scales, ..FramePriors::default() }), "log_mean");
    for height in [0.01, 1500.0] {
        assert_eq!(refused(view.with_height(height).unwrap(), FramePriors::default()), "height");
    }
    let upright = Pose::upright(&view, 0.0, [0.0, 1.5, 10.0].into());
    let object =
        |pose, covariance, bottom, class| FrameObject::new(pose, covariance, bottom, class).unwrap_err().argument;
    let sure = PoseCovariance::identity();
    assert_eq!(object(upright.perturbed(&(Vector6::repeat(1.0) * f64::NAN)), sure, [0.0; 3], 0), "pose");
    assert_eq!(object(upright, -sure, [0.0; 3], 0), "covariance");
    assert_eq!(object(upright, sure, [f64::NAN; 3], 0), "bottom_centre");
    assert_eq!(object(upright, sure, [0.0; 3], MAX_CLASSES), "class");
    let one = FrameObject::new(upright, sure, [0.0; 3], 0).unwrap();
    assert_eq!(solve_frame(&view, &FramePriors::default(), &[one], &mut []).unwrap_err().argument, "answers");
}

/// Behind the camera, above the horizon, at the camera itself, without any uncertainty or with all of it.
#[test]
fn absurd_objects_give_numbers() {
    let view = View::new(camera(), Tilt::default()).unwrap().with_height(1.5).unwrap();
    let places = [[0.0, 1.5, 10.0], [0.0, -3.0, 10.0], [0.0, 1.5, -10.0], [0.0; 3], [0.0, 9e5, 9e5], [0.0, 1e-9, 1e-9]];
    let mut objects = vec![];
    for place in places {
        for variance in [0.0, 1e-4, 1e6] {
            let pose = Pose::upright(&view, 0.3, place.into());
            objects.push(FrameObject::new(pose, PoseCovariance::identity() * variance, [0.0; 3], 0).unwrap());
        }
    }
    let mut answers = vec![FrameAnswer::default(); objects.len()];
    for view in [view, View { height: None, ..view }] {
        let frame = solve_frame(&view, &FramePriors::default(), &objects, &mut answers).unwrap();
        assert!(frame.view.tilt.pitch.is_finite() && frame.view.height.unwrap().is_finite());
        for answer in &answers {
            assert!(answer.pose.is_finite() && answer.covariance.iter().all(|x| x.is_finite()), "{:?}", answer.pose);
            assert!(answer.log_size_sigma.is_finite() && (0.0..=1.0).contains(&answer.weight));
        }
    }
}

/// The solve allocates nothing for any number of objects.
#[test]
fn nothing_is_allocated() {
    let scene = Scene::draw(&mut Random(2), 10);
    let objects = scene.frame_objects();
    let mut answers = vec![FrameAnswer::default(); objects.len()];
    for height in [scene.nominal.height, None] {
        let view = View { height, ..scene.nominal };
        let info = allocation_counter::measure(|| {
            solve_frame(&view, &scene.priors, &objects, &mut answers).unwrap();
        });
        assert_eq!(info.count_total, 0);
    }
}
