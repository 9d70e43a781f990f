"""`estimate_poses`: from keypoints, boxes and models of one image to poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from groundpose import _core
from groundpose._checks import (
    FloatArray,
    float_array,
    input_error,
    number,
    shape_text,
    shaped,
    type_error,
)
from groundpose._checks import threads as checked_threads
from groundpose.camera_state import CameraState
from groundpose.frame import FramePriors
from groundpose.options import Options
from groundpose.poses import PoseBatch
from groundpose.road import check_frame, estimate_frame
from groundpose.shape import ShapeModel
from groundpose.types import View

# The core counts, people read.
_WORDS = {
    "status": np.array(_core.STATUS),
    "stop_reason": np.array(_core.STOP_REASONS),
    "solver": np.array(_core.SOLVERS),
}

Keypoints = ArrayLike | Sequence[ArrayLike | Sequence[ArrayLike | None]]
Boxes = ArrayLike | Sequence[ArrayLike | Sequence[float | None] | None] | None
"""Arrays, or lists in which None stands for what is not known."""

_DEFAULT_OPTIONS = Options()
_NOT_SEEN = (np.nan, np.nan)
_NO_COVARIANCE = np.full((2, 2), np.nan)


def estimate_poses(
    view: View,
    keypoints_2d: Keypoints,
    bboxes: Boxes,
    models: ShapeModel | Sequence[ShapeModel],
    keypoint_scores: ArrayLike | Sequence[ArrayLike] | None = None,
    options: Options = _DEFAULT_OPTIONS,
    threads: int | None = None,
    frame_tilt_sigma: float | None = None,
    vehicle_probability: ArrayLike | None = None,
    viewing_angle_probabilities: ArrayLike | None = None,
    frame: FramePriors | CameraState | None = None,
) -> PoseBatch:
    """The pose (and shape) of every object of one image.

    Args:
        view: camera and its tilt against the ground.
        keypoints_2d: pixels, (N, P, 2) of any float dtype, stride and order, NaN = not seen; or a
            sequence of N arrays or lists (P_i, 2), in which None stands for a point not seen.
        bboxes: (N, 4) `left, top, right, bottom` pixels; in a list None for an object without box;
            NaN (None) for one unknown side; None: no boxes at all.
        models: one model for all objects or N models. With models of different numbers of keypoints
            an array `keypoints_2d` is as wide as the largest and NaN beyond an object's own.
        keypoint_scores: (N, P), or N sequences (P_i,), weights of a detector, at least 0; 0 or
            NaN: not seen. None: all weigh the same.
        options: see `Options`.
        threads: 1 or more, at most one for each core; None: all cores. The result is the same bit for bit.
        frame_tilt_sigma: radians, standard deviation of the frame's true tilt about the nominal tilt
            of `view`. The tilt is then estimated first, from all objects together, and stands in
            the result's `view`; this doubles the time. None: the nominal tilt is taken as true.
        vehicle_probability: (N,) that there is a vehicle at all, as a network says it; NaN, None: not said.
        viewing_angle_probabilities: (N, 16) of the angle from which a network sees the object, KITTI's alpha,
            bin b centred on b * 22.5 degrees; they give `ambiguity` and `alternatives`. NaN, None: not said.
        frame: what is known of tilt, height, road and sizes; a `CameraState` learns from the frame. All
            objects then stand on one road: poses, sizes and covariances are those of the whole frame,
            `models` have the estimated sizes and `view` is an `EstimatedView`; residuals and what follows
            from them stay those of the objects alone. None: every object alone.

    Returns:
        N answers, in order. An object without an answer has a `status` that says why, and NaN; its
        data never raise an error.

    Raises:
        InputError: an argument of the wrong shape or length. TypeError: of the wrong type.

    Method: one-point RANSAC and robust refinement with the tilt as a prior (Lee et al., CVPR
    Workshops 2021, sec. 3, and beyond).
    """
    if not isinstance(view, View):
        raise type_error("view", "a View", view)
    if not isinstance(options, Options):
        raise type_error("options", "Options", options)
    if frame is not None:
        check_frame(frame, frame_tilt_sigma, options.covariance)
        priors = frame.priors if isinstance(frame, CameraState) else frame
        objects = (keypoints_2d, bboxes, priors.sized(models), keypoint_scores)
        said = (vehicle_probability, viewing_angle_probabilities)
        return estimate_frame(
            view, frame, lambda seen: estimate_poses(seen, *objects, options, threads, None, *said)
        )
    keypoints, lengths = _keypoints(keypoints_2d, models)
    count, width = keypoints.shape[:2]
    each = _models(models, count)
    _check_widths(
        keypoints, lengths, each[:1] if isinstance(models, ShapeModel) and lengths is None else each
    )
    scores = None if keypoint_scores is None else _scores(keypoint_scores, count, width, lengths)
    boxes = _bboxes(bboxes, count)
    thresholds = options._thresholds
    if thresholds is not None and len(thresholds) != count:
        raise input_error("options.inlier_threshold", f"{count} numbers, one per object", len(thresholds))
    handles = [each[0]._handle] if isinstance(models, ShapeModel) and count else [m._handle for m in each]
    sigma = None if frame_tilt_sigma is None else number("frame_tilt_sigma", frame_tilt_sigma)
    data, workers = (keypoints, scores, boxes, handles, thresholds), checked_threads(threads) or 0
    said = (
        _said("vehicle_probability", vehicle_probability, (count,)),
        _said("viewing_angle_probabilities", viewing_angle_probabilities, (count, _core.VIEWING_ANGLES)),
    )
    nominal = {"nominal_view": view, "nominal_tilt_sigma": np.full(2, np.nan if sigma is None else sigma)}
    out = _core.estimate_batch(view._handle, *data, options._handle, workers, sigma, *said)
    if sigma is not None:
        view = replace(view, pitch=out.pop("pitch"), roll=out.pop("roll"))
    ok = out["status"] == 0
    for name, words in _WORDS.items():
        out[name] = words[out[name]]
    given = {"view": view, "keypoints_2d": keypoints, "bboxes": boxes, "models": each}
    given["error_dof"] = np.inf if options.keypoint_error_dof is None else options.keypoint_error_dof
    given["scale_covariance"] = np.zeros((count, out["shape_coefficients"].shape[1] + 1))
    return PoseBatch._of(given | nominal | {"tilt_covariance": _NO_COVARIANCE.copy()} | out | {"ok": ok})


def _keypoints(value: Any, models: object) -> tuple[FloatArray, list[int] | None]:
    """A copy of `keypoints_2d` as (N, P, 2), and the objects' own lengths if they came as a list."""
    if not isinstance(value, (list, tuple)):
        return shaped("keypoints_2d", value, ("N", "P", 2)).copy(), None
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


