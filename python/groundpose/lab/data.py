"""Real data: where it lies, and the rotation that a labelled angle means.

The files are test input and not part of this package: they are found through `--data` or the environment
variable GROUNDPOSE_DATA; without either they are looked for in the folder `data`.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from groundpose._checks import FloatArray


def data_folder(given: Path | None = None) -> Path:
    """Where the real data is looked for. It need not exist."""
    return given or Path(os.environ.get("GROUNDPOSE_DATA", "data"))


def rotation_about_y(angle: npt.ArrayLike) -> FloatArray:
    """R_y of the conventions, (...) radians -> (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    rows = [[c, zero, s], [zero, one, zero], [-s, zero, c]]
    return np.asarray(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2))
