"""Crops of the virtual drive for training: its vehicles, and places without one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from groundpose.keypoints.codec import Codec
from groundpose.lab import bodies, drive
from groundpose.lab.drive.cache import fingerprint
from groundpose.lab.drive.rigs import RIGS
from groundpose.lab.training import nothing, nothing_boxes, nothing_patterns, rendered
from groundpose.lab.training.crops import Sample

NOTHING_PER_VEHICLE = 0.25
"""Crops without a vehicle for each crop of one."""
# What decides what a crop shows.
_SOURCES = (
    Path(bodies.__file__).parent,
    Path(drive.__file__).parent,
    Path(__file__),
    *(Path(str(module.__file__)) for module in (nothing, nothing_boxes, nothing_patterns, rendered)),
)


@cache
def drive_version() -> str:
    """16 hex digits that change with the sources and pictures of the drive and its bodies."""
    return fingerprint(_SOURCES)


@dataclass(frozen=True)
class DriveSamples:
    """Vehicles as cameras see them and, of the same frames, places without one.

    Folders of crops keep this text of the source, so one made with other rigs, frames or another version of
    the drive is not continued.

    Args:
        rigs: one of `groundpose.lab.drive.RIGS`.
        nothing: crops of places without a vehicle for each of a vehicle.
        frame_step: one frame of the drive in this many is drawn.
        drive: the version that draws.
    """

    rigs: str = "mixed"
    nothing: float = NOTHING_PER_VEHICLE
    frame_step: int = rendered.FRAME_STEP
    drive: str = field(default_factory=drive_version)

    def __call__(self, seed: int, split: str, first: int, count: int, codec: Codec) -> Iterator[Sample]:
        """Crops of `count` drawn frames from number `first`."""
        for frame in rendered.drawn_frames(seed, split, first, count, RIGS[self.rigs], self.frame_step):
            vehicles = 0
            for sample in rendered.vehicle_samples(frame, codec):
                yield sample
                vehicles += 1
            if self.nothing > 0.0:
                spare = np.random.default_rng([88, frame.seed, frame.number]).random()
                # a frame without vehicles shows scenery at its best
                yield from nothing.nothing_of(frame, int(self.nothing * max(vehicles, 1) + spare), codec)
