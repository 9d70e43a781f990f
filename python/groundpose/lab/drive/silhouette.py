"""Outlines of solids in the image, to compute quickly which fraction of a solid others hide.

A solid is cut into slabs. Each slab is replaced by its convex hull, and the hull by its extreme points in
fixed directions. The outline of the solid is the union of the slabs' outlines, so bonnet and cabin, cab and
cargo bed, trunk and crown stay separate. `tests/python/test_simulation_labels.py` compares outline and mesh.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from groundpose._checks import FloatArray
from groundpose.types import Camera

NEAR = 0.3
"""Distance of the near plane before the camera, metres."""

_CANVAS = 96  # pixels of the longer side of an object's region


def _sphere(count: int) -> FloatArray:
    """Directions (count, 3) spread evenly (Fibonacci lattice)."""
    i = np.arange(count) + 0.5
    y, turn = 1.0 - 2.0 * i / count, np.pi * (1.0 + 5.0**0.5) * i
    r = np.sqrt(1.0 - y**2)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)


_DIRECTIONS = _sphere(60)
_TURNS = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
_AROUND = np.stack([np.cos(_TURNS), np.sin(_TURNS)])


def slabs(vertices: FloatArray, faces: NDArray[np.integer], axis: int, count: int) -> FloatArray:
    """(K, M, 3) points of at most `count` slabs across `axis`, for `outline`; vertices need a face."""
    used, faces = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], faces.reshape(-1, 3)
    along = vertices[:, axis]
    cuts = np.linspace(along.min(), along.max(), count + 1)
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = edges[along[edges[:, 0]] < along[edges[:, 1]]]  # closed meshes have each edge in both directions
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    found = []
    for low, high in itertools.pairwise(cuts.tolist()):
        inside = vertices[(along >= low - 1e-9) & (along <= high + 1e-9)]
        points = np.concatenate([inside, _crossings(a, b, axis, low), _crossings(a, b, axis, high)])
        if len(points):
            found.append(points[(points @ _DIRECTIONS.T).argmax(axis=0)])
    return np.stack(found)


def _crossings(a: FloatArray, b: FloatArray, axis: int, level: float) -> FloatArray:
    """Points where segments a to b meet the plane at `level`."""
    below, above = a[:, axis] - level, b[:, axis] - level
    cross = below * above < 0.0
    fraction = (below[cross] / (below[cross] - above[cross]))[:, None]
    return np.asarray(a[cross] + fraction * (b[cross] - a[cross]))


def outline(camera: Camera, points: FloatArray) -> FloatArray:
    """Convex polygons (K, 32, 2), pixels, that cover slabs of points (K, M, 3) of the camera frame.

    Slabs behind the near plane are omitted; those that cross it are cut.
    """
    behind = points[..., 2] < NEAR
    if behind.any():
        cut = [_before(slab) for slab in points[~behind.all(axis=1)]]
        if not cut:
            return np.empty((0, len(_TURNS), 2))
        width = max(len(slab) for slab in cut)
        points = np.stack([np.concatenate([s, np.repeat(s[:1], width - len(s), axis=0)]) for s in cut])
    pixels = camera.project(points)
    extreme = (pixels @ _AROUND).argmax(axis=1)
    return np.take_along_axis(pixels, extreme[..., None], axis=1)


def _before(points: FloatArray) -> FloatArray:
    """The part of a convex set before the near plane: its points and the chords' points in the plane."""
    front = points[:, 2] >= NEAR
    a, b = points[front][:, None], points[~front][None]
    if a.size == 0 or b.size == 0:
        return points[front]
    fraction = (a[..., 2:] - NEAR) / (a[..., 2:] - b[..., 2:])
    return np.concatenate([points[front], (a + fraction * (b - a)).reshape(-1, 3)])


def inside(polygons: FloatArray, pixels: FloatArray) -> NDArray[np.bool_]:
    """(N,) whether pixels (N, 2) lie in one of the convex polygons (K, C, 2) of `outline`."""
    side = np.roll(polygons, -1, axis=1) - polygons
    offset = pixels[:, None, None] - polygons
    turn = side[..., 0] * offset[..., 1] - side[..., 1] * offset[..., 0]
    every: NDArray[np.bool_] = np.all(turn >= -1e-9, axis=2)
    return np.asarray(np.any(every, axis=1))


def below(roll: float, u: FloatArray, v: FloatArray) -> FloatArray:
    """Rows of pixels at columns `u`, rows `v` in the image turned level about its origin: a horizon of the
    roll (radians) has one row."""
    return np.asarray(math.cos(roll) * v - math.sin(roll) * u)


@dataclass(frozen=True)
class Region:
    """A part of the image at reduced scale."""

    left: float
    top: float
    scale: float
    width: int
    height: int

    @classmethod
    def around(cls, box: FloatArray) -> Region:
        """The region of a box (4,) `left, top, right, bottom`."""
        width, height = max(box[2] - box[0], 1e-3), max(box[3] - box[1], 1e-3)
        scale = _CANVAS / max(width, height)
        return cls(
            float(box[0]), float(box[1]), scale, int(np.ceil(width * scale)), int(np.ceil(height * scale))
        )

    def mask(self, polygons: FloatArray) -> NDArray[np.bool_]:
        """(height, width) mask of what the polygons cover."""
        canvas = Image.new("L", (self.width, self.height))
        draw = ImageDraw.Draw(canvas)
        # a pixel's centre is half a pixel from its corner
        placed = (polygons - (self.left, self.top)) * self.scale - 0.5
        for polygon in np.clip(placed, -4096.0, 4096.0):
            draw.polygon(polygon.ravel().tolist(), fill=1)
        return np.asarray(canvas, dtype=bool)

    def below(self, row: float, roll: float) -> NDArray[np.bool_]:
        """(height, width) mask of everything below a row of the level image."""
        rows = np.asarray(self.top + (np.arange(self.height) + 0.5) / self.scale, np.float64)
        columns = np.asarray(self.left + (np.arange(self.width) + 0.5) / self.scale, np.float64)
        return np.asarray(below(roll, columns, rows[:, None]) > row)
