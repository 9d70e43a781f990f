// An operating system's C library, used only to print and to exit. The estimator calls nothing of it.

use core::ffi::{c_int, c_void};

#[link(name = "c")]
unsafe extern "C" {
    fn write(file: c_int, bytes: *const c_void, count: usize) -> isize;
    fn abort() -> !;
}

/// Writes to the standard output.
pub fn print(text: &[u8]) {
    // SAFETY: the pointer and the length are those of `text`.
    unsafe { write(1, text.as_ptr().cast(), text.len()) };
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    // SAFETY: takes nothing and does not return.
    unsafe { abort() }
}

/// The compiled core library refers to it for unwinding, which a program that aborts never does.
#[unsafe(no_mangle)]
extern "C" fn rust_eh_personality() {}

/// The entry that the C run time calls.
#[unsafe(no_mangle)]
pub extern "C" fn main() -> c_int {
    [false, true].map(crate::run).into_iter().max().unwrap_or(0) as c_int
}
