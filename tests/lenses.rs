//! Every lens model: the values that OpenCV or its paper gives, there and back, and no allocation.

use groundpose::{Camera, Lens};
use nalgebra::Vector3;

type Row = (&'static str, &'static [f64], [f64; 2], [f64; 2]);

/// Model, coefficients, a normalised point and where OpenCV 5.0 (`projectPoints`, `fisheye::distortPoints`) puts it; of the
/// models that it has not, the equations of their papers, computed apart.
const VALUES: [Row; 8] = [
    ("brown_conrady", &[-0.3, 0.1, 0.001, -0.002, 0.02], [0.5, -0.4], [0.44537421, -0.356545368]),
    (
        "rational",
        &[0.4, -0.1, 0.001, -0.0005, 0.01, 0.3, 0.05, 0.02],
        [-0.6, 0.3],
        [-0.6081190424038587, 0.3043970212019294],
    ),
    (
        "rational",
        &[-0.2, 0.05, 0.001, -0.0005, 0.01, 0.1, 0.02, 0.003, 0.001, -0.002, 0.0005, 0.0001],
        [0.2, 0.7],
        [0.1717049118685555, 0.6028290815399442],
    ),
    (
        "rational",
        &[-0.1, 0.05, 0.001, -0.0005, 0.01, 0.1, 0.02, 0.003, 0.001, -0.002, 0.0005, 0.0001, 0.03, -0.02],
        [0.5, 0.5],
        [0.4673712621118022, 0.46881809545540465],
    ),
    ("equidistant", &[-0.02, 0.01, -0.008, 0.002], [1.2, -0.9], [0.7740825681566202, -0.5805619261174653]),
    ("double_sphere", &[-0.18, 0.59], [1.2, -0.9], [0.9618817400637222, -0.7214113050477917]),
    ("field_of_view", &[0.9], [1.2, -0.9], [0.8593580569228232, -0.6445185426921174]),
    ("omnidirectional", &[1.4, -0.1, 0.02, 0.001, -0.0005], [1.2, -0.9], [0.334206068980487, -0.2505413067809343]),
];

fn camera(name: &str, coefficients: &[f64]) -> Camera {
    let (_, of) = Lens::MODELS.into_iter().find(|(model, _)| *model == name).expect("a model");
    let camera = Camera::new(1.0, 1.0, 0.0, 0.0).expect("a camera");
    camera.with_lens(of(coefficients).expect("coefficients")).expect("a lens")
}

fn distance([a, b]: [f64; 2], [c, d]: [f64; 2]) -> f64 {
    (a - c).hypot(b - d)
}

#[test]
fn values_of_opencv_and_of_papers() {
    for (name, coefficients, ideal, seen) in VALUES {
        let camera = camera(name, coefficients);
        assert!(distance(camera.distort(ideal), seen) < 1e-12, "{name}");
        assert!(distance(camera.undistort(seen).expect("within the lens"), ideal) < 1e-9, "{name}");
    }
    assert!(Lens::MODELS.iter().all(|(name, _)| VALUES.iter().any(|row| row.0 == *name)), "a model without values");
}

#[test]
fn there_and_back_without_allocation() {
    for (name, coefficients, ..) in VALUES {
        let camera = camera(name, coefficients);
        let mut worst = 0.0_f64;
        let info = allocation_counter::measure(|| {
            for step in 0..4000 {
                let (radius, angle) = (0.9 * f64::from(step % 61) / 60.0, f64::from(step));
                let ideal = [radius * angle.cos(), radius * angle.sin()];
                let back = camera.undistort(camera.distort(ideal)).unwrap_or([f64::NAN; 2]);
                worst = if distance(back, ideal) <= worst { worst } else { distance(back, ideal) };
            }
        });
        assert!(worst < 1e-9, "{name}: {worst}");
        assert_eq!(info.count_total, 0, "{name}");
    }
}

#[test]
fn a_fisheye_has_normalised_points_to_90_degrees_and_directions_beyond() {
    let ideal = camera("equidistant", &[0.0; 4]);
    for degrees in [10.0_f64, 60.0, 80.0, 89.9] {
        let angle = degrees.to_radians();
        let back = ideal.undistort([0.0, angle]).expect("in front of the camera");
        assert!((back[1].atan() - angle).abs() < 1e-12, "{degrees}");
        assert_eq!(back[0], 0.0);
    }
    assert_eq!(ideal.undistort([1.6, 0.0]), None);
    assert_eq!(ideal.undistort([f64::NAN, 0.0]), None);
    assert_eq!(ideal.undistort([0.0, 0.0]), Some([0.0, 0.0]));
    let beside = ideal.direction_of([0.0, 1.6]).expect("within the lens");
    assert!((beside - Vector3::new(0.0, 1.6_f64.sin(), 1.6_f64.cos())).norm() < 1e-15);
    assert_eq!(ideal.direction_of([0.0, 0.0]), Some(Vector3::z()));
    // it grows up to 1 / sqrt(3 * 0.3) rad, where it is 2 / 3 of that
    let folding = camera("equidistant", &[-0.3, 0.0, 0.0, 0.0]);
    let limit = 1.0 / 0.9_f64.sqrt();
    assert!(folding.undistort([limit * 2.0 / 3.0 - 1e-6, 0.0]).expect("before the fold")[0].atan() < limit);
    assert_eq!(folding.undistort([limit * 2.0 / 3.0 + 1e-6, 0.0]), None);
    let at = |angle: f64| folding.image_of(&Vector3::new(angle.sin(), 0.0, angle.cos()));
    assert!(at(limit - 1e-9).is_some() && at(limit + 1e-9).is_none() && at(3.0).is_none());
}

