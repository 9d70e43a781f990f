//! Data flows one way and so do imports: a room uses only rooms above it, a file of a room only files above it.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The rooms from the ground to the roof, each with its files in the same order. A room without files is one file.
const ROOMS: [(&str, &[&str]); 13] = [
    ("error", &[]),
    ("tuning", &[]),
    ("geometry", &["math", "bbox", "footprint", "lens", "camera", "view", "pose", "local_view"]),
    ("model", &["shape_model", "observation"]),
    ("simd", &["lanes", "avx", "neon", "dispatch", "blocks", "projection", "spread"]),
    ("crops", &["picture", "taps", "cut"]),
    ("minimal", &["p1p", "p1p_height", "up2p", "p3p"]),
    ("search", &["score", "sampler", "ransac", "noise", "false_alarms"]),
    (
        "refine",
        &[
            "kernels",
            "box_extremes",
            "box_sides",
            "normal",
            "mad",
            "modes",
            "keypoints",
            "normal_pose",
            "normal_joint",
            "priors",
            "objective",
            "lm",
            "schedule",
            "covariance",
            "region",
        ],
    ),
    (
        "estimate",
        &[
            "workspace",
            "probability",
            "options",
            "object",
            "attempt",
            "search",
            "refine",
            "looks",
            "verify",
            "alternative",
            "describe",
            "pipeline",
            "outline",
            "wide",
            "estimator",
            "again",
            "frame_tilt",
            "frame_priors",
            "frame_object",
            "frame_answer",
            "frame",
            "camera_state",
            "answers",
            "queue",
            "batch",
        ],
    ),
    (
        "track",
        &[
            "options",
            "sighting",
            "facing",
            "size",
            "model",
            "row",
            "standing",
            "measure",
            "filter",
            "smooth",
            "vehicle",
            "associate",
            "tracker",
        ],
    ),
    ("synthetic", &[]),
    ("python", &[]),
];
/// Files directly in `src/` beside the rooms: the front door, tests of what is private.
const BESIDE: [&str; 2] = ["lib", "tests"];

/// A place in the house: number of the room, number of the file in it.
type Place = (usize, usize);

/// Where a path `room::file` leads; a room's own file (`mod.rs`) and what is no module stand at its ground.
fn place(room: &str, file: &str) -> Option<Place> {
    let number = ROOMS.iter().position(|(name, _)| *name == room)?;
    Some((number, ROOMS[number].1.iter().position(|name| *name == file).map_or(0, |k| k + 1)))
}

/// The files of a folder in a room, which count as one.
fn text_of(folder: &Path) -> String {
    let files = fs::read_dir(folder).expect("a folder").map(|file| file.expect("an entry").path());
    files.map(|file| fs::read_to_string(file).expect("text")).collect()
}

/// Every file of a room, with its path as `room::file` and its text.
fn files() -> Vec<(String, String, String)> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = vec![];
    for entry in fs::read_dir(&source).expect("a folder") {
        let path = entry.expect("an entry").path();
        let room = path.file_stem().expect("a name").to_str().expect("ASCII").to_owned();
        if BESIDE.contains(&room.as_str()) {
            continue;
        }
        if path.is_file() {
            found.push((room, String::new(), fs::read_to_string(&path).expect("text")));
            continue;
        }
        for file in fs::read_dir(&path).expect("a room") {
            let file = file.expect("an entry").path();
            let name = file.file_stem().expect("a name").to_str().expect("ASCII").to_owned();
            let text = if file.is_dir() { text_of(&file) } else { fs::read_to_string(&file).expect("text") };
            found.push((room.clone(), name, text));
        }
    }
    found
}

/// Paths `room::file` that the code names after `crate::` or `super::` (not in comments, not in a file's own tests).
fn uses<'a>(room: &'a str, text: &'a str) -> BTreeSet<(&'a str, &'a str)> {
    let code = text.split("#[cfg(test)]").next().unwrap_or(text);
    let mut paths = BTreeSet::new();
    for line in code.lines().filter(|line| !line.trim_start().starts_with("//")) {
        assert!(!line.contains("use crate::{"), "one line for each module: {line}");
        let mut words = |rest: &'a str, above: Option<&'a str>| {
            let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != ':').unwrap_or(rest.len());
            let mut words = above.into_iter().chain(rest[..end].split("::"));
            paths.insert((words.next().unwrap_or_default(), words.next().unwrap_or_default()));
        };
        line.split("crate::").skip(1).for_each(|rest| words(rest, None));
        line.split("super::").skip(1).for_each(|rest| words(rest, Some(room)));
    }
    paths
}

#[test]
fn rooms_and_files_use_only_what_stands_above_them() {
    let files = files();
    let mut wrong = BTreeSet::new();
    let mut known = BTreeSet::new();
    for (room, file, text) in &files {
        let own = place(room, file).unwrap_or_else(|| panic!("{room} is no room of ROOMS"));
        if file != "mod" && !file.is_empty() && !ROOMS[own.0].1.is_empty() {
            assert!(own.1 > 0, "{room}/{file} has no place in ROOMS");
            known.insert((room.as_str(), file.as_str()));
        }
        for (other_room, other_file) in uses(room, text) {
            let is_wrong = |other: Place| other.0 > own.0 || (other.0 == own.0 && file != "mod" && other.1 > own.1);
            if place(other_room, other_file).is_some_and(is_wrong) {
                wrong.insert((room.as_str(), file.as_str(), other_room, other_file));
            }
        }
    }
    assert_eq!(wrong, BTreeSet::new(), "uses that go the wrong way");
    let listed: BTreeSet<_> = ROOMS.iter().flat_map(|(room, files)| files.iter().map(|file| (*room, *file))).collect();
    assert_eq!(known, listed, "files in ROOMS");
}

#[test]
fn few_files_stand_outside_the_rooms() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let outside =
        fs::read_dir(source).expect("a folder").filter(|entry| entry.as_ref().expect("an entry").path().is_file());
    assert!(outside.count() <= 4);
}
