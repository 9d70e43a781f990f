"""Which OpenGL draws: a graphics card's, or software.

EGL reads its environment when its library is loaded, so the choice is made once per process, before the
context. Processes started later inherit it.
"""

from __future__ import annotations

import ctypes.util
import json
import os
from collections.abc import Mapping
from pathlib import Path

from groundpose._checks import input_error
from groundpose._writing import write_text
from groundpose.lab.drive import cache

DEVICES = ("auto", "cpu", "cuda")
VARIABLE = "GROUNDPOSE_RENDERER"
"""Environment variable that holds the choice, one of `DEVICES`."""
_VENDORS = "__EGL_VENDOR_LIBRARY_FILENAMES"
_FOLDERS = (Path("/etc/glvnd/egl_vendor.d"), Path("/usr/share/glvnd/egl_vendor.d"))
_SOFTWARE = ("llvmpipe", "softpipe", "swrast")
_NO_CARD = (
    "--device cuda: {reason}. NVIDIA's driver must come with its OpenGL (libEGL_nvidia.so.0; in a container "
    "NVIDIA_DRIVER_CAPABILITIES=all) and the loaders (`apt-get install libegl1 libopengl0 libgl1`)"
)


def choose(device: str) -> None:
    """Choose the device of this process and of those it starts. Raises InputError for an unknown one."""
    if device not in DEVICES:
        raise input_error("device", f"one of {', '.join(DEVICES)}", repr(device))
    os.environ[VARIABLE] = device


def chosen() -> str:
    """The device chosen; "auto" unless said otherwise."""
    return os.environ.get(VARIABLE, "auto")


def prepare() -> None:
    """Set the environment of EGL for the device chosen.

    Raises:
        RuntimeError: "cuda" without NVIDIA's OpenGL; the text says what to install.
    """
    nvidia = None if chosen() == "cpu" else _nvidia_vendor()
    if chosen() == "cuda" and nvidia is None:
        raise RuntimeError(_NO_CARD.format(reason="NVIDIA's OpenGL was not found"))
    os.environ.update(_settings(chosen(), nvidia, _vendor("*mesa*.json"), os.environ))


def check(renderer: str) -> None:
    """Raise RuntimeError when "cuda" was chosen and software draws (`renderer`: OpenGL's GL_RENDERER)."""
    if chosen() == "cuda" and is_software(renderer):
        raise RuntimeError(_NO_CARD.format(reason=f"{renderer} draws in software"))


def is_software(renderer: str) -> bool:
    """Whether this GL_RENDERER draws on the processor."""
    return renderer.lower().startswith(_SOFTWARE)


def _settings(device: str, nvidia: Path | None, mesa: Path | None, now: Mapping[str, str]) -> dict[str, str]:
    """The variables to set; a vendor that the user named stays."""
    if device == "cpu":
        return {"LIBGL_ALWAYS_SOFTWARE": "1", **({_VENDORS: str(mesa)} if mesa else {})}
    if nvidia is None or _VENDORS in now:
        return {}
    return {_VENDORS: str(nvidia)}


def _nvidia_vendor() -> Path | None:
    """NVIDIA's vendor file, written when there are a card and a library without one; None without a card."""
    if not Path("/dev/nvidiactl").exists():
        return None
    found = _vendor("*nvidia*.json")
    if found is None and ctypes.util.find_library("EGL_nvidia"):
        found = cache.folder() / "egl" / "10_nvidia.json"
        found.parent.mkdir(parents=True, exist_ok=True)
        icd = {"file_format_version": "1.0.0", "ICD": {"library_path": "libEGL_nvidia.so.0"}}
        write_text(found, json.dumps(icd))
    return found


def _vendor(pattern: str) -> Path | None:
    return next((file for folder in _FOLDERS for file in sorted(folder.glob(pattern))), None)
