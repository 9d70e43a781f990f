//! Data flows one way and so do imports: a file uses only what stands above it in this list.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Modules from the bottom of the house to its roof. Below `minimal` its parts, in their own order.
const ORDER: [&str; 41] = [
    "error",
    "math",
    "lanes",
    "avx",
    "simd",
    "object",
    "camera",
    "pose",
    "observation",
    "minimal",
    "p1p",
    "p1p_height",
    "up2p",
    "p3p",
    "residual",
    "loss",
    "outermost",
    "sides",
    "normal",
    "pose_sums",
    "joint_sums",
    "score",
    "sampler",
    "ransac",
    "noise",
    "consensus",
    "workspace",
    "priors",
    "objective",
    "lm",
    "refine",
    "options",
    "points",
    "hypothesise",
    "covariance",
    "job",
    "estimate",
    "frame",
    "batch",
    "synthetic",
    "python",
];

/// Rust files of a folder and of the folders in it, with the module each belongs to.
fn files(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().expect("a name").to_str().expect("ASCII").to_owned();
        if path.is_dir() {
            // Tests of what is private stand outside the house.
            if name != "tests" {
                files(&path, found);
            }
        } else if name != "lib" {
            let parent = folder.file_name().expect("a name").to_str().expect("ASCII");
            let module = match (parent, name.as_str()) {
                ("python", _) | (_, "mod") => parent.to_owned(),
                _ => name,
            };
            found.push((module, fs::read_to_string(&path).expect("text")));
        }
    }
}

/// Modules named after `crate::` or `super::` in the code (not in comments, not in a file's own tests).
fn uses(text: &str) -> BTreeSet<&str> {
    let code = text.split("#[cfg(test)]").next().unwrap_or(text);
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let mut modules = BTreeSet::new();
    for line in lines {
        assert!(!line.contains("use crate::{"), "one line for each module: {line}");
        for rest in ["crate::", "super::"].into_iter().flat_map(|start| line.split(start).skip(1)) {
            let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
            modules.insert(&rest[..end]);
        }
    }
    modules
}

#[test]
fn files_use_only_what_stands_above_them() {
    let place = |module: &str| ORDER.iter().position(|&m| m == module);
    let mut found = vec![];
    files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut found);
    assert!(found.len() > 25, "{}", found.len());
    let mut wrong = BTreeSet::new();
    for (module, text) in &found {
        let own = place(module).unwrap_or_else(|| panic!("{module} has no place in ORDER"));
        for used in uses(text) {
            // A name that is no module is an item of the parent.
            if place(used).is_some_and(|other| other >= own && used != module) {
                wrong.insert((module.as_str(), used));
            }
        }
    }
    assert_eq!(wrong, BTreeSet::new(), "uses that go the wrong way");
    let known: BTreeSet<&str> = found.iter().map(|(module, _)| module.as_str()).collect();
    assert_eq!(known, BTreeSet::from(ORDER), "modules in ORDER");
}