/// Directions over 190 degrees there and back; what is not shown is nothing.
#[test]
fn wide_lenses_there_and_back_without_allocation() {
    for (name, coefficients, ..) in VALUES.into_iter().skip(4) {
        let limit: f64 = if name == "field_of_view" { 89.0 } else { 95.0 };
        let (camera, mut worst) = (camera(name, coefficients), 0.0_f64);
        let info = allocation_counter::measure(|| {
            for step in 0..4000 {
                let (angle, around) = (limit.to_radians() * f64::from(step % 61) / 60.0, f64::from(step));
                let (sine, cosine) = angle.sin_cos();
                let ray = Vector3::new(sine * around.cos(), sine * around.sin(), cosine);
                let back = camera.image_of(&(ray * 3.0)).and_then(|seen| camera.direction_of(seen));
                worst = worst.max(back.map_or(f64::INFINITY, |back| (back - ray).norm()));
            }
        });
        assert!(worst < 1e-9, "{name}: {worst}");
        assert_eq!(info.count_total, 0, "{name}");
        let huge = Vector3::new(1e200, 0.0, 1e200);
        let seen = camera.image_of(&huge).expect("45 degrees from the axis");
        assert!(distance(seen, camera.image_of(&Vector3::new(1.0, 0.0, 1.0)).expect("the same")) < 1e-12, "{name}");
        for nowhere in [Vector3::zeros(), Vector3::x() * f64::NAN, Vector3::x() * f64::INFINITY, -Vector3::z()] {
            assert_eq!(camera.image_of(&nowhere), None, "{name}: {nowhere}");
        }
        assert!(name == "equidistant" || camera.direction_of([40.0, 0.0]).is_none(), "{name}");
        assert_eq!(camera.direction_of([f64::NAN, 0.0]), None, "{name}");
    }
}

/// What is shown at a pixel is shown at that pixel, whatever the coefficients; numbers that are none do no harm.
#[test]
fn any_coefficients_that_are_allowed() {
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut shown = 0;
    for round in 0..4000 {
        let (name, of) = Lens::MODELS[round % Lens::MODELS.len()];
        let count = VALUES.iter().find(|row| row.0 == name).expect("a model").1.len();
        let scale = 10.0_f64.powf(4.0 * uniform() - 3.0);
        let coefficients: Vec<f64> = (0..count).map(|_| scale * (2.0 * uniform() - 1.0)).collect();
        let lens = of(&coefficients).expect("coefficients");
        let Ok(camera) = Camera::new(1.0, 1.0, 0.0, 0.0).expect("a camera").with_lens(lens) else { continue };
        for _ in 0..40 {
            let reach = 10.0_f64.powf(4.0 * uniform() - 2.0);
            let pixel = [reach * (2.0 * uniform() - 1.0), reach * (2.0 * uniform() - 1.0)];
            let Some(ray) = camera.direction_of(pixel) else { continue };
            let back = camera.image_of(&ray).unwrap_or([f64::NAN; 2]);
            let error = distance(back, pixel) / (1.0 + pixel[0].hypot(pixel[1]));
            assert!(
                (ray.norm() - 1.0).abs() < 1e-9 && error < 1e-6,
                "{name} {coefficients:?} {pixel:?}: {ray} {back:?}"
            );
            shown += 1;
        }
    }
    assert!(shown > 20_000, "{shown}");
}

/// `r (1 - 0.3 r^2 + k2 r^4)` grows up to r = 1.05 or 1.21; the second once more from 2.13 on.
#[test]
fn nothing_is_seen_beyond_the_fold() {
    for k2 in [0.0, 0.03] {
        let folding = camera("brown_conrady", &[-0.3, k2, 0.0, 0.0, 0.0]);
        let image_of = |x: f64| folding.image_of(&Vector3::new(x, 0.0, 1.0));
        assert!(image_of(1.0).is_some(), "{k2}");
        assert!([1.3, 1.9, 2.4, 3.0, 8.0].into_iter().all(|x| image_of(x).is_none()), "{k2}");
        // Newton's method finds points beyond the fold, also on the other side of the middle.
        let found = (0..2000).filter_map(|k| folding.undistort([0.1 * f64::from(k), 0.0]));
        assert!(found.into_iter().all(|[x, _]| (0.0..1.25).contains(&x)), "{k2}");
    }
}

#[test]
fn a_rational_lens_takes_8_12_or_14_coefficients() {
    let (_, of) = Lens::MODELS[1];
    let k = [0.1; 15];
    let counts: Vec<usize> = (0..=15).filter(|&n| of(&k[..n]).is_some()).collect();
    assert_eq!(counts, [8, 12, 14]);
    let brown = camera("brown_conrady", &[-0.3, 0.1, 1e-3, -2e-3, 0.02]);
    let same = camera("rational", &[-0.3, 0.1, 1e-3, -2e-3, 0.02, 0.0, 0.0, 0.0]);
    assert!(distance(brown.distort([0.4, -0.3]), same.distort([0.4, -0.3])) < 1e-15);
    assert_eq!(camera("rational", &[0.0; 14]).lens, None, "it moves no point");
}
