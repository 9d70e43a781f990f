//! Time of the frame solve for ten vehicles: the target is 20 us on one core.
//!
//! `cargo bench --bench frame`; `cargo test --bench frame` runs every case once.

use divan::{Bencher, black_box};
use groundpose::{
    Camera, FrameAnswer, FrameObject, FramePriors, InputError, Pose, PoseCovariance, Tilt, View, solve_frame,
};

/// Vehicles at 8 to 44 m, each of them taken to be a little too near or too far.
fn objects(view: &View) -> Result<Vec<FrameObject>, InputError> {
    (0..10)
        .map(|k| {
            let (z, off) = (8.0 + 4.0 * f64::from(k), 1.0 + 0.02 * f64::from(k % 5 - 2));
            let pose = Pose::upright(view, 0.3, [off * f64::from(k % 3 - 1) * 4.0, off * 1.65, off * z].into());
            let variances = [1e-4, 1e-4, 1e-4, 1e-6 * z * z, 1e-6 * z * z, 1e-3 * z * z];
            FrameObject::new(pose, PoseCovariance::from_diagonal(&variances.into()), [0.0; 3], (k % 2) as usize)
        })
        .collect()
}

#[divan::bench(args = [Some(1.65), None])]
fn ten_vehicles(bencher: Bencher, height: Option<f64>) {
    let camera = Camera::new(720.0, 720.0, 620.0, 190.0).expect("a camera");
    let view = View { height, ..View::new(camera, Tilt::default()).expect("a view") };
    let objects = objects(&view).expect("objects");
    let mut answers = [FrameAnswer::default(); 10];
    let priors = FramePriors::default();
    bencher.bench_local(|| solve_frame(black_box(&view), &priors, black_box(&objects), &mut answers));
    let frame = solve_frame(&view, &priors, &objects, &mut answers).expect("a frame");
    assert!((frame.view.height.expect("a height") - 1.65).abs() < 0.1);
}

fn main() {
    divan::main();
}
