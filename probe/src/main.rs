//! Estimates the pose of one car without std and without an allocator, for every solver, and prints the bits of every
//! number of the answers. Returns 0 when the poses are right.
#![no_std]
#![no_main]

use groundpose::{FixedWorkspace, Options, Solver};

#[cfg_attr(target_os = "none", path = "bare_metal.rs")]
#[cfg_attr(not(target_os = "none"), path = "hosted.rs")]
mod machine;
mod scene;

/// Sixteen hexadecimal digits and a new line.
fn print_number(bits: u64) {
    let mut line = [b'\n'; 17];
    for (k, digit) in line[..16].iter_mut().enumerate() {
        *digit = b"0123456789abcdef"[(bits >> (60 - 4 * k)) as usize & 15];
    }
    machine::print(&line);
}

/// Solvers in the order in which they are printed.
const SOLVERS: [Solver; 3] = [Solver::P1p, Solver::P3p, Solver::Up2p];

/// The program, through an ideal lens or a wide one; its exit code. Not inlined: its frame is part of the stack measured.
#[inline(never)]
fn run(is_wide: bool) -> usize {
    let mut workspace = FixedWorkspace::<16>::new();
    for solver in SOLVERS {
        let options = Options { solver, ..Options::default() };
        let Ok(Some((estimate, bits))) = scene::estimate(is_wide, options, &mut workspace) else {
            return 1;
        };
        if !((estimate.yaw - scene::TRUE_YAW).abs() < 0.05) {
            return 2;
        }
        bits.into_iter().for_each(print_number);
    }
    0
}
