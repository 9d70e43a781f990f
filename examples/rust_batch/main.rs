//! Many vehicles on all cores, with a status for each: `cargo run --release --example rust_batch`.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::time::Instant;

use groundpose::synthetic::{Kind, Protocol, Scene};
use groundpose::{Bbox, Estimate, Estimator, InputError, NoPose, Observation, Options, ShapeModel, Tilt, View};

const OBJECTS: u64 = 1000;
/// Rows of the table.
const ROWS: usize = 10;

/// Vehicles with known truth: noisy keypoints, 20 to 50 % of them wrong, and a camera whose true
/// pitch differs from the nominal one. One vehicle in a hundred has only wrong keypoints.
fn scenes(protocol: &Protocol, objects: u64) -> Vec<Scene> {
    let scene = |trial| {
        let mut scene = protocol.scene(0, trial);
        if trial % 100 == 4 {
            scene.keypoints_2d.reverse();
        }
        scene
    };
    (0..objects).map(scene).collect()
}

/// One result per object: a pose, or the reason why there is none.
fn estimate(view: &View, protocol: &Protocol, scenes: &[Scene]) -> Result<Vec<Result<Estimate, NoPose>>, InputError> {
    let models = scenes
        .iter()
        .map(|scene| ShapeModel::rigid(&scene.keypoints_3d, protocol.bbox_3d()))
        .collect::<Result<Vec<_>, _>>()?;
    let observations = scenes
        .iter()
        .zip(&models)
        .map(|(scene, model)| Ok(Observation::new(&scene.keypoints_2d, model)?.with_bbox(Bbox::new(scene.bbox)?)))
        .collect::<Result<Vec<_>, InputError>>()?;
    Estimator::new(Options::default())?.estimate_batch(view, &observations)
}

/// Rows of the first objects: estimate, standard deviation and truth.
fn write_table(
    out: &mut impl Write,
    view: &View,
    results: &[Result<Estimate, NoPose>],
    scenes: &[Scene],
) -> io::Result<()> {
    writeln!(out, "object  status          depth, m        truth  yaw, deg   truth  inliers")?;
    for (i, (result, scene)) in results.iter().zip(scenes).enumerate().take(ROWS) {
        let (depth, yaw) = (scene.pose.t.z, scene.pose.yaw(view).to_degrees());
        match result {
            Ok(e) => {
                let sigma = e.covariance.map_or(f64::NAN, |c| c[(5, 5)].sqrt());
                let (z, angle) = (e.pose.t.z, e.yaw.to_degrees());
                let (inliers, n) = (e.inlier_count, scene.keypoints_2d.len());
                let row = format!("{z:6.2} ± {sigma:4.2}  {depth:7.2}  {angle:8.1}  {yaw:6.1}  {inliers:3}/{n}");
                writeln!(out, "{i:6}  ok              {row}")?;
            }
            Err(reason) => writeln!(out, "{i:6}  {:<20}{:5}  {depth:7.2}  {:>8}  {yaw:6.1}", reason.name(), "-", "-")?,
        }
    }
    Ok(())
}

/// Numbers of objects by status, and errors of the answers.
fn write_summary(
    out: &mut impl Write,
    view: &View,
    results: &[Result<Estimate, NoPose>],
    scenes: &[Scene],
) -> io::Result<()> {
    let mut statuses = BTreeMap::new();
    for result in results {
        *statuses.entry(result.as_ref().map_or_else(|reason| reason.name(), |_| NoPose::NAMES[0])).or_insert(0) += 1;
    }
    writeln!(out, "\n{} objects: {statuses:?}", results.len())?;
    let found = results.iter().zip(scenes).filter_map(|(result, scene)| Some((result.as_ref().ok()?, scene)));
    let difference = |yaw: f64, truth: f64| (yaw - truth).sin().atan2((yaw - truth).cos()).abs().to_degrees();
    let mut errors: Vec<f64> = found.map(|(e, scene)| difference(e.yaw, scene.pose.yaw(view))).collect();
    errors.sort_by(f64::total_cmp);
    let quantile = |percent: usize| errors.get(errors.len() * percent / 100).copied().unwrap_or(f64::NAN);
    writeln!(out, "yaw error: median {:.2} deg, 95 % below {:.2} deg", quantile(50), quantile(95))
}

/// The program for this many objects.
pub fn run(out: &mut impl Write, objects: u64) -> Result<(), Box<dyn std::error::Error>> {
    let protocol = Protocol { kind: Kind::Vehicle, ..Protocol::default() };
    let scenes = scenes(&protocol, objects);
    let view = View::new(protocol.camera(), Tilt::default())?;
    let start = Instant::now();
    let results = estimate(&view, &protocol, &scenes)?;
    let microseconds = start.elapsed().as_secs_f64() * 1e6 / objects as f64;
    write_table(out, &view, &results, &scenes)?;
    write_summary(out, &view, &results, &scenes)?;
    writeln!(out, "{microseconds:.1} us per object")?;
    Ok(())
}

#[allow(dead_code, reason = "a test calls `run`")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    run(&mut io::stdout().lock(), OBJECTS)
}
