//! A thousand synthetic vehicles on all cores: `cargo run --release --features synthetic --example batch`.

use std::time::Instant;

use groundpose::camera::{Tilt, View};
use groundpose::error::InputError;
use groundpose::estimate::Estimator;
use groundpose::object::{Bbox, ShapeModel};
use groundpose::observation::Observation;
use groundpose::options::Options;
use groundpose::synthetic::{Kind, Protocol};

const OBJECTS: u64 = 1000;

fn main() -> Result<(), InputError> {
    // Noisy keypoints, 20 to 50 % of them wrong, and a camera that pitches by more than it is told.
    let protocol = Protocol { kind: Kind::Vehicle, ..Protocol::default() };
    let scenes: Vec<_> = (0..OBJECTS).map(|trial| protocol.scene(0, trial)).collect();
    let view = View::new(protocol.camera(), Tilt::default())?;

    let model = |scene| ShapeModel::rigid(scene, protocol.bbox_3d());
    let models = scenes.iter().map(|scene| model(&scene.keypoints_3d)).collect::<Result<Vec<_>, _>>()?;
    let observations = scenes
        .iter()
        .zip(&models)
        .map(|(scene, model)| Ok(Observation::new(&scene.keypoints_2d, model)?.with_bbox(Bbox::new(scene.bbox)?)))
        .collect::<Result<Vec<_>, InputError>>()?;

    let estimator = Estimator::new(Options::default())?;
    let start = Instant::now();
    let results = estimator.estimate_batch(&view, &observations);
    let microseconds = start.elapsed().as_secs_f64() * 1e6 / OBJECTS as f64;

    let found = results.iter().zip(&scenes).filter_map(|(result, scene)| Some((result.as_ref().ok()?, scene)));
    let mut errors: Vec<f64> =
        found.map(|(estimate, scene)| (estimate.yaw - scene.pose.yaw(&view)).sin().abs().to_degrees()).collect();
    errors.sort_by(f64::total_cmp);
    println!("{} of {OBJECTS} answered, {microseconds:.1} us an object", errors.len());
    println!(
        "yaw error: median {:.2} deg, 95 % below {:.2} deg",
        errors[errors.len() / 2],
        errors[errors.len() * 19 / 20]
    );
    Ok(())
}
