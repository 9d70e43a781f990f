"""The drawing context: OpenGL without a display."""

from __future__ import annotations

import contextlib
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from groundpose.lab.drive.render import device

HELP = (
    "the renderer needs OpenGL without a display (EGL): on Debian and Ubuntu "
    "`apt-get install libegl1 libgl1-mesa-dri`, and `pip install groundpose[simulate]`"
)
_NEEDED = 330


@cache
def context() -> Any:
    """The one context of the process (moderngl.Context), on the device of `device.choose`.

    Raises:
        RuntimeError: moderngl, EGL or the device is missing; the text names the packages to install.
    """
    device.prepare()
    # torch loads triton late; its LLVM crashes when it is loaded after the renderer's
    with contextlib.suppress(ImportError):
        import_module("triton")
    try:
        import moderngl
    except ImportError as error:
        raise RuntimeError(f"{HELP} ({error})") from None
    try:
        made = moderngl.create_context(standalone=True, backend="egl", require=_NEEDED)  # type: ignore[arg-type]
    except Exception as error:  # moderngl raises Exception itself for a missing library or device
        raise RuntimeError(f"{HELP} ({error})") from None
    device.check(made.info["GL_RENDERER"])
    return made


# Programs that compute light per vertex; the others do so per pixel.
_LIT_CORNERS = ("leaf",)
_UNLIT = ("contact", "average")
_PATTERNS = ("PLATE", "GRILLE", "HEADLAMP", "TAILLAMP", "DISPLAY", "CABIN", "INDICATOR")


def pattern(name: str) -> float:
    """The number of a pattern of vehicle.glsl; 0 for none."""
    return 1.0 + _PATTERNS.index(name) if name else 0.0


def program(name: str, fragment: str | None = None, defines: tuple[str, ...] = ()) -> Any:
    """Compile `shaders/<name>.vert` with `<fragment or name>.frag`, with the lighting code where it is used.

    The define CORNERS computes the light of a vehicle per vertex instead of per pixel.
    """
    values = [*defines, *(f"{p} {pattern(p)}" for p in _PATTERNS)]
    head = "#version 330\n" + "".join(f"#define {d}\n" for d in values)
    light = "" if fragment == "depth" or name in _UNLIT else _source("light.glsl")
    if name == "vehicle" and light:
        light += _source("vehicle.glsl")
    corners = name in _LIT_CORNERS or "CORNERS" in defines
    vertex = head + (light if corners else "") + _source(f"{name}.vert")
    return context().program(
        vertex_shader=vertex,
        # the pixel shader of leaves needs only the haze, but the other names must be defined
        fragment_shader=head + ("" if "CORNERS" in defines else light) + _source(f"{fragment or name}.frag"),
    )


def _source(name: str) -> str:
    return (Path(__file__).parent / "shaders" / name).read_text("utf-8")


def set_uniforms(target: Any, values: dict[str, Any]) -> None:
    """Set the uniforms that the program uses; the compiler removes the others. Arrays are float32."""
    for name, value in values.items():
        if name not in target:
            continue
        if isinstance(value, np.ndarray):
            target[name].write(value.tobytes())
        else:
            target[name] = value
