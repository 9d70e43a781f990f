"""What a call gives, as arrays that the core reads: every form that is taken, errors of what is not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose import _core
from groundpose._checks import (
    FloatArray,
    float_array,
    input_error,
    shape_text,
    shaped,
    type_error,
)
from groundpose.shape import ShapeModel

Keypoints = ArrayLike | Sequence[ArrayLike | Sequence[ArrayLike | None]]
Boxes = ArrayLike | Sequence[ArrayLike | Sequence[float | None] | None] | None
"""Arrays, or lists in which None stands for what is not known."""
Models = ShapeModel | Sequence[ShapeModel]

_NOT_SEEN = (np.nan, np.nan)


class Given(NamedTuple):
    """What is said of the objects of a call, in the order in which the core takes it."""

    keypoints_2d: Any
    bboxes: Any
    keypoint_scores: Any
    model_indices: Any
    vehicle_probability: Any
    viewing_angle_probabilities: Any

    def converted(self, models: Any, thresholds: FloatArray | None) -> Given:
        """The same as arrays of one type and layout that fit together; the first that does not is told.

        Raises:
            InputError: an argument of the wrong shape or length. TypeError: of the wrong type.
        """
        keypoints, lengths = _keypoints(self.keypoints_2d, models)
        count = len(keypoints)
        each = checked_models(models)
        indices = None if self.model_indices is None else _indices(self.model_indices, each, count)
        if indices is None and not isinstance(models, ShapeModel) and len(each) != count:
            raise input_error("models", f"1 or {count} models, one per object of keypoints_2d", len(each))
        keypoints = _widened(keypoints, lengths, each, indices)
        width = keypoints.shape[1]
        scores = self.keypoint_scores
        if scores is not None:
            scores = _scores(scores, count, width, lengths)
        boxes = None if self.bboxes is None else _bboxes(self.bboxes, count)
        if thresholds is not None and len(thresholds) != count:
            expected = f"{count} numbers, one per object"
            raise input_error("options.inlier_threshold", expected, len(thresholds))
        return Given(
            keypoints, boxes, scores, indices, self.vehicle_probability, self.viewing_angle_probabilities
        )

    def with_what_is_said(self) -> Given:
        """The same with what a network says of each object as arrays. Raises InputError, TypeError."""
        shapes = {"vehicle_probability": (), "viewing_angle_probabilities": (_core.VIEWING_ANGLES,)}
        count = len(self.keypoints_2d)
        return self._replace(
            **{
                name: shaped(name, said, (count, *shape))
                for name, shape in shapes.items()
                if (said := getattr(self, name)) is not None
            }
        )


def checked_models(models: Any) -> tuple[ShapeModel, ...]:
    """All of them as a tuple, the only one too. Raises TypeError."""
    if isinstance(models, ShapeModel):
        return (models,)
    if not isinstance(models, Sequence):
        raise type_error("models", "a ShapeModel or a sequence of them", models)
    each = tuple(models)
    for i, model in enumerate(each if set(map(type, each)) - {ShapeModel} else ()):
        if not isinstance(model, ShapeModel):
            raise type_error(f"models[{i}]", "a ShapeModel", model)
    return each


def _indices(value: Any, each: tuple[ShapeModel, ...], count: int) -> NDArray[np.int64]:
    """Which of the models each object has."""
    expected = f"{count} whole numbers, one per object of keypoints_2d"
    try:
        indices = np.asarray(value)
    except Exception:  # rows of different lengths, what other libraries raise
        raise type_error("model_indices", expected, value) from None
    if indices.size == 0:
        indices = indices.astype(np.int64)
    if indices.dtype.kind not in "iu":
        raise type_error("model_indices", expected, value)
    if indices.shape != (count,):
        raise input_error("model_indices", expected, f"shape {shape_text(indices.shape)}")
    for i in np.flatnonzero((indices < 0) | (indices >= len(each))):
        raise input_error(f"model_indices[{i}]", f"0 to {len(each) - 1}, a number of models", indices[i])
    return np.require(indices, np.int64, ("C", "A"))


def _keypoints(value: Any, models: object) -> tuple[FloatArray, list[int] | None]:
    """`keypoints_2d` as (N, P, 2), and the objects' own lengths if they came as a list."""
    if not isinstance(value, (list, tuple)):
        return shaped("keypoints_2d", value, ("N", "P", 2)), None
    if len(value) == 0:
        width = len(models.keypoints_3d) if isinstance(models, ShapeModel) else 0
        return np.empty((0, width, 2)), None
    rows = [_points(f"keypoints_2d[{i}]", points) for i, points in enumerate(value)]
    lengths = [len(row) for row in rows]
    return _pad(rows, lengths, max(lengths), np.nan), lengths


