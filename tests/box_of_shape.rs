//! In a class of short and long vehicles a 3D box that follows the shape fits all, that of the mean shape none.

mod common;

use common::{Case, Random, angle_deg};
use groundpose::Options;
use groundpose::synthetic::projected_bbox;

/// Standard deviation of the half length, metres.
const SPREAD: f64 = 1.5;
const MEAN_HALF_LENGTH: f64 = 4.0;

/// A vehicle whose keypoints and box are stretched along its length; exact pixels; the model has one mode.
fn stretched(k: u64) -> Case {
    let mut random = Random(k);
    let mut case = loop {
        let mut case = random.exact_car(12);
        let shift = -0.5 * (case.bbox_3d[0][2] + case.bbox_3d[1][2]);
        let factor = 2.0 * MEAN_HALF_LENGTH / (case.bbox_3d[1][2] - case.bbox_3d[0][2]);
        case.bbox_3d.iter_mut().chain(&mut case.keypoints_3d).for_each(|x| x[2] = factor * (x[2] + shift));
        let stretch = 1.0 + SPREAD / MEAN_HALF_LENGTH * random.between(-1.5, 1.5);
        let longer = |[x, y, z]: [f64; 3]| [x, y, stretch * z];
        let pixels = case.keypoints_3d.iter().map(|&x| case.view.camera.project(&case.truth.transform(longer(x))));
        let pixels: Option<Vec<_>> = pixels.collect();
        let bbox = projected_bbox(&case.view.camera, &case.truth, &case.bbox_3d.map(longer));
        if let (Some(pixels), Some(bbox)) = (pixels, bbox) {
            (case.keypoints_2d, case.bbox) = (pixels, Some(bbox));
            break case;
        }
    };
    let along = |x: &[f64; 3]| [0.0, 0.0, x[2] / MEAN_HALF_LENGTH];
    case.basis = case.keypoints_3d.iter().map(along).collect();
    case.eigenvalues = vec![SPREAD * SPREAD];
    case.bbox_basis = vec![[along(&case.bbox_3d[0]), along(&case.bbox_3d[1])]];
    for pixel in &mut case.keypoints_2d {
        *pixel = pixel.map(|x| x + random.normal());
    }
    case
}

/// Median rotation error, degrees, and median error of the distance, per cent.
fn errors(cases: &[Case]) -> [f64; 2] {
    let errors = cases.iter().filter_map(|case| {
        let (estimate, _) = case.estimate(Options::default()).ok()?;
        let e_t = (estimate.pose.t - case.truth.t).norm() / case.truth.t.norm();
        Some([angle_deg(&estimate.pose.r, &case.truth.r), 100.0 * e_t])
    });
    let errors: Vec<_> = errors.collect();
    assert!(10 * errors.len() > 9 * cases.len(), "{} answers of {}", errors.len(), cases.len());
    [0, 1].map(|what| {
        let mut values: Vec<f64> = errors.iter().map(|e| e[what]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    })
}

#[test]
fn a_box_that_follows_the_shape_fits_better() {
    let following: Vec<Case> = (0..300).map(stretched).collect();
    let fixed: Vec<Case> = following.iter().map(|case| Case { bbox_basis: vec![], ..case.clone() }).collect();
    let (follows, stays) = (errors(&following), errors(&fixed));
    println!("follows {follows:?}, stays {stays:?}");
    assert!((0..2).all(|what| follows[what] < 0.9 * stays[what]), "follows {follows:?}, stays {stays:?}");
}
