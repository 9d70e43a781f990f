"""Which sightings are of the same vehicle: by numbers that go on, else by overlapping boxes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray

_LEAST_OVERLAP = 0.3


def linked(
    frames: Sequence[int], ids: Sequence[str | int], bboxes: FloatArray, numbered: bool | None = None
) -> NDArray[np.int64]:
    """(N,) number of the vehicle of each sighting.

    Args:
        frames: (N,) number of the frame of each, in order.
        ids: (N,) what each is called in its frame.
        bboxes: (N, 4) pixels.
        numbered: whether a vehicle has the same id in all frames; None: it has when there are more ids than
            vehicles in any frame.
    """
    if numbered is None:
        _, most = np.unique(np.asarray(frames), return_counts=True)
        numbered = len(set(ids)) > int(most.max(initial=0))
    if numbered:
        rows = {name: k for k, name in enumerate(dict.fromkeys(ids))}
        return np.array([rows[name] for name in ids], np.int64)
    return _by_overlap(np.asarray(frames), bboxes)


def _by_overlap(frames: NDArray[np.int64], bboxes: FloatArray) -> NDArray[np.int64]:
    """Boxes of successive frames, the best pairs first."""
    found = np.full(len(frames), -1, np.int64)
    count, last = 0, np.zeros(0, np.intp)
    for frame in np.unique(frames).tolist():
        rows = np.flatnonzero(frames == frame)
        near = last[frames[last] == frame - 1]
        shared = overlap(bboxes[rows], bboxes[near])
        while shared.size and shared.max() > _LEAST_OVERLAP:
            i, j = np.unravel_index(int(shared.argmax()), shared.shape)
            found[rows[i]] = found[near[j]]
            shared[i, :], shared[:, j] = 0.0, 0.0
        for row in rows[found[rows] < 0].tolist():
            found[row], count = count, count + 1
        last = rows
    return found


def overlap(a: FloatArray, b: FloatArray) -> FloatArray:
    """(N, M) intersection over union of boxes (N, 4) and (M, 4)."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.maximum(high - low, 0.0).prod(axis=2)
    areas = [(c[:, 2:] - c[:, :2]).prod(axis=1) for c in (a, b)]
    return np.asarray(shared / np.maximum(areas[0][:, None] + areas[1] - shared, 1e-9))
