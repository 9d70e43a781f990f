//! `cargo publish` would send the sources of the crate and nothing else.

use std::path::Path;
use std::process::Command;

/// Folders of the crate.
const FOLDERS: [&str; 3] = ["src/", "benches/", "examples/rust_batch/"];
/// Files beside the folders; cargo makes the last two.
const FILES: [&str; 9] = [
    "CHANGELOG.md",
    "Cargo.lock",
    "Cargo.toml",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "README.md",
    "docs/katex-header.html",
    "Cargo.toml.orig",
    ".cargo_vcs_info.json",
];

#[test]
fn the_package_holds_the_crate_and_nothing_else() {
    let cargo = std::env::var("CARGO").expect("run by cargo");
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    let output = Command::new(cargo)
        .args(["package", "--list", "--allow-dirty", "--offline", "--manifest-path"])
        .arg(manifest)
        .output()
        .expect("cargo");
    let listed = String::from_utf8(output.stdout).expect("paths");
    let is_crate = |path: &&str| FOLDERS.iter().any(|folder| path.starts_with(folder)) || FILES.contains(path);
    let (own, others): (Vec<&str>, Vec<&str>) = listed.lines().partition(is_crate);
    assert!(own.len() > 40 && own.contains(&"src/lib.rs"), "{listed}");
    assert_eq!(others, [""; 0]);
}
