"""Where training runs: a CPU or a GPU of CUDA, and where the crops lie meanwhile."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from groundpose._checks import input_error
from groundpose.lab.drive.render.device import DEVICES
from groundpose.lab.training.crops import Crops

_LOADED = 1000  # crops copied to the device at a time


def device(name: str) -> torch.device:
    """The device of a name in `DEVICES`; "auto": a GPU where there is one.

    Raises:
        InputError: an unknown name; "cuda" without a GPU or without PyTorch's support of it.
    """
    if name not in DEVICES:
        raise input_error("device", f"one of {', '.join(DEVICES)}", repr(name))
    if name == "cuda" and not torch.cuda.is_available():
        raise input_error("device", "a GPU that PyTorch can use (torch.cuda.is_available())", "none")
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(name)


def has_bf16(where: torch.device) -> bool:
    """Whether the device multiplies bfloat16; emulation would be slower than float32."""
    if where.type != "cpu":
        return torch.cuda.is_bf16_supported()
    try:
        return "avx512_bf16" in Path("/proc/cpuinfo").read_text()
    except OSError:
        return False


def finish(where: torch.device) -> None:
    """Wait until the device has done what it was given, so that a clock is right."""
    if where.type == "cuda":
        torch.cuda.synchronize(where)


class Pictures(Protocol):
    """Stored pictures by index, bytes (n, 3, height, width)."""

    def __call__(self, indices: NDArray[np.intp]) -> Tensor:
        """The pictures of these crops."""


def pictures_on(where: torch.device, crops: Crops) -> Pictures:
    """The pictures of crops: read from disk for a CPU; copied to a GPU's memory once, if they fit in it."""
    if where.type == "cpu" or not _fits(where, crops):
        return lambda indices: torch.from_numpy(crops.take(indices)[0])
    codec = crops.codec
    stored = torch.empty(len(crops), 3, codec.height, codec.width, dtype=torch.uint8, device=where)
    for first in range(0, len(crops), _LOADED):
        rows = np.arange(first, min(first + _LOADED, len(crops)))
        stored[first : first + _LOADED] = torch.from_numpy(crops.take(rows)[0]).to(where)
    return lambda indices: stored[torch.from_numpy(indices).to(where)]


def _fits(where: torch.device, crops: Crops) -> bool:
    """Half of the free memory is left to the network."""
    free, _ = torch.cuda.mem_get_info(where)
    return 2 * len(crops) * 3 * crops.codec.height * crops.codec.width < free


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