def _points(name: str, points: Any) -> FloatArray:
    """One object's keypoints (P, 2); None in a list is a point not seen."""
    if isinstance(points, (list, tuple)):
        points = [_NOT_SEEN if point is None else point for point in points]
        if not points:
            return np.empty((0, 2))
    return shaped(name, points, ("P", 2))


def _pad(rows: list[FloatArray], lengths: list[int], width: int, fill: float) -> FloatArray:
    """Rows of different lengths in one array (N, width, ...), `fill` beyond each row's end."""
    padded = np.full((len(rows), width, *rows[0].shape[1:]), fill)
    padded[np.arange(width) < np.array(lengths)[:, None]] = np.concatenate(rows)
    return padded


def _widened(
    keypoints: FloatArray,
    lengths: list[int] | None,
    each: tuple[ShapeModel, ...],
    indices: NDArray[np.int64] | None,
) -> FloatArray:
    """The keypoints, as wide as the largest model; every object has as many as its model, beyond them an
    array is NaN. `each` may hold the model of all objects once."""
    count, width = keypoints.shape[:2]
    if count == 0:
        return keypoints
    numbers = np.array([len(model.keypoints_3d) for model in each])
    widest, counts = int(numbers.max()), numbers if indices is None else numbers[indices]
    if lengths is None:
        if width != widest:
            raise input_error("keypoints_2d", f"{widest} keypoints as in the model", width)
        if int(counts.min()) == width:
            return keypoints
    counts = np.broadcast_to(counts, count)
    if lengths is not None:
        for i in np.flatnonzero(counts != lengths):
            raise input_error(f"keypoints_2d[{i}]", f"{counts[i]} keypoints as in the model", lengths[i])
        more = np.full((count, widest - width, 2), np.nan)
        return np.concatenate([keypoints, more], axis=1) if widest > width else keypoints
    extra = (np.arange(width) >= counts[:, None]) & ~np.isnan(keypoints).all(axis=2)
    for i, k in np.argwhere(extra):
        expected = f"NaN beyond the {counts[i]} keypoints of the model"
        raise input_error(f"keypoints_2d[{i}, {k}]", expected, keypoints[i, k].tolist())
    return keypoints


def _scores(value: Any, count: int, width: int, lengths: list[int] | None) -> FloatArray:
    if not isinstance(value, (list, tuple)):
        return shaped("keypoint_scores", value, (count, width))
    if len(value) != count:
        raise input_error("keypoint_scores", f"{count} rows, one per object", len(value))
    wanted = [width] * count if lengths is None else lengths
    rows = [
        shaped(f"keypoint_scores[{i}]", row, (n,))
        for i, (row, n) in enumerate(zip(value, wanted, strict=True))
    ]
    return _pad(rows, wanted, width, 0.0) if count else np.empty((0, width))


def _bboxes(value: Any, count: int) -> FloatArray:
    if isinstance(value, (list, tuple)):
        value = [(np.nan,) * 4 if box is None else box for box in value]
        if not value:
            value = np.empty((0, 4))
    boxes = float_array("bboxes", value, f"numbers of shape ({count}, 4)")
    if boxes.shape != (count, 4):
        raise input_error(
            "bboxes", f"shape ({count}, 4), one box per object", f"shape {shape_text(boxes.shape)}"
        )
    return boxes
