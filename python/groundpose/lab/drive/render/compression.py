"""Compression of pictures: JPEG, and blocks of a video smoothed by its decoder."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image as Pillow

from groundpose.lab.drive.render.filters import Image
from groundpose.lab.drive.render.shot import Shot

# Pixels of the frame after which the blocks of a JPEG with reduced colour repeat; those of its brightness.
_CELL, _BLOCK = 16, 8


def untouched(picture: Image, shot: Shot) -> Image:
    """A picture straight from the sensor."""
    return picture


def good_jpeg(picture: Image, shot: Shot) -> Image:
    """Pictures stored one by one."""
    return _jpeg(picture, shot, int(shot.rng.integers(55, 97)), int(shot.rng.choice([0, 2, 2])))


def poor_jpeg(picture: Image, shot: Shot) -> Image:
    """Pictures of a web camera or a messenger."""
    return _jpeg(picture, shot, int(shot.rng.integers(18, 55)), 2)


def video(picture: Image, shot: Shot) -> Image:
    """A stream of few bits per pixel, smoothed over its blocks' edges, often at a lower resolution and then
    compressed again."""
    height, width = picture.shape[:2]
    factor, quality = shot.rng.choice([1.0, 1.0, 1.0, 0.75, 0.6]), int(shot.rng.integers(20, 55))
    size = max(_BLOCK, round(width * factor)), max(_BLOCK, round(height * factor))
    small = Pillow.fromarray(picture).resize(size, Pillow.Resampling.BILINEAR)
    streamed = _deblocked(_jpeg(np.asarray(small), shot, quality, 2), shot)
    back = np.asarray(Pillow.fromarray(streamed).resize((width, height), Pillow.Resampling.BICUBIC))
    return good_jpeg(back, shot) if shot.rng.random() < 0.5 else back


# Probability and function.
COMPRESSIONS = ((0.22, untouched), (0.42, good_jpeg), (0.16, poor_jpeg), (0.20, video))


def compress(picture: Image, shot: Shot) -> Image:
    """One of COMPRESSIONS."""
    return COMPRESSIONS[shot.rng.choice(len(COMPRESSIONS), p=[p for p, _ in COMPRESSIONS])][1](picture, shot)


def _jpeg(picture: Image, shot: Shot, quality: int, sampling: int) -> Image:
    """Encoded and decoded; blocks lie on the grid of the frame.

    Where less than the frame's pixels is drawn, its blocks are smaller than those here, so they lose less.
    """
    quality = round(100 - (100 - quality) * min(shot.scale, 1.0))
    left, top = shot.corner(_CELL)
    placed = np.pad(picture, ((top, 0), (left, 0), (0, 0)), mode="edge")
    with io.BytesIO() as file:
        Pillow.fromarray(placed).save(file, "JPEG", quality=quality, subsampling=sampling)
        return np.array(Pillow.open(file))[top:, left:]


def _deblocked(picture: Image, shot: Shot) -> Image:
    """The two pixels on either side of a block's edge drawn together, as a video decoder does."""
    x = picture.astype(np.float32)
    for first in shot.corner(_BLOCK):
        x = x.transpose(1, 0, 2)  # columns, then rows
        after = np.arange(_BLOCK - first, len(x) - 1, _BLOCK)
        after = after[after >= 2]
        p1, p0, q0, q1 = (x[after + k] for k in (-2, -1, 0, 1))
        x[after - 2], x[after - 1] = 0.75 * p1 + 0.25 * q0, 0.375 * p1 + 0.375 * p0 + 0.25 * q0
        x[after], x[after + 1] = 0.375 * q1 + 0.375 * q0 + 0.25 * p0, 0.75 * q1 + 0.25 * p0
    return np.asarray((x + 0.5).astype(np.uint8))
