// No operating system: a start-up of a few instructions, and semihosting (the debugger or emulator prints).

use core::arch::{asm, global_asm};

#[cfg(target_arch = "arm")]
global_asm!(include_str!("../boot/arm.s"));
#[cfg(target_arch = "aarch64")]
global_asm!(include_str!("../boot/aarch64.s"));

/// Operations of Arm's semihosting.
const WRITE: usize = 0x05;
const OPEN: usize = 0x01;
const EXIT: usize = 0x20;
/// The reason `ADP_Stopped_ApplicationExit`.
const APPLICATION_EXIT: usize = 0x2_0026;

fn semihosting(operation: usize, arguments: &[usize]) -> usize {
    let mut result = operation;
    // SAFETY: `arguments` holds what the operation reads.
    unsafe {
        #[cfg(target_arch = "arm")]
        asm!("bkpt #0xab", inout("r0") result, in("r1") arguments.as_ptr());
        #[cfg(target_arch = "aarch64")]
        asm!("hlt #0xf000", inout("x0") result, in("x1") arguments.as_ptr());
    }
    result
}

/// Writes to the standard output.
pub fn print(text: &[u8]) {
    // The special file `:tt`, opened for writing, is the console.
    let console = semihosting(OPEN, &[c":tt".as_ptr().addr(), 4, 3]);
    semihosting(WRITE, &[console, text.as_ptr().addr(), text.len()]);
}

fn exit(code: usize) -> ! {
    loop {
        semihosting(EXIT, &[APPLICATION_EXIT, code]);
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    exit(101)
}

unsafe extern "C" {
    static mut stack_bottom: u32;
}

/// A pattern that no program leaves on the stack by chance.
const PAINT: u32 = 0xA5C3_96E1;

/// Fills the words of the stack below the caller's frame, or counts those from the lowest up to the first changed one.
#[inline(never)]
fn untouched_words(paint: bool) -> usize {
    let here = 0u32;
    let bottom = &raw mut stack_bottom;
    // Some room for this function's own frame.
    let words = ((&raw const here).addr() - bottom.addr()) / 4 - 64;
    for k in 0..words {
        // SAFETY: between the bottom of the stack and this frame lies nothing that is in use.
        unsafe {
            if paint {
                bottom.add(k).write_volatile(PAINT);
            } else if bottom.add(k).read_volatile() != PAINT {
                return k;
            }
        }
    }
    words
}

/// Runs the program through both lenses and prints, after its numbers, how many bytes of stack each took.
#[unsafe(no_mangle)]
extern "C" fn start() -> ! {
    let runs = [false, true].map(|is_wide| {
        let painted = untouched_words(true);
        let code = crate::run(is_wide);
        (code, 4 * (painted - untouched_words(false)))
    });
    print(b"stack\n");
    runs.iter().for_each(|&(_, bytes)| crate::print_number(bytes as u64));
    exit(runs[0].0.max(runs[1].0))
}
