//! Estimates the pose of one car without std and without an allocator, for every solver, and prints the bits of every
//! number of the answers. Returns 0 when the poses are right.
#![no_std]
#![no_main]

use core::ffi::{c_int, c_void};

use groundpose::options::{Options, Solver};
use groundpose::workspace::FixedWorkspace;

mod scene;

// Only to print; the estimator calls nothing of it.
#[link(name = "c")]
unsafe extern "C" {
    fn write(file: c_int, bytes: *const c_void, count: usize) -> isize;
    fn abort() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    // SAFETY: takes nothing and does not return.
    unsafe { abort() }
}

/// The compiled core library names it for unwinding, which a program that aborts never does.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

/// Sixteen hexadecimal digits and a new line.
fn print(bits: u64) {
    let mut line = [b'\n'; 17];
    for (k, digit) in line[..16].iter_mut().enumerate() {
        *digit = b"0123456789abcdef"[(bits >> (60 - 4 * k)) as usize & 15];
    }
    // SAFETY: the pointer and the length are those of `line`.
    unsafe { write(1, line.as_ptr().cast(), line.len()) };
}

/// Solvers in the order in which they are printed.
const SOLVERS: [Solver; 3] = [Solver::P1p, Solver::P3p, Solver::Up2p];

/// The entry that the C run time calls.
#[unsafe(no_mangle)]
pub extern "C" fn main() -> c_int {
    let mut workspace = FixedWorkspace::<16>::new();
    for solver in SOLVERS {
        let options = Options { solver, ..Options::default() };
        let Ok(Some((estimate, bits))) = scene::estimate(options, &mut workspace) else {
            return 1;
        };
        if !((estimate.yaw - scene::TRUE_YAW).abs() < 0.05) {
            return 2;
        }
        bits.into_iter().for_each(print);
    }
    0
}
