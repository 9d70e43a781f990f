// AArch64 at exception level 1: what must happen before the first float and the first call.
    .section .vectors, "ax"
    .global reset
reset:
    mov x0, #(3 << 20)              // CPACR_EL1: the floating-point unit on
    msr cpacr_el1, x0
    isb
    adrp x0, stack_top
    add x0, x0, :lo12:stack_top
    mov sp, x0
    bl start