def _models(models: Any, count: int) -> tuple[ShapeModel, ...]:
    if isinstance(models, ShapeModel):
        return (models,) * count
    if not isinstance(models, Sequence):
        raise type_error("models", "a ShapeModel or a sequence of them", models)
    each = tuple(models)
    for i, model in enumerate(each if set(map(type, each)) - {ShapeModel} else ()):
        if not isinstance(model, ShapeModel):
            raise type_error(f"models[{i}]", "a ShapeModel", model)
    if len(each) != count:
        raise input_error("models", f"1 or {count} models, one per object of keypoints_2d", len(each))
    return each


def _check_widths(keypoints: FloatArray, lengths: list[int] | None, models: tuple[ShapeModel, ...]) -> None:
    """Every object has as many keypoints as its model; beyond them an array is NaN.

    Where all objects of an array have the same model, `models` may hold it once.
    """
    width = keypoints.shape[1]
    numbers = [len(model.keypoints_3d) for model in models]
    if lengths is None:
        wanted = max(numbers, default=width)
        if width != wanted:
            raise input_error("keypoints_2d", f"{wanted} keypoints as in the model", width)
        if min(numbers, default=width) == width:
            return
    counts = np.array(numbers)
    if lengths is not None:
        for i in np.flatnonzero(counts != lengths):
            raise input_error(f"keypoints_2d[{i}]", f"{counts[i]} keypoints as in the model", lengths[i])
    extra = (np.arange(width) >= counts[:, None]) & ~np.isnan(keypoints).all(axis=2)
    for i, k in np.argwhere(extra):
        expected = f"NaN beyond the {counts[i]} keypoints of the model"
        raise input_error(f"keypoints_2d[{i}, {k}]", expected, keypoints[i, k].tolist())


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


def _said(name: str, value: Any, shape: tuple[int, ...]) -> FloatArray | None:
    """What a network says of each object, or None."""
    return None if value is None else shaped(name, value, shape)


def _bboxes(value: Any, count: int) -> FloatArray:
    if value is None:
        return np.full((count, 4), np.nan)
    if isinstance(value, (list, tuple)):
        value = [(np.nan,) * 4 if box is None else box for box in value]
        if not value:
            value = np.empty((0, 4))
    boxes = float_array("bboxes", value, f"numbers of shape ({count}, 4)")
    if boxes.shape != (count, 4):
        raise input_error(
            "bboxes", f"shape ({count}, 4), one box per object", f"shape {shape_text(boxes.shape)}"
        )
    return np.array(boxes)
