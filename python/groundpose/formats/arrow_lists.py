"""Arrays of rows of different lengths as Arrow's nested lists, and back, whole columns at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error
from groundpose.formats.parquet import package

Lengths = NDArray[np.int64]


def own_parts(values: NDArray[Any], lengths: Sequence[Lengths]) -> NDArray[Any]:
    """What N rows (N, ...) hold within their own lengths, each (N,), along each further axis, one after the
    other: (K,)."""
    if all((own == width).all() for own, width in zip(lengths, values.shape[1:], strict=True)):
        return values.reshape(-1)
    inside = np.ones(values.shape, dtype=bool)
    for axis, own in enumerate(lengths, 1):
        place = np.arange(values.shape[axis]).reshape([-1 if k == axis else 1 for k in range(values.ndim)])
        inside &= place < own.reshape(-1, *[1] * (values.ndim - 1))
    return values[inside]


def nested(flat: NDArray[Any], lengths: Sequence[Lengths]) -> Any:
    """Lists of lists of `own_parts`."""
    arrow = package()
    made = arrow.array(flat)
    for depth in reversed(range(len(lengths))):
        above = lengths[0] * 0 + 1
        for own in lengths[:depth]:
            above = above * own
        offsets = np.concatenate([[0], np.cumsum(np.repeat(lengths[depth], above))])
        made = arrow.ListArray.from_arrays(arrow.array(offsets, type=arrow.int32()), made)
    return made


def padded(column: Any, shape: Sequence[int | None], fill: float, name: str) -> NDArray[Any]:
    """An array (N, ...) of N nested lists; a None in `shape` stands for the longest, shorter ones are filled.

    Raises InputError: nulls, a list of another length.
    """
    whole = column.combine_chunks() if hasattr(column, "combine_chunks") else column
    if not shape:
        if whole.null_count:
            raise input_error(name, "no nulls", f"{whole.null_count} of {len(whole)}")
        return np.asarray(whole.to_numpy(zero_copy_only=False))
    offsets, inside = _opened(whole, name)
    width = shape[0] if shape[0] is not None else int(np.diff(offsets).max(initial=0))
    if shape[0] is not None and (np.diff(offsets) != width).any():
        raise input_error(
            name, f"lists of {width}", f"one of {int(np.diff(offsets)[np.diff(offsets) != width][0])}"
        )
    below = padded(inside, shape[1:], fill, name)
    made = np.full((len(whole), width, *below.shape[1:]), fill, dtype=below.dtype)
    made[np.arange(width) < np.diff(offsets)[:, None]] = below
    return made


def _opened(lists: Any, name: str) -> tuple[NDArray[np.int64], Any]:
    """Offsets of lists, from 0, and what is in them."""
    if lists.null_count:
        raise input_error(name, "no nulls", f"{lists.null_count} of {len(lists)}")
    offsets = np.asarray(lists.offsets.to_numpy(zero_copy_only=False), dtype=np.int64)
    return offsets - offsets[0] if len(offsets) else np.zeros(1, dtype=np.int64), lists.flatten()
