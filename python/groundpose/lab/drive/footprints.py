"""Rectangles on the ground seen from above: tests of overlap, and distances at which rays meet them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray


@dataclass(frozen=True, eq=False)
class Footprints:
    """N rectangles: `middle` (N, 2) x, z; `axes` (N, 2, 2), rows to the right and forwards; `half` (N, 2)."""

    middle: FloatArray
    axes: FloatArray
    half: FloatArray

    @classmethod
    def of(cls, origin: FloatArray, heading: FloatArray, box: FloatArray, margin: float = 0.0) -> Footprints:
        """From origins (N, 2), headings (N,) and boxes (N, 2, 2) `[[x, z] min, max]` about the origin."""
        cos, sin = np.cos(heading), np.sin(heading)
        axes = np.stack([np.stack([cos, -sin], axis=1), np.stack([sin, cos], axis=1)], axis=1)
        centre = 0.5 * (box[:, 0] + box[:, 1])
        return cls(
            middle=origin + np.einsum("ni,nij->nj", centre, axes),
            axes=axes,
            half=0.5 * (box[:, 1] - box[:, 0]) + margin,
        )

    def __getitem__(self, rows: NDArray[np.intp]) -> Footprints:
        """The rectangles with these indices or this mask."""
        return Footprints(self.middle[rows], self.axes[rows], self.half[rows])

    def entry(self, origin: FloatArray, directions: FloatArray) -> FloatArray:
        """(N,) distance at which a ray from `origin` (2,) along `directions` (N, 2) enters; inf: never."""
        start = np.einsum("nk,njk->nj", origin - self.middle, self.axes)
        step = np.einsum("nk,njk->nj", directions, self.axes)
        step = np.where(np.abs(step) < 1e-12, 1e-12, step)
        side = np.sign(step) * self.half
        first, last = (
            np.maximum(((-side - start) / step).max(axis=1), 0.0),
            ((side - start) / step).min(axis=1),
        )
        return np.where(last > first, first, np.inf)


def overlapping(a: Footprints, b: Footprints | None = None) -> NDArray[np.bool_]:
    """(N, M) whether each rectangle of `a` overlaps each of `b` (None: of `a`, except itself).

    Two rectangles are apart when they are so along a side of one of them (separating axes).
    """
    other = a if b is None else b
    offset = other.middle[None] - a.middle[:, None]
    apart = np.zeros(offset.shape[:2], dtype=bool)
    for axes in (a.axes[:, None], other.axes[None]):
        distance = np.abs(
            np.einsum("nmk,nmjk->nmj", offset, np.broadcast_to(axes, (*offset.shape[:2], 2, 2)))
        )
        radius = _radius(a, axes)[..., :] + _radius(other, axes, second=True)
        apart |= (distance > radius).any(axis=2)
    meets = ~apart
    if b is None:
        np.fill_diagonal(meets, False)
    return meets


def _radius(shape: Footprints, axes: FloatArray, second: bool = False) -> FloatArray:
    """Half extent of rectangles along axes (.., 2, 2), broadcast over pairs."""
    own, half = (shape.axes[None], shape.half[None]) if second else (shape.axes[:, None], shape.half[:, None])
    return np.asarray(np.einsum("...i,...ji->...j", half, np.abs(axes @ np.swapaxes(own, -1, -2))))


def touching(a: Footprints, b: Footprints) -> NDArray[np.bool_]:
    """(N,) whether rectangle k of `a` overlaps rectangle k of `b`."""
    offset = b.middle - a.middle
    apart = np.zeros(len(offset), dtype=bool)
    for own, other in ((a, b), (b, a)):
        distance = np.abs(np.einsum("ni,nji->nj", offset, own.axes))
        turned = np.abs(np.einsum("nji,nki->njk", own.axes, other.axes))
        apart |= (distance > own.half + np.einsum("njk,nk->nj", turned, other.half)).any(axis=1)
    return ~apart


def candidates(a: Footprints, b: Footprints) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of `a` and of `b` whose circumscribed circles meet."""
    apart = np.linalg.norm(a.middle[:, None] - b.middle[None], axis=2)
    radii = [np.linalg.norm(shape.half, axis=1) for shape in (a, b)]
    i, j = np.nonzero(apart < radii[0][:, None] + radii[1])
    return i, j
