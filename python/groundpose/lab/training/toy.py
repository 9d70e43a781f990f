"""Painted substitutes for vehicles: a source of crops that a small network learns in seconds.

A rotated rectangle in the colour of its class has one dot per keypoint. The picture is mirror-symmetric like
a vehicle: left and right partners have the same colour and are on opposite sides.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
from PIL import Image, ImageDraw

from groundpose._checks import FloatArray
from groundpose.keypoints.codec import Codec, cut
from groundpose.lab.drive import HIDDEN, OUTSIDE, SPLITS, VISIBLE
from groundpose.lab.training.crops import Sample, record
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS, flip_indices, keypoint_indices

IMAGE_SIZE = (200, 150)
_BODY = ((200, 60, 60), (60, 170, 70), (70, 90, 210), (190, 170, 60))


def toy_samples(seed: int, split: str, first: int, count: int, codec: Codec) -> Iterator[Sample]:
    """`count` frames with one vehicle each, from frame `first`."""
    for frame in range(first, first + count):
        image, box, class_name, points, state = toy_frame(seed, split, frame)
        window = codec.windows(box[None])[0]
        label = record(
            keypoints=points,
            state=state,
            class_name=class_name,
            box=box,
            window=window,
            image_size=IMAGE_SIZE,
            frame=frame,
            object=0,
        )
        yield Sample(cut(image, window, codec.width, codec.height), label)


def toy_frame(
    seed: int, split: str, frame: int
) -> tuple[np.ndarray, FloatArray, str, FloatArray, np.ndarray]:  # image, box, kind, keypoints, states
    """A painted image (H, W, 3), the box (4,) of its vehicle, its class, keypoints (P, 2) and states (P,)."""
    rng = np.random.default_rng([seed, SPLITS.index(split), frame])
    number = int(rng.integers(len(CLASSES)))
    class_name = CLASSES[number]
    rows = keypoint_indices(class_name)
    place = _template()[rows]
    size = rng.uniform(45, 90) * np.array([1.0, rng.uniform(0.55, 0.8)])
    turn, middle = rng.normal(0.0, 0.08), rng.uniform((15, 15), np.array(IMAGE_SIZE) - 15)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2 @ R.T + middle
    points = place * size / 2 @ R.T + middle
    picture = Image.fromarray(rng.integers(60, 200, (6, 8, 3), dtype=np.uint8)).resize(IMAGE_SIZE)
    draw = ImageDraw.Draw(picture)
    draw.polygon([tuple(c) for c in corners.tolist()], fill=_BODY[number])
    radius = 0.03 * size[0]
    for (x, y), colour in zip(points.tolist(), _colours()[rows].tolist(), strict=True):
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=tuple(colour))
    state = np.where(rng.random(len(rows)) < 0.2, HIDDEN, VISIBLE)
    limit = np.array(IMAGE_SIZE) - 0.5
    state[((points < -0.5) | (points > limit)).any(axis=1)] = OUTSIDE
    box = np.concatenate([np.maximum(corners.min(axis=0), -0.5), np.minimum(corners.max(axis=0), limit)])
    return np.asarray(picture), box, class_name, points, state


@cache
def _template() -> FloatArray:
    """Places (K, 2) from -1 to 1, mirrored for partners."""
    flip = flip_indices()
    places = np.zeros((len(KEYPOINTS), 2))
    rng = np.random.default_rng(53)
    for i, j in enumerate(flip):
        if i < j:
            places[i] = rng.uniform((-0.95, -0.9), (-0.15, 0.9))
            places[j] = places[i] * (-1.0, 1.0)
        elif i == j:
            places[i] = (0.0, rng.uniform(-0.8, 0.8))
    return places


@cache
def _colours() -> np.ndarray:
    """Colours (K, 3), equal for partners."""
    flip = flip_indices()
    colours = np.random.default_rng(54).integers(0, 256, (len(KEYPOINTS), 3))
    return colours[np.minimum(np.arange(len(flip)), flip)]
