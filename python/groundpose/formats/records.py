"""Poses as JSON: the lines that `groundpose estimate` writes."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.frames import Frame
from groundpose.frame import EstimatedView
from groundpose.poses import SHAPES, WRITTEN, PoseBatch
from groundpose.types import Camera, View


def pose_record(
    frame: Frame,
    poses: PoseBatch,
    more: Mapping[str, Any] | None = None,
    each: Sequence[Mapping[str, Any]] | None = None,
) -> str:
    """One JSON line: `{"id": ..., "camera": ..., "objects": [{"id", "model", "status", "R", "t", ...}]}`.

    Camera and tilt stand there as frames have them. The members of an object are the fields of `Pose` of the
    same names, `bbox` as given, and `bbox_3d`, (2, 3) metres, the lowest and the highest corner of the
    estimated shape's 3D box in the object frame; NaN is null. `more` are further members of the line, after
    the frame's time if it has one, and `each` of its objects, written before the pose. What looks wrong in
    the input stands in `remarks`, if anything does. A view that was estimated from the frame adds its numbers
    (and `remarks`, even of nothing) to the line, sizes and positions to the objects.
    """
    remarks, seen = list(poses.remarks), view_members(poses.view)
    said = {"camera": camera_members(poses.view.camera), **tilt_members(poses.view)}
    more = {**said, **(more or {}), **seen, **({"remarks": remarks} if remarks or seen else {})}
    given, boxes, fields = _cells(poses.bboxes), _cells(boxes_3d(poses)), _fields(poses)
    rows = zip(frame.objects, given, each or [{}] * len(poses), _on_road(poses), fields, boxes, strict=True)
    objects = [
        {
            "id": o.id,
            "model": o.model,
            "bbox": bbox,
            **{name: _plain(value) for name, value in extra.items()},
            **road,
            **found,
            "bbox_3d": box,
        }
        for o, bbox, extra, road, found, box in rows
    ]
    time = {} if frame.time is None else {"time": frame.time}
    return json.dumps({"id": frame.id, **time, **more, "objects": objects}, allow_nan=False)


def _fields(poses: PoseBatch) -> list[dict[str, Any]]:
    """The written fields of `Pose` of each object, column by column: a line has hundreds of numbers."""
    sizes = [{"P": len(model.keypoints_3d), "M": model.modes} for model in poses.models]
    padded = any(own != sizes[0] for own in sizes)
    columns, arrays = [], vars(poses)
    for name in WRITTEN:
        column, shape = arrays[name], SHAPES[name]
        cells = column.tolist()
        if padded and not {"P", "M"}.isdisjoint(shape):
            cells = [_own(cell, shape, size) for cell, size in zip(cells, sizes, strict=True)]
        columns.append(cells if column.dtype.kind != "f" else [_plain(cell) for cell in cells])
    return [dict(zip(WRITTEN, row, strict=True)) for row in zip(*columns, strict=True)]


def _own(cell: list[Any], shape: Sequence[int | str], size: dict[Any, int]) -> list[Any]:
    """An object's part of its row of a batch, which is as wide as the largest model."""
    kept, deeper = cell[: size.get(shape[0])], shape[1:]
    return [_own(inner, deeper, size) for inner in kept] if deeper else kept


def boxes_3d(poses: PoseBatch) -> FloatArray:
    """(N, 2, 3) metres, the lowest and the highest corner of each estimated shape's 3D box in its object
    frame; NaN without an answer."""
    found = np.full((len(poses), 2, 3), np.nan)
    for model, rows in poses.answered_by_model():
        found[rows] = model.stretched_boxes_3d(poses.shape_coefficients[rows])
    return found


def camera_members(camera: Camera) -> dict[str, Any]:
    """A camera as frames have it."""
    lens = {} if camera.distortion is None else {"distortion": list(camera.distortion), "lens": camera.lens}
    size = {} if camera.image_size is None else {"image_size": list(camera.image_size)}
    return {**{name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}, **lens, **size}


def tilt_members(view: View) -> dict[str, float]:
    """The tilt of a view as frames have it."""
    return {"pitch_deg": math.degrees(view.pitch), "roll_deg": math.degrees(view.roll)}


def view_members(view: View) -> dict[str, Any]:
    """An estimated view as frames have it, with its standard deviations; nothing of a nominal one."""
    if not isinstance(view, EstimatedView):
        return {}
    sigmas = {
        "camera_height": view.height,
        "pitch_sigma_deg": math.degrees(view.pitch_sigma),
        "roll_sigma_deg": math.degrees(view.roll_sigma),
        "camera_height_sigma": _plain(view.height_sigma),
    }
    return {**tilt_members(view), **sigmas}


def _on_road(poses: PoseBatch) -> list[dict[str, Any]]:
    """What a frame as a whole says of its objects."""
    if not isinstance(poses.view, EstimatedView):
        return [{}] * len(poses)
    columns = (poses.size, poses.size_sigma, poses.position)
    cells = zip(*map(_cells, columns), strict=True)
    return [dict(zip(("size", "size_sigma", "position"), row, strict=True)) for row in cells]


def _cells(array: FloatArray) -> list[Any]:
    return [_plain(row) for row in array.tolist()]


def _plain(value: Any) -> Any:
    """Arrays as lists and numbers that JSON cannot hold as None."""
    if isinstance(value, list):
        if value and type(value[0]) is float and math.isfinite(sum(value)):
            return value  # the usual case, quickly
        return [_plain(x) for x in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
