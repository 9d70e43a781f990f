//! Builds the separate crates of this repository as their users build them.
#![allow(dead_code, reason = "every test binary uses its own part")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs cargo in a folder of this repository; the folder of what it built.
pub fn cargo(folder: &str, arguments: &[&str]) -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("alone");
    let status = Command::new(std::env::var("CARGO").expect("run by cargo"))
        .args(arguments)
        .args(["--quiet", "--locked", "--manifest-path"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        // The settings of the test's own build must not affect the other crates.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove("CARGO_BUILD_TARGET")
        .status();
    assert!(status.expect("cargo").success(), "cargo {arguments:?} in {folder}");
    target
}

/// Whether this toolchain has the core library of a target.
pub fn target_is_installed(target: &str) -> bool {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let folder = Command::new(rustc).args(["--print", "target-libdir", "--target", target]).output();
    let folder = String::from_utf8(folder.expect("rustc").stdout).expect("a path");
    Path::new(folder.trim()).is_dir()
}
