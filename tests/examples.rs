//! The examples run and print correct results.

mod alone;
#[path = "../examples/rust_batch/main.rs"]
mod rust_batch;

use std::process::Command;

/// The words of a line that are numbers.
fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn the_batch_prints_a_table_of_objects_and_their_statuses() {
    let mut printed = vec![];
    rust_batch::run(&mut printed, 200).expect("it runs");
    let printed = String::from_utf8(printed).expect("text");
    let lines: Vec<&str> = printed.lines().collect();
    assert!(lines[1].contains(" ok "), "{printed}");
    assert!(lines[5].contains("no_consensus"), "the object without a right keypoint: {printed}");
    let summary = printed.split_once("yaw error: median ").expect("a summary").1;
    let median: f64 = summary.split(' ').next().and_then(|word| word.parse().ok()).expect("a number");
    assert!(median < 2.0, "{printed}");
    assert!(printed.contains("200 objects: {") && printed.contains("\"ok\": "), "{printed}");
}

#[test]
fn the_embedded_program_writes_the_poses_of_its_table() {
    let built = alone::cargo("examples/embedded", &["build", "--release", "--example", "print_frame"]);
    let program = built.join("release/examples/print_frame");
    let output = Command::new(program).output().expect("it runs");
    let printed = String::from_utf8(output.stdout).expect("text");
    assert!(output.status.success(), "{printed}");
    let rows: Vec<&str> = printed.lines().skip(1).collect();
    assert_eq!(rows.len(), 5, "{printed}");
    assert!(rows[4].ends_with("no_consensus"), "the vehicle without a right keypoint: {printed}");
    for row in &rows[..4] {
        let (estimate, truth) = row.split_once('|').expect("estimate beside truth");
        let (estimate, truth) = (numbers(estimate), numbers(truth));
        // Place in the frame, yaw, x, y, z, standard deviation of z, inliers.
        let [_, yaw, x, _, z, sigma, inliers] = estimate[..] else { panic!("{row}") };
        assert!((yaw - truth[0]).abs() < 0.05 && (x - truth[1]).abs() < 0.3, "{row}");
        assert!((z - truth[3]).abs() < 4.0 * sigma && sigma < 0.05 * z && inliers > 10.0, "{row}");
    }
}

/// The commands of docs/embedded.md, as a user types them.
#[test]
fn the_embedded_program_is_built_for_a_microcontroller() {
    let target = "thumbv7em-none-eabihf";
    if alone::target_is_installed(target) {
        alone::cargo("examples/embedded", &["build", "--target", target]);
        alone::cargo("examples/embedded", &["build", "--release", "--target", target]);
    } else {
        println!("skipped: rustup target add {target}");
    }
}
