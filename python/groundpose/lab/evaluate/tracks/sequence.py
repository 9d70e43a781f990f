"""A sequence of frames with poses and truth: what trackers are given, and what they are judged by."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import groundpose as gp
from groundpose._checks import FloatArray


@dataclass(frozen=True, eq=False)
class Truth:
    """Of M vehicles of a frame, in the ground frame of the camera now."""

    id: NDArray[np.int64]
    """(M,) numbers of the vehicles."""
    place: FloatArray
    """(M, 2) metres, right and forward."""
    heading: FloatArray
    """(M,) radians."""
    size: FloatArray
    """(M, 3) metres, length, height, width."""
    bbox: FloatArray
    """(M, 4) px."""
    speed: FloatArray
    """(M,) m/s along the heading; NaN: not known."""


@dataclass(frozen=True, eq=False)
class SequenceFrame:
    """What is seen at a time."""

    time: float
    poses: gp.PoseBatch
    scores: FloatArray
    """(N,) of the detections."""
    vehicle: NDArray[np.int64]
    """(N,) which vehicle an object is; -1: none."""
    truth: Truth
    ego: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the camera is: metres in the world, and its direction."""


@dataclass(frozen=True, eq=False)
class Sequence:
    """Frames of one camera in order."""

    name: str
    view: gp.View
    frames: list[SequenceFrame] = field(default_factory=list)
    camera_motion: str = "static"
