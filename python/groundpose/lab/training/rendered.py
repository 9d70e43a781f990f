"""Crops of the virtual drive, drawn by the renderer (extra `[simulate]`)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from groundpose.keypoints.codec import Codec
from groundpose.lab.drive import Label, Scene, labels, scene, scene_seed
from groundpose.lab.training.crops import Sample, record

if TYPE_CHECKING:
    from groundpose.lab.drive.render import Renderer

SMALLEST = 18.0
"""Least height of a box, pixels; evaluations start at 25."""
MOST_HIDDEN, MOST_CUT = 0.8, 0.6
"""Largest fractions of a vehicle hidden by others and outside the image."""
FRAME_STEP = 4
"""One frame in this many is drawn, because successive frames are similar."""


def rendered_samples(seed: int, split: str, first: int, count: int, codec: Codec) -> Iterator[Sample]:
    """The vehicles used for training in `count` frames, every `FRAME_STEP`-th of the drives."""
    for frame in drawn_frames(seed, split, first, count):
        yield from vehicle_samples(frame, codec)


def drawn_frames(seed: int, split: str, first: int, count: int) -> Iterator[Scene]:
    """The `count` frames from the `first`-th of those that are drawn."""
    for number in range(first * FRAME_STEP, (first + count) * FRAME_STEP, FRAME_STEP):
        yield scene(scene_seed(seed, split), number)


def vehicle_samples(frame: Scene, codec: Codec) -> Iterator[Sample]:
    """The vehicles of a frame used for training."""
    assert frame.camera.image_size is not None
    for label in filter(_useful, labels(frame)):
        window = codec.windows(label.bbox[None])[0]
        image = renderer().crop(frame, label.index, window, (codec.width, codec.height))
        yield Sample(
            image,
            record(
                keypoints=label.keypoints_2d,
                state=label.keypoint_states,
                class_name=label.class_name,
                box=label.bbox,
                window=window,
                image_size=frame.camera.image_size,
                frame=frame.number,
                index=label.index,
                occluded=label.occluded_share,
            ),
        )


def _useful(label: Label) -> bool:
    height = label.bbox[3] - label.bbox[1]
    hidden, cut = label.occluded_share <= MOST_HIDDEN, label.truncation <= MOST_CUT
    # behind the camera a keypoint has no pixel
    return bool(height >= SMALLEST and hidden and cut and np.isfinite(label.keypoints_2d).all())


@cache
def renderer() -> Renderer:
    """The renderer of this process."""
    from groundpose.lab.drive.render import Renderer

    return Renderer()
