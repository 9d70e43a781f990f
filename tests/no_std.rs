//! A program without std and without an allocator estimates poses, with the same bits as a program with both.

use std::path::Path;
use std::process::Command;

use groundpose::options::{Options, Solver};
use groundpose::workspace::FixedWorkspace;

#[path = "../probe/src/scene.rs"]
mod scene;

/// In the order in which the probe prints.
const SOLVERS: [Solver; 3] = [Solver::P1p, Solver::P3p, Solver::Up2p];

/// Parts of names that only a program with std or an allocator holds.
const NAMES_OF_STD: [&str; 2] = ["3std", "__rust_alloc"];

fn holds(program: &Path, name: &str) -> bool {
    let bytes = std::fs::read(program).expect("a program");
    bytes.windows(name.len()).any(|window| window == name.as_bytes())
}

#[test]
#[cfg(target_os = "linux")]
fn the_probe_has_no_std_and_the_same_bits() {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("probe");
    let cargo = std::env::var("CARGO").expect("run by cargo");
    let built = Command::new(cargo)
        .args(["build", "--quiet", "--locked", "--manifest-path"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("probe/Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        // What the test itself was built with says nothing about the probe.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove("CARGO_BUILD_TARGET")
        .status()
        .expect("cargo");
    assert!(built.success());

    let probe = target.join("debug/groundpose-probe");
    let own = std::env::current_exe().expect("this program");
    for name in NAMES_OF_STD {
        assert!(holds(&own, name), "this program should hold {name}");
        assert!(!holds(&probe, name), "the probe holds {name}");
    }

    let output = Command::new(probe).output().expect("the probe");
    assert_eq!(output.status.code(), Some(0), "wrong pose");
    let printed: Vec<u64> = String::from_utf8(output.stdout)
        .expect("ASCII")
        .lines()
        .map(|line| u64::from_str_radix(line, 16).expect("hexadecimal"))
        .collect();
    let mut workspace = FixedWorkspace::<16>::new();
    let expected: Vec<u64> = SOLVERS
        .into_iter()
        .flat_map(|solver| {
            let options = Options { solver, ..Options::default() };
            scene::estimate(options, &mut workspace).expect("good input").expect("a pose").1
        })
        .collect();
    assert_eq!(expected.len(), SOLVERS.len() * scene::NUMBERS);
    assert_eq!(printed, expected);
}

#[test]
fn the_pose_is_right() {
    let (estimate, _) =
        scene::estimate(Options::default(), &mut FixedWorkspace::<12>::new()).expect("good input").expect("a pose");
    assert!((estimate.yaw - scene::TRUE_YAW).abs() < 0.05, "{}", estimate.yaw);
    assert_eq!(estimate.inlier_count, 10);
}
