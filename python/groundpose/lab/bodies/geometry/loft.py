"""Surfaces made from rows of points: grids, shells with a mirror plane, closed tubes, lathes.

The normal of a grid of points `[i, j]` made by `grid_faces` is d/di x d/dj. The right half of a body (x
right, y down, z forward) is given as stations i from front to rear and lines j from the bottom up: its
outward normal is d/dj x d/di, so `half_shell` and the slabs reverse the faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.mesh import CREASE_DEG, ByteArray, Component, IntArray, component


@lru_cache(maxsize=256)
def grid_faces(rows: int, columns: int) -> IntArray:
    """Triangles (2 (rows - 1) (columns - 1), 3) of a grid of points in row-major order, two per cell."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    b, c, d = a + columns, a + columns + 1, a + 1
    faces: IntArray = (
        np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3).astype(np.int32)
    )
    faces.setflags(write=False)  # shared by all grids of this size
    return faces


def cells(material: object, rows: int, columns: int) -> ByteArray:
    """Material per triangle from one index or an array (rows - 1, columns - 1), one per cell."""
    table = np.broadcast_to(np.asarray(material, dtype=np.uint8), (rows - 1, columns - 1))
    return np.repeat(table.ravel(), 2)


def half_shell(points: FloatArray, material: object, crease_deg: float = CREASE_DEG) -> Component:
    """A closed body with the mirror plane x = 0 from its right half.

    Args:
        points: (N, M, 3) stations i from front to rear, each a line j from the bottom up. The whole border
            (first and last station, first and last point of every station) must lie on x = 0; the function
            sets it so. Stations and lines may collapse to a point.
        material: index, or (N - 1, M - 1) indices of the cells.
    """
    half = np.array(points, dtype=np.float64)
    half[[0, -1], :, 0] = 0.0
    half[:, [0, -1], 0] = 0.0
    rows, columns = half.shape[:2]
    faces = grid_faces(rows, columns)
    right = half.reshape(-1, 3)
    left = right * [-1.0, 1.0, 1.0]
    both = np.concatenate([faces[:, ::-1], faces + len(right)])
    paint = np.tile(cells(material, rows, columns), 2)
    return component(np.concatenate([right, left]), both, paint, crease_deg)


def tube(
    sections: FloatArray, material: object, crease_deg: float = CREASE_DEG, closed: bool = False
) -> Component:
    """Closed rings of points joined one after the other.

    Args:
        sections: (N, M, 3) rings; seen along the direction of travel (from ring 0 to ring N - 1) each ring
            runs clockwise when x is right and y is down (x towards y), the right-hand sense about the travel.
        material: index, or (N - 1, M) indices of the cells; caps take that of the ring next to them.
        closed: the last ring is joined to the first (a torus); otherwise flat caps close the ends.
    """
    rings = np.asarray(sections, dtype=np.float64)
    if closed:
        rings = np.concatenate([rings, rings[:1]])
    n, m = rings.shape[:2]
    wrapped = np.concatenate([rings, rings[:, :1]], axis=1)
    faces = grid_faces(n, m + 1)[:, ::-1]
    paint = cells(material, n, m + 1)
    points = wrapped.reshape(-1, 3)
    if closed:
        return component(points, faces, paint, crease_deg)
    ends = np.stack([rings[0].mean(axis=0), rings[-1].mean(axis=0)])
    ring = np.arange(m)
    front = np.stack([np.full(m, len(points)), ring + 1, ring], axis=1)
    last = ring + (n - 1) * (m + 1)
    back = np.stack([np.full(m, len(points) + 1), last, last + 1], axis=1)
    first, final = paint[: 2 * m : 2], paint[-2 * m :: 2]
    return component(
        np.concatenate([points, ends]),
        np.concatenate([faces, front, back]),
        np.concatenate([paint, first, final]),
        crease_deg,
    )


def lathe(
    profile: FloatArray, segments: int, material: object, crease_deg: float = CREASE_DEG, closed: bool = False
) -> Component:
    """A profile turned about the x axis.

    Args:
        profile: (N, 2) `[x, radius]`; followed from first to last point the body lies on the right of the
            line (x to the right, radius up): from small x over the outside to large x.
        closed: the profile is a closed line (a ring, as a tyre), otherwise discs close the ends.
    """
    x, radius = np.asarray(profile, dtype=np.float64).T
    angle = np.arange(segments) * (2.0 * np.pi / segments)
    circle = np.stack([np.zeros(segments), np.cos(angle), np.sin(angle)], axis=1)
    rings = radius[:, None, None] * circle + x[:, None, None] * np.array([1.0, 0.0, 0.0])
    table = np.asarray(material, dtype=np.uint8)
    return tube(rings, table[:, None] if table.ndim else table, crease_deg, closed)


@dataclass(frozen=True, eq=False)
class Table:
    """Values (N, ...) at `start`, `start + step`, ...; linear in between, constant beyond the ends.

    Faster than one `np.interp` per column.
    """

    start: float
    step: float
    values: FloatArray

    def __call__(self, at: object) -> FloatArray:
        """Values (..., ...) at positions (...)."""
        place = (np.asarray(at, dtype=np.float64) - self.start) / self.step
        place = np.asarray(np.minimum(np.maximum(place, 0.0), len(self.values) - 1.0))
        index = np.minimum(place.astype(np.intp), len(self.values) - 2)
        fraction = np.expand_dims(place - index, tuple(range(place.ndim, place.ndim + self.values.ndim - 1)))
        return np.asarray(self.values[index] * (1.0 - fraction) + self.values[index + 1] * fraction)


def along(values: FloatArray, positions: FloatArray, at: FloatArray) -> FloatArray:
    """Monotone cubic (Fritsch-Carlson) through `values` at increasing `positions`, evaluated at `at`.

    Never overshoots the data: profiles drawn with it have no ripples. Outside the range the end values hold.
    """
    x, y = np.asarray(positions, dtype=np.float64), np.asarray(values, dtype=np.float64)
    h, d = np.diff(x), np.diff(y) / np.diff(x)
    slope = np.zeros_like(y)
    if len(x) > 2:
        w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
        same = d[:-1] * d[1:] > 0.0
        safe = np.where(same, d[:-1], 1.0), np.where(same, d[1:], 1.0)
        slope[1:-1] = np.where(same, (w1 + w2) / (w1 / safe[0] + w2 / safe[1]), 0.0)
    slope[0], slope[-1] = d[0], d[-1]
    at = np.clip(np.asarray(at, dtype=np.float64), x[0], x[-1])
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    t = (at - x[i]) / h[i]
    a, b = y[i], y[i + 1]
    m0, m1 = slope[i] * h[i], slope[i + 1] * h[i]
    return np.asarray(
        a * (1 + 2 * t) * (1 - t) ** 2 + m0 * t * (1 - t) ** 2 + b * t**2 * (3 - 2 * t) + m1 * t**2 * (t - 1)
    )
