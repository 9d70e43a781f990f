"""Real data, which is test input and not part of this package: where it is, and how its labels turn."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt


def data_folder(given: Path | None = None) -> Path:
    """The folder given, or the environment variable GROUNDPOSE_DATA, or `data`. It need not exist."""
    return given or Path(os.environ.get("GROUNDPOSE_DATA", "data"))


def rotation_about_y(angle: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """R_y of the conventions, (...) radians -> (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    rows = [[c, zero, s], [zero, one, zero], [-s, zero, c]]
    return np.asarray(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2))
