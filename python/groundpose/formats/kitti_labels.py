"""KITTI's object labels and calibration files: `label_2/NNNNNN.txt` and `calib/NNNNNN.txt`.

One line an object: type, truncated, occluded, alpha, bbox (4), height, width, length, x, y, z of the bottom
centre, rotation_y; metres, radians, camera frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from groundpose._checks import input_error
from groundpose.types import Camera

_NUMBERS = 14


@dataclass(frozen=True)
class KittiLabel:
    """One line. `type` is KITTI's class ("Car", "Van", "Truck" ...), `occluded` its level 0 to 3."""

    type: str
    truncated: float
    occluded: int
    alpha: float
    bbox: tuple[float, float, float, float]
    height: float
    width: float
    length: float
    location: tuple[float, float, float]
    rotation_y: float


def format_labels(labels: Iterable[KittiLabel]) -> str:
    """The text of a label file."""
    return "".join(_line(label) for label in labels)


def _line(label: KittiLabel) -> str:
    size = (label.height, label.width, label.length)
    numbers = (label.alpha, *label.bbox, *size, *label.location, label.rotation_y)
    text = " ".join(f"{value:.4f}" for value in numbers)
    return f"{label.type} {label.truncated:.2f} {label.occluded} {text}\n"


def read_labels(path: str | PathLike[str]) -> list[KittiLabel]:
    """The labels of a file. Raises OSError (no such file), InputError naming the line that is none."""
    found = []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), 1):
        name, *values = line.split() or [""]
        try:
            n = [float(x) for x in values]
        except ValueError:
            n = []
        if len(n) != _NUMBERS:
            raise input_error(f"{path}:{number}", f"a type and {_NUMBERS} numbers", repr(line))
        box, place = (n[3], n[4], n[5], n[6]), (n[10], n[11], n[12])
        found.append(KittiLabel(name, n[0], int(n[1]), n[2], box, n[7], n[8], n[9], place, n[13]))
    return found


def format_calibration(camera: Camera) -> str:
    """A calibration file for one camera: P0 to P3 are the same, the laser scanner stands where it does."""
    P = np.hstack([camera.K, np.zeros((3, 1))])
    # KITTI's scanner frame: x forward, y left, z up
    scanner = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    rows = {
        **{f"P{i}": P for i in range(4)},
        "R0_rect": np.eye(3),
        "Tr_velo_to_cam": scanner,
        "Tr_imu_to_velo": np.eye(3, 4),
    }
    return "".join(f"{name}: {' '.join(f'{x:.12e}' for x in a.ravel())}\n" for name, a in rows.items())
