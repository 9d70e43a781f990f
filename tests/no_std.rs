//! A program without std and without an allocator estimates poses, with the same bits as a program with both: on this
//! machine, and on emulated boards without an operating system.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::Command;

use groundpose::{FixedWorkspace, Options, Solver};

mod alone;
#[path = "../probe/src/scene.rs"]
mod scene;

/// Solvers in the order in which the probe prints them.
const SOLVERS: [Solver; 3] = [Solver::P1p, Solver::P3p, Solver::Up2p];

/// Parts of names that occur only in a program with std or an allocator.
const NAMES_OF_STD: [&str; 2] = ["3std", "__rust_alloc"];

/// The panics that a whole estimate may link: an index or a slice out of range, a sort whose order contradicts itself,
/// and fixed messages of core and nalgebra (a copy between lengths that differ, bounds of a clamp the wrong way round).
/// No `unwrap`, no `expect`, no division by zero, no text formatted at run time. Each would be a bug of this crate;
/// no input may cause one.
const PANICS: [&str; 4] = ["panic_bounds_check", "slice_index_fail", "panic_fmt", "panic_on_ord_violation"];
/// Parts of the names of the functions that core links for a panic.
const NAMES_OF_PANICS: [&str; 5] = ["panic", "_fail", "unwrap", "expect", "4core3fmt"];

/// Stack of a program that estimates, bytes, with its workspace for 16 keypoints, its model and its result: all that lies
/// below its entry. Of an ideal lens, and of a wide one.
const MOST_STACK: [u64; 2] = [54 * 1024, 60 * 1024];

/// The emulator of a board, for each target.
const BOARDS: [(&str, &str, &[&str]); 2] = [
    ("thumbv7em-none-eabihf", "qemu-system-arm", &["-M", "mps2-an386"]),
    ("aarch64-unknown-none", "qemu-system-aarch64", &["-M", "virt", "-cpu", "cortex-a53", "-nic", "none"]),
];

/// The probe as an embedded program is built, for this machine or another target.
fn build(target: Option<&str>) -> PathBuf {
    let mut arguments = vec!["build", "--release"];
    arguments.extend(target.iter().flat_map(|target| ["--target", target]));
    let folder = alone::cargo("probe", &arguments);
    target.map_or(folder.clone(), |target| folder.join(target)).join("release/groundpose-probe")
}

/// Names of functions of core, compiler-mangled, that end in panics.
fn panics(program: &Path) -> Vec<String> {
    let bytes = std::fs::read(program).expect("a program");
    let names = bytes.split(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_');
    let names = names.filter(|name| name.starts_with(b"_R") || name.starts_with(b"_ZN"));
    let names = names.map(|name| String::from_utf8_lossy(name).into_owned());
    names.filter(|name| NAMES_OF_PANICS.iter().any(|part| name.contains(part))).collect()
}

fn holds(program: &Path, name: &str) -> bool {
    let bytes = std::fs::read(program).expect("a program");
    bytes.windows(name.len()).any(|window| window == name.as_bytes())
}

/// The numbers of a program with std.
fn expected() -> Vec<u64> {
    let mut workspace = FixedWorkspace::<16>::new();
    let of_solver = |(is_wide, solver)| {
        let options = Options { solver, ..Options::default() };
        scene::estimate(is_wide, options, &mut workspace).expect("good input").expect("a pose").1
    };
    [false, true].into_iter().flat_map(|is_wide| SOLVERS.map(|solver| (is_wide, solver))).flat_map(of_solver).collect()
}

/// The numbers that a command prints, and those after the word "stack".
fn numbers(command: &mut Command) -> (Vec<u64>, Vec<u64>) {
    let output = command.output().expect("the program runs");
    assert_eq!(output.status.code(), Some(0), "wrong pose, or a panic: {output:?}");
    let text = String::from_utf8(output.stdout).expect("ASCII");
    let (numbers, stack) = text.split_once("stack\n").unwrap_or((&text, ""));
    let parse = |text: &str| text.lines().map(|line| u64::from_str_radix(line, 16).expect("hexadecimal")).collect();
    (parse(numbers), parse(stack))
}

#[test]
fn the_probe_has_no_std_and_the_same_bits() {
    let probe = build(None);
    let own = std::env::current_exe().expect("this program");
    for name in NAMES_OF_STD {
        assert!(holds(&own, name), "this program should hold {name}");
        assert!(!holds(&probe, name), "the probe holds {name}");
    }
    assert_eq!(expected().len(), 2 * SOLVERS.len() * scene::NUMBERS);
    assert_eq!(numbers(&mut Command::new(probe)).0, expected());
}

#[test]
fn the_probe_links_few_kinds_of_panic() {
    let own = panics(&std::env::current_exe().expect("this program"));
    assert!(own.iter().any(|name| name.contains("unwrap_failed")), "this program should hold it");
    let found = panics(&build(None));
    let allowed = |name: &String| PANICS.iter().any(|panic| name.contains(panic));
    assert!(found.iter().any(allowed), "no names in the program: {found:?}");
    assert_eq!(found.iter().filter(|name| !allowed(name)).collect::<Vec<_>>(), [""; 0]);
}

#[test]
fn boards_without_an_operating_system_give_the_same_bits() {
    for (target, emulator, options) in BOARDS {
        if !alone::target_is_installed(target) {
            println!("skipped: rustup target add {target}");
            continue;
        }
        let probe = build(Some(target));
        let mut run = Command::new(emulator);
        run.args(options).args(["-nographic", "-monitor", "none", "-serial", "none"]);
        run.args(["-semihosting-config", "enable=on,target=native", "-kernel"]).arg(probe);
        if Command::new(emulator).arg("--version").output().is_err() {
            println!("{target}: built, not run: no {emulator}");
            continue;
        }
        let (printed, stack) = numbers(&mut run);
        assert_eq!(printed, expected(), "{target}");
        println!("{target}: {stack:?} bytes of stack");
        assert_eq!(stack.len(), 2);
        for (bytes, most) in stack.into_iter().zip(MOST_STACK) {
            assert!(bytes > 1000 && bytes <= most, "{target}: {bytes} bytes of stack");
        }
    }
}

#[test]
fn the_pose_is_right() {
    for is_wide in [false, true] {
        let mut workspace = FixedWorkspace::<12>::new();
        let answer = scene::estimate(is_wide, Options::default(), &mut workspace).expect("good input");
        let (estimate, _) = answer.expect("a pose");
        assert!((estimate.yaw - scene::TRUE_YAW).abs() < 0.05, "{}", estimate.yaw);
        assert_eq!(estimate.inlier_count, 10);
    }
}
