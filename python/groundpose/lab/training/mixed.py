"""Crops of the virtual drive for training: its vehicles, and places without one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from groundpose.keypoints.codec import Codec
from groundpose.lab.training.crops import Sample
from groundpose.lab.training.nothing import nothing_of
from groundpose.lab.training.rendered import drawn_frames, vehicle_samples

NOTHING_PER_VEHICLE = 0.25
"""Crops without a vehicle for each crop of one."""


def drive_samples(seed: int, split: str, first: int, count: int, codec: Codec) -> Iterator[Sample]:
    """The vehicles of `rendered_samples` and, of the same frames, places without one."""
    for frame in drawn_frames(seed, split, first, count):
        vehicles = 0
        for sample in vehicle_samples(frame, codec):
            yield sample
            vehicles += 1
        spare = np.random.default_rng([88, frame.seed, frame.number]).random()
        # a frame without vehicles shows scenery at its best
        yield from nothing_of(frame, int(NOTHING_PER_VEHICLE * max(vehicles, 1) + spare), codec)
