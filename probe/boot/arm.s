// Cortex-M: the table of exceptions that the core reads first, and what must happen before the first float.
    .syntax unified
    .section .vectors, "a"
    .word stack_top
    .word reset
    .section .text.reset
    .thumb_func
    .global reset
reset:
    ldr r0, =0xE000ED88             // CPACR: the floating-point unit on
    ldr r1, [r0]
    orr r1, #(0xF << 20)
    str r1, [r0]
    dsb
    isb
    bl start
