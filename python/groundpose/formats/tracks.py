"""Tracks as text: a table (CSV), JSON lines, KITTI's tracking format.

The plane is that of the first frame, metres right (`x`) and forward (`z`) of the camera as it stood then;
angles in degrees from forward to the right. `right` and `ahead` are the same of the camera now, which then
looks into the direction `camera_heading_deg`: 0 unless odometry says that it has turned. `_sigma` is a
standard deviation. With a `World` there follow the columns of `World.columns`. The table and the lines are
read by `groundpose.formats.track_files`.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.kitti.labels import TYPE_OF
from groundpose.tracking.tracks import Tracks
from groundpose.types import View
from groundpose.world import World

Names = Mapping[int, str | int]
"""Of frames, by their number."""
COLUMNS = (
    *(
        "id",
        "class",
        "frame",
        "time",
        "object",
        "x",
        "z",
        "x_sigma",
        "z_sigma",
        "heading_deg",
        "heading_sigma_deg",
    ),
    *("facing_probability", "speed_kmh", "speed_sigma_kmh", "yaw_rate_deg", "yaw_rate_sigma_deg"),
    *("acceleration", "acceleration_sigma", "length", "height", "width"),
    *("length_sigma", "height_sigma", "width_sigma", "standing", "right", "ahead"),
    "camera_heading_deg",
)
"""Of the table, in order; `object`: which object of the frame it was, empty when it was not seen."""
KMH = 3.6
_NO_TURN = 1e-12
"""Radians: what rounding leaves of the difference of two equal headings."""
_DIGITS = {"latitude": 9, "longitude": 9}
"""After the point; of the others 6."""


def columns(world: World | None = None) -> tuple[str, ...]:
    """Of the table, in order; `world` adds its own."""
    if world is None:
        return COLUMNS
    return (*COLUMNS, *world.place_columns, "east_sigma", "north_sigma", "map_heading_deg")


def rows(tracks: Tracks, frames: Names | None = None, world: World | None = None) -> Iterator[dict[str, Any]]:
    """Each row by column; None: not known. `frames`: names of frames by their number."""
    place_sigma = tracks.place_sigma
    placed = {} if world is None else world.columns(tracks)
    camera = np.degrees(camera_headings(tracks))
    for k in range(len(tracks)):
        frame = int(tracks.frame[k])
        index = int(tracks.index[k])
        values = (
            *(int(tracks.id[k]), str(tracks.name[k]), frame if frames is None else frames.get(frame, frame)),
            *(float(tracks.time[k]), None if index < 0 else index),
            *tracks.place[k].tolist(),
            *place_sigma[k].tolist(),
            *(math.degrees(x) for x in (tracks.heading[k], tracks.heading_sigma[k])),
            float(tracks.facing_probability[k]),
            *(KMH * float(x) for x in (tracks.speed[k], tracks.speed_sigma[k])),
            *(math.degrees(x) for x in (tracks.yaw_rate[k], tracks.yaw_rate_sigma[k])),
            *(float(x) for x in (tracks.acceleration[k], tracks.acceleration_sigma[k])),
            *tracks.size[k].tolist(),
            *tracks.size_sigma[k].tolist(),
            *(bool(tracks.standing[k]), *tracks.seen_from[k, :2].tolist(), float(camera[k])),
            *(float(column[k]) for column in placed.values()),
        )
        yield {name: _plain(name, value) for name, value in zip(columns(world), values, strict=True)}


def camera_headings(tracks: Tracks) -> FloatArray:
    """(N,) radians, where the camera looks in the plane of the first frame, at the time of each row."""
    turned = tracks.heading - tracks.seen_from[:, 2]
    wrapped = np.arctan2(np.sin(turned), np.cos(turned))
    return np.where(np.abs(wrapped) < _NO_TURN, 0.0, wrapped)


def _plain(name: str, value: Any) -> Any:
    if isinstance(value, float):
        return round(value, _DIGITS.get(name, 6)) if math.isfinite(value) else None
    return value


def csv_text(
    tracks: Tracks, frames: Names | None = None, header: bool = True, *, world: World | None = None
) -> str:
    """Lines of CSV, RFC 4180: empty is not known."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(row.values() for row in rows(tracks, frames, world))
    return (csv_head(world) if header else "") + text.getvalue()


def csv_head(world: World | None = None) -> str:
    """The first line of a CSV."""
    return ",".join(columns(world)) + "\n"


def jsonl_text(
    tracks: Tracks, frames: Names | None = None, header: bool = True, *, world: World | None = None
) -> str:
    """One JSON object per row."""
    return "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows(tracks, frames, world))


def kitti_text(
    tracks: Tracks,
    frames: Names | None = None,
    header: bool = True,
    *,
    bboxes: Mapping[int, FloatArray] | None = None,
    view: View | None = None,
) -> str:
    """KITTI's tracking format, `frame id type truncated occluded alpha box h w l x y z ry`, by frame.

    Args:
        tracks: the rows; those of frames in which a vehicle was not seen are left out.
        frames: not used: KITTI counts frames.
        header: not used.
        bboxes: 2D boxes (N, 4) of the objects of a frame, by its number; others get -1.
        view: camera, tilt and height, to put places into the camera's frame; None or without a height: y is
            -1000, not known, and x and z are those of the ground.
    """
    seen = tracks[tracks.index >= 0]
    lines = []
    for k in np.lexsort((seen.id, seen.frame)):
        frame = int(seen.frame[k])
        boxes = None if bboxes is None else bboxes.get(frame)
        box = np.full(4, np.nan) if boxes is None else boxes[seen.index[k]]
        left, top, right, bottom = np.nan_to_num(box, nan=-1.0).tolist()
        x, z, heading = seen.seen_from[k].tolist()
        length, height, width = np.nan_to_num(seen.size[k], nan=-1.0).tolist()
        turned = math.remainder(heading - 0.5 * math.pi, 2.0 * math.pi)
        alpha = math.remainder(turned - math.atan2(x, z), 2.0 * math.pi)
        y = -1000.0
        if view is not None and view.height is not None:
            x, y, z = (view.R_camera_from_ground @ [x, view.height, z]).tolist()
        numbers = (left, top, right, bottom, height, width, length, x, y, z, turned)
        kind = TYPE_OF.get(str(seen.name[k]), str(seen.name[k]))
        text = " ".join(f"{value:.4f}" for value in (alpha, *numbers))
        lines.append(f"{frame} {int(seen.id[k])} {kind} -1 -1 {text}\n")
    return "".join(lines)


FORMATS: dict[str, Callable[..., str]] = {"csv": csv_text, "jsonl": jsonl_text, "kitti": kitti_text}
"""By name."""
ENDINGS = {".csv": "csv", ".jsonl": "jsonl", ".ndjson": "jsonl", ".json": "jsonl", ".txt": "kitti"}
"""Format by a file's ending."""
