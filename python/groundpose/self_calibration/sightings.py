"""What was seen of vehicles over time by a camera that stands still."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error
from groundpose.shape import ShapeModel
from groundpose.types import Camera


@dataclass(frozen=True, eq=False)
class Sightings:
    """N sightings of vehicles, in the order of time.

    Args:
        camera: the camera; its focal length may be a guess.
        keypoints_2d: N arrays (P_i, 2), pixels, NaN: not seen.
        keypoint_scores: N arrays (P_i,).
        bboxes: (N, 4) pixels.
        models: N shape models.
        vehicles: (N,) number of the vehicle; the same vehicle has one in all frames.
        times: (N,) seconds or numbers of frames.

    Raises:
        InputError: not one of each for each sighting.
    """

    camera: Camera
    keypoints_2d: tuple[FloatArray, ...]
    keypoint_scores: tuple[FloatArray, ...]
    bboxes: FloatArray
    models: tuple[ShapeModel, ...]
    vehicles: NDArray[np.int64]
    times: FloatArray

    def __post_init__(self) -> None:
        """Check the lengths."""
        for name in ("keypoint_scores", "bboxes", "models", "vehicles", "times"):
            if len(getattr(self, name)) != len(self.keypoints_2d):
                got = len(getattr(self, name))
                raise input_error(name, f"{len(self.keypoints_2d)}, one per object of keypoints_2d", got)

    def __len__(self) -> int:
        """N."""
        return len(self.keypoints_2d)

    def __getitem__(self, rows: NDArray[Any]) -> Sightings:
        """Some of them, by a mask or numbers."""
        kept = np.arange(len(self))[rows]
        return Sightings(
            self.camera,
            tuple(self.keypoints_2d[i] for i in kept),
            tuple(self.keypoint_scores[i] for i in kept),
            self.bboxes[kept],
            tuple(self.models[i] for i in kept),
            self.vehicles[kept],
            self.times[kept],
        )

    def seen_by(self, camera: Camera) -> Sightings:
        """The same with another camera."""
        return replace(self, camera=camera)
