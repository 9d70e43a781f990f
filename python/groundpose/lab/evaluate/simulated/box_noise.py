"""Errors of a detector's 2D boxes, drawn as measured on KITTI.

A side is off by `shift + slope l + hypot(pixels, fraction l) z` pixels, l the longer side of the true box and
z a Student t variable: the four sides of an object share its heavy tail and are correlated. Sides cut by the
image border have a scale of their own. `groundpose evaluate detector` fits the numbers to
2923 boxes of a real detector.

Left out: vehicles the detector misses (8 to 28 % by occlusion) and boxes with an overlap below one half. The
pixels are those of KITTI's images (1242 wide): what is a fraction of l carries over to other cameras, the
pixels are taken as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from groundpose.lab.contenders.objects import Array

SIDES = ("left", "top", "right", "bottom")
BORDER_PX = 1.5
"""A side of the true box this near to the image border is cut by it."""
LEAST_PX = 4.0
"""Smallest width and height of a box that is drawn."""
STREAM = 1
"""Sets the random numbers of boxes apart from those of keypoints of the same seed."""


@dataclass(frozen=True)
class SideNoise:
    """Error of one side; positive = to the right or downwards."""

    shift: float
    """px"""
    slope: float
    """fraction of l"""
    pixels: float
    fraction: float
    """of l"""

    def mean(self, longer: Array) -> Array:
        """(N,) px."""
        return self.shift + self.slope * longer

    def scale(self, longer: Array) -> Array:
        """(N,) px, of the t distribution."""
        return np.hypot(self.pixels, self.fraction * longer)


@dataclass(frozen=True)
class BoxNoise:
    """Errors of the boxes at one level of occlusion."""

    sides: tuple[SideNoise, SideNoise, SideNoise, SideNoise]
    """left, top, right, bottom"""
    degrees_of_freedom: float
    correlation: tuple[float, ...]
    """left-top, left-right, left-bottom, top-right, top-bottom, right-bottom"""

    def matrix(self) -> Array:
        """The correlation (4, 4)."""
        upper = np.zeros((4, 4))
        upper[np.triu_indices(4, 1)] = self.correlation
        return np.asarray(np.eye(4) + upper + upper.T)


BY_OCCLUSION = (
    BoxNoise(
        (
            SideNoise(-1.57, +0.0136, 0.34, 0.0248),
            SideNoise(-0.55, +0.0025, 0.62, 0.0090),
            SideNoise(-0.86, -0.0067, 0.61, 0.0178),
            SideNoise(-0.54, -0.0035, 0.57, 0.0149),
        ),
        5.4,
        (0.05, 0.11, 0.06, 0.02, 0.34, 0.11),
    ),
    BoxNoise(
        (
            SideNoise(-0.83, -0.0040, 0.61, 0.0365),
            SideNoise(-0.36, -0.0012, 0.71, 0.0104),
            SideNoise(-0.51, -0.0098, 1.03, 0.0239),
            SideNoise(-0.92, +0.0017, 0.83, 0.0154),
        ),
        4.8,
        (0.13, 0.06, -0.11, 0.15, 0.14, -0.07),
    ),
    BoxNoise(
        (
            SideNoise(-0.93, +0.0143, 2.03, 0.0408),
            SideNoise(-0.83, +0.0101, 0.73, 0.0119),
            SideNoise(-1.55, +0.0104, 0.00, 0.0691),
            SideNoise(-0.96, +0.0035, 1.25, 0.0114),
        ),
        2.7,
        (-0.01, 0.18, 0.02, 0.15, 0.18, 0.36),
    ),
)
"""By KITTI's occlusion: fully visible, partly, largely (and more)."""
BORDER = (0.009, 0.007, 0.020, 0.007)
"""Scale of sides cut by the image border, fraction of l; the top's (never cut there) is the bottom's."""


def draw_boxes(
    bboxes: Array, occlusion: npt.NDArray[np.int64], image_size: tuple[int, int], seed: int
) -> Array:
    """Boxes (N, 4) as a detector gives them, inside the image.

    Args:
        bboxes: (N, 4) true boxes clipped to the image, px.
        occlusion: (N,) KITTI's level, 0 upwards.
        image_size: width, height, px.
        seed: the box of object k depends on it, on k and on the boxes up to k only.
    """
    level = np.minimum(occlusion, len(BY_OCCLUSION) - 1)
    longer = (bboxes[:, 2:] - bboxes[:, :2]).max(axis=1)
    normal, tail = (
        np.random.Generator(np.random.PCG64(s)) for s in np.random.SeedSequence((seed, STREAM)).spawn(2)
    )
    freedom = np.array([noise.degrees_of_freedom for noise in BY_OCCLUSION])[level]
    roots = np.stack([np.linalg.cholesky(noise.matrix()) for noise in BY_OCCLUSION])[level]
    z = np.einsum("nij,nj->ni", roots, normal.standard_normal((len(bboxes), 4)))
    z /= np.sqrt(tail.chisquare(freedom) / freedom)[:, None]
    error = np.stack([_errors(noise, longer, z) for noise in BY_OCCLUSION])[level, np.arange(len(level))]
    cut = at_border(bboxes, image_size)
    drawn = bboxes + np.where(cut, longer[:, None] * BORDER * z, error)
    centre, half = (drawn[:, :2] + drawn[:, 2:]) / 2, np.abs(drawn[:, 2:] - drawn[:, :2]) / 2
    half = np.maximum(half, LEAST_PX / 2)  # a side beyond its opposite one: tails are heavy
    limit = np.array([*image_size, *image_size]) - 1.0
    inside: Array = np.clip(np.concatenate([centre - half, centre + half], axis=1), 0.0, limit)
    return inside


def at_border(bboxes: Array, image_size: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """(N, 4) whether a side is cut by the image border."""
    limit = np.array(image_size) - 1.0
    return np.concatenate([bboxes[:, :2] <= BORDER_PX, bboxes[:, 2:] >= limit - BORDER_PX], axis=1)


def _errors(noise: BoxNoise, longer: Array, z: Array) -> Array:
    """(N, 4) px at one level of occlusion."""
    return np.stack([s.mean(longer) + s.scale(longer) * z[:, k] for k, s in enumerate(noise.sides)], axis=1)
