"""Crops of the virtual drive, drawn by the renderer (extra `[simulate]`)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from groundpose.keypoints.codec import Codec
from groundpose.lab.bodies import STYLE_NAMES
from groundpose.lab.drive import Label, Scene, labels, scene, scene_seed
from groundpose.lab.drive.rigs import RIGS, Rigs
from groundpose.lab.training.crops import Sample, record

if TYPE_CHECKING:
    from groundpose.lab.drive.render import Renderer

SMALLEST = 18.0
"""Least height of a box, pixels; evaluations start at 25."""
MOST_HIDDEN, MOST_CUT = 0.8, 0.6
"""Largest fractions of a vehicle hidden by others and outside the image."""
FRAME_STEP = 2
"""One frame in this many is drawn, because successive frames are similar."""
MIXED = RIGS["mixed"]


def drawn_frames(
    seed: int, split: str, first: int, count: int, rigs: Rigs, step: int = FRAME_STEP
) -> Iterator[Scene]:
    """The `count` frames from the `first`-th of those that are drawn, one in `step`."""
    for number in range(first * step, (first + count) * step, step):
        yield scene(scene_seed(seed, split), number, rigs=rigs)


def vehicle_samples(frame: Scene, codec: Codec) -> Iterator[Sample]:
    """The vehicles of a frame used for training."""
    return (vehicle_sample(frame, label, codec) for label in labels(frame) if _useful(label))


def vehicle_sample(frame: Scene, label: Label, codec: Codec) -> Sample:
    """The crop of a labelled vehicle of a frame, drawn, and its record."""
    assert frame.camera.image_size is not None
    window = codec.windows(label.bbox[None])[0]
    return Sample(
        renderer().crop(frame, label.index, window, (codec.width, codec.height)),
        record(
            keypoints=label.keypoints_2d,
            state=label.keypoint_states,
            class_name=label.class_name,
            box=label.bbox,
            window=window,
            image_size=frame.camera.image_size,
            frame=frame.number,
            object=label.index,
            occluded=label.occluded_share,
            truncation=label.truncation,
            alpha=label.alpha,
            size=label.size,
            style=STYLE_NAMES.index(label.style),
            camera=(frame.height, frame.pitch, frame.roll, frame.camera.fx),
        ),
    )


def _useful(label: Label) -> bool:
    height = label.bbox[3] - label.bbox[1]
    hidden, cut = label.occluded_share <= MOST_HIDDEN, label.truncation <= MOST_CUT
    # behind the camera a keypoint has no pixel
    return bool(height >= SMALLEST and hidden and cut and np.isfinite(label.keypoints_2d).all())


@cache
def renderer() -> Renderer:
    """The renderer of this process; crops are drawn by several processes, so each uses one thread."""
    os.environ.setdefault("LP_NUM_THREADS", "1")
    from groundpose.lab.drive.render import Renderer

    return Renderer()
