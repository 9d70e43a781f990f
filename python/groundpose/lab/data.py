"""Real data: its folder, and the rotation of a labelled angle.

The files are test input and not part of this package. Their folder is given by `--data` or by the environment
variable GROUNDPOSE_DATA; the default is the folder `data`.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from groundpose._checks import FloatArray


def data_folder(given: Path | None = None) -> Path:
    """The folder of the real data. It need not exist."""
    return given or Path(os.environ.get("GROUNDPOSE_DATA", "data"))


def rotation_about_y(angle: npt.ArrayLike) -> FloatArray:
    """R_y of the conventions, (...) radians -> (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    rows = [[c, zero, s], [zero, one, zero], [-s, zero, c]]
    return np.asarray(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2))
