//! Every lens model: the values that OpenCV gives, there and back, and no allocation.

use groundpose::{Camera, Lens};

type Row = (&'static str, &'static [f64], [f64; 2], [f64; 2]);

/// Model, coefficients, a normalised point and where OpenCV 5.0 (`projectPoints`, `fisheye::distortPoints`) puts it.
const OPENCV: [Row; 5] = [
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
fn values_of_opencv() {
    for (name, coefficients, ideal, seen) in OPENCV {
        let camera = camera(name, coefficients);
        assert!(distance(camera.distort(ideal), seen) < 1e-12, "{name}");
        assert!(distance(camera.undistort(seen).expect("within the lens"), ideal) < 1e-9, "{name}");
    }
    assert!(Lens::MODELS.iter().all(|(name, _)| OPENCV.iter().any(|row| row.0 == *name)), "a model without values");
}

#[test]
fn there_and_back_without_allocation() {
    for (name, coefficients, ..) in OPENCV {
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
fn a_fisheye_is_undone_to_90_degrees_and_not_beyond() {
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
    // it grows up to 1 / sqrt(3 * 0.3) rad, where it is 2 / 3 of that
    let folding = camera("equidistant", &[-0.3, 0.0, 0.0, 0.0]);
    let limit = 1.0 / 0.9_f64.sqrt();
    assert!(folding.undistort([limit * 2.0 / 3.0 - 1e-6, 0.0]).expect("before the fold")[0].atan() < limit);
    assert_eq!(folding.undistort([limit * 2.0 / 3.0 + 1e-6, 0.0]), None);
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
