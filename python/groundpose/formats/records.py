"""Poses as JSON: the lines that `groundpose estimate` writes."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from groundpose.formats.frames import Frame
from groundpose.frame import EstimatedView
from groundpose.poses import WRITTEN, PoseBatch
from groundpose.types import View


def pose_record(
    frame: Frame,
    poses: PoseBatch,
    more: Mapping[str, Any] | None = None,
    each: Sequence[Mapping[str, Any]] | None = None,
) -> str:
    """One JSON line: `{"id": ..., "objects": [{"id", "model", "status", "R", "t", "yaw", ...}]}`.

    The members of an object are the fields of `Pose` of the same names; NaN is null. `more` are further
    members of the line, after the frame's time if it has one, and `each` of its objects, written before the
    pose. What looks wrong in the input stands in `remarks`, if anything does. A view that was estimated from
    the frame adds its numbers (and `remarks`, even of nothing) to the line, sizes and positions to the
    objects.
    """
    remarks, seen = list(poses.remarks), view_members(poses.view)
    more = {**(more or {}), **seen, **({"remarks": remarks} if remarks or seen else {})}
    each = [{**a, **b} for a, b in zip(each or [{}] * len(poses), _on_road(poses), strict=True)]
    objects = [
        {
            "id": o.id,
            "model": o.model,
            **{name: _plain(value) for name, value in extra.items()},
            **{name: _plain(getattr(pose, name)) for name in WRITTEN},
        }
        for o, pose, extra in zip(frame.objects, poses, each, strict=True)
    ]
    time = {} if frame.time is None else {"time": frame.time}
    return json.dumps({"id": frame.id, **time, **more, "objects": objects}, allow_nan=False)


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
    columns = zip(poses.size, poses.size_sigma, poses.position, strict=True)
    return [dict(zip(("size", "size_sigma", "position"), row, strict=True)) for row in columns]


def _plain(value: Any) -> Any:
    """Arrays as lists and numbers that JSON cannot hold as None."""
    if isinstance(value, np.ndarray):
        all_there = value.dtype.kind != "f" or np.isfinite(value).all()
        return value.tolist() if all_there else _plain(value.tolist())
    if isinstance(value, list):
        return [_plain(x) for x in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
