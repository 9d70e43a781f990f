// One car with shape and scores, as tables. The probe estimates it, and a test estimates it again with std.

use groundpose::geometry::lens::equidistant::Equidistant;
use groundpose::{
    Bbox, Camera, Estimate, Estimator, InputError, Lens, Observation, Options, ShapeModel, Tilt, View, Workspace,
};

/// Wheels, headlights, rear lights, corners of the roof; metres, origin on the ground below the middle.
const KEYPOINTS_3D: [[f64; 3]; 12] = [
    [-0.8, -0.3, 1.35],
    [0.8, -0.3, 1.35],
    [0.8, -0.3, -1.35],
    [-0.8, -0.3, -1.35],
    [-0.65, -0.7, 2.1],
    [0.65, -0.7, 2.1],
    [0.7, -0.9, -2.15],
    [-0.7, -0.9, -2.15],
    [-0.55, -1.45, 0.3],
    [0.55, -1.45, 0.3],
    [0.55, -1.4, -1.3],
    [-0.55, -1.4, -1.3],
];

/// One mode: a higher roof.
const BASIS: [[f64; 3]; 12] = {
    let mut basis = [[0.0; 3]; 12];
    let mut i = 8;
    while i < 12 {
        basis[i] = [0.0, -0.1, 0.0];
        i += 1;
    }
    basis
};
const EIGENVALUES: [f64; 1] = [1.0];
const BBOX_3D: [[f64; 3]; 2] = [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]];

/// Pixels; the ninth is wrong, the last not seen.
const KEYPOINTS_2D: [[f64; 2]; 12] = [
    [919.3, 560.1],
    [813.5, 565.4],
    [725.2, 552.5],
    [820.8, 547.6],
    [942.8, 533.3],
    [854.3, 537.5],
    [708.1, 509.2],
    [790.8, 507.7],
    [760.0, 590.0],
    [790.7, 473.6],
    [740.8, 476.7],
    [f64::NAN, f64::NAN],
];
const SCORES: [f64; 12] = [0.9, 0.8, 0.9, 0.4, 0.7, 0.9, 0.8, 0.7, 0.3, 0.9, 0.6, 0.0];
const BBOX: [f64; 4] = [694.1, 470.1, 963.0, 597.8];

/// Yaw of the car, radians.
pub const TRUE_YAW: f64 = 2.5;
/// How many numbers [`estimate`] gives.
pub const NUMBERS: usize = 12 + 36 + 5 + KEYPOINTS_3D.len();

/// The estimate with some options, and its numbers as bits. Through a wide lens the car, 10 degrees from the axis, looks
/// nearly the same.
pub fn estimate(
    is_wide: bool,
    options: Options,
    workspace: &mut impl Workspace,
) -> Result<Option<(Estimate, [u64; NUMBERS])>, InputError> {
    let mut camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
    if is_wide {
        camera = camera.with_lens(Lens::Equidistant(Equidistant::new([0.0; 4])))?;
    }
    let view = View::new(camera, Tilt { pitch: -0.07, roll: 0.0 })?;
    let model = ShapeModel::rigid(&KEYPOINTS_3D, BBOX_3D)?.with_modes(&BASIS, &EIGENVALUES)?;
    let observation = Observation::new(&KEYPOINTS_2D, &model)?.with_bbox(Bbox::new(BBOX)?).with_scores(&SCORES)?;
    let Ok(estimate) = Estimator::new(options)?.estimate(&view, &observation, workspace) else {
        return Ok(None);
    };
    let mut bits = [0; NUMBERS];
    let covariance = estimate.covariance.unwrap_or_default();
    let numbers = estimate.pose.r.iter().chain(estimate.pose.t.iter()).chain(covariance.iter());
    let statistics =
        [estimate.yaw, estimate.score, estimate.log10_nfa, estimate.noise_sigma, estimate.shape_coefficients[0]];
    for (bits, x) in bits.iter_mut().zip(numbers.chain(&statistics).chain(workspace.residuals())) {
        *bits = x.to_bits();
    }
    Ok(Some((estimate, bits)))
}
