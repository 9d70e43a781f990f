"""Several boxes of one object become one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray

MOST_CANDIDATES = 3000
"""Boxes that are looked at, the surest first."""


def suppressed(
    boxes: FloatArray, scores: FloatArray, classes: NDArray[np.int64], overlap: float | None
) -> NDArray[np.intp]:
    """The boxes to keep, the surest first: none overlaps a surer one of its class.

    Args:
        boxes: (N, 4) left, top, right, bottom.
        scores: (N,).
        classes: (N,).
        overlap: intersection over union from which two boxes of a class are of one object; None: no two are.
    """
    waiting = np.argsort(-scores, kind="stable")[:MOST_CANDIDATES]
    if overlap is None:
        return waiting
    kept = []
    while waiting.size:
        first, rest = waiting[0], waiting[1:]
        kept.append(first)
        same = classes[rest] == classes[first]
        waiting = rest[~(same & (_overlaps(boxes[first], boxes[rest]) > overlap))]
    return np.array(kept, dtype=np.intp)


def _overlaps(one: FloatArray, others: FloatArray) -> FloatArray:
    """(N,) intersection over union of a box (4,) with others (N, 4)."""
    sides = np.minimum(one[2:], others[:, 2:]) - np.maximum(one[:2], others[:, :2])
    shared = np.maximum(sides, 0.0).prod(axis=1)
    union = _areas(one[None]) + _areas(others) - shared
    return np.asarray(shared / np.maximum(union, np.finfo(float).tiny))


def _areas(boxes: FloatArray) -> FloatArray:
    return np.asarray((boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
