"""Crops without a vehicle, for the answer "none": scenery, things, pieces, empty places, patterns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.keypoints.codec import Codec
from groundpose.lab.drive import Scene
from groundpose.lab.training.crops import LABEL, Records, Sample
from groundpose.lab.training.nothing_boxes import (
    Choose,
    Place,
    View,
    anywhere,
    around_thing,
    detector_box,
    emptied,
    inside,
    on_the_road,
    piece,
)
from groundpose.lab.training.nothing_patterns import pattern
from groundpose.lab.training.records import record_of
from groundpose.lab.training.rendered import drawn_frames, renderer
from groundpose.vehicles.classes import CLASSES

NOTHING = len(CLASSES)
"""`kind` of a record without a vehicle."""
PER_FRAME = 6
"""Crops of each frame of `nothing_samples`."""
_PATTERN_IMAGE = (1280, 800)


@dataclass(frozen=True)
class Kind:
    """A row of `KINDS`: how often, and how its box is found; without `choose` a pattern is painted."""

    name: str
    fraction: float
    choose: Choose | None


KINDS = (
    Kind("anywhere", 0.20, anywhere),
    Kind("on the road", 0.15, on_the_road),
    Kind("thing", 0.20, around_thing),
    Kind("piece of a vehicle", 0.15, piece),
    Kind("empty place", 0.15, emptied),
    Kind("pattern", 0.15, None),
)
"""A frame without such a place gives a box anywhere, and one full of vehicles a pattern."""
_ANYWHERE, _PATTERN = 0, len(KINDS) - 1


def nothing_samples(seed: int, split: str, first: int, count: int, codec: Codec) -> Iterator[Sample]:
    """`PER_FRAME` crops without a vehicle of each of `count` frames."""
    for frame in drawn_frames(seed, split, first, count):
        yield from nothing_of(frame, PER_FRAME, codec)


def nothing_of(frame: Scene, count: int, codec: Codec) -> Iterator[Sample]:
    """`count` crops without a vehicle of one frame; they depend on the arguments alone."""
    if count < 1:
        return
    rng = np.random.default_rng([86, frame.seed, frame.number])
    view = View.of(frame)
    kinds = rng.choice(len(KINDS), size=count, p=[kind.fraction for kind in KINDS])
    # scenes with removed vehicles are prepared anew and come last
    for i, row in enumerate(sorted(kinds.tolist())):
        choose = KINDS[row].choose
        place = choose(rng, view) if choose else None
        if choose and place is None:
            row, place = _ANYWHERE, anywhere(rng, view)
        yield _painted(rng, frame, codec) if place is None else _drawn(place, row, i, codec)


def _drawn(place: Place, row: int, number: int, codec: Codec) -> Sample:
    scene, window = place.scene, codec.windows(place.box[None])[0]
    size = scene.camera.image_size
    assert size is not None
    image = renderer().window(
        scene, window, (codec.width, codec.height), (87, scene.seed, scene.number, number)
    )
    label = nothing_record(place.box, window, size, scene.number, row)
    return Sample(image, _with_camera(label, scene))


def _painted(rng: np.random.Generator, frame: Scene, codec: Codec) -> Sample:
    box = None
    size = np.array(_PATTERN_IMAGE, dtype=float)
    while box is None:
        box = inside(detector_box(rng, 0.5 * size), size)
    label = nothing_record(box, codec.windows(box[None])[0], _PATTERN_IMAGE, frame.number, _PATTERN)
    return Sample(pattern(rng, codec.width, codec.height), _with_camera(label, frame))


def nothing_record(
    box: FloatArray, window: FloatArray, image_size: tuple[int, int], frame: int, index: int
) -> Records:
    """A record of `LABEL` without a vehicle; its `object` is `-1 - index`, `index` a row of `KINDS`."""
    return record_of({
        **{"keypoints": np.nan, "kind": NOTHING, "box": box, "window": window, "image_size": image_size},
        **{"frame": frame, "object": -1 - index},
    })  # fmt: skip


def _with_camera(label: Records, scene: Scene) -> Records:
    if "camera" in (LABEL.names or ()):
        label["camera"] = scene.height, scene.pitch, scene.roll, scene.camera.fx
    return label
