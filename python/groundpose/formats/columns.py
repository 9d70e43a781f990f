"""Poses as a table, a row for each object: the columns of CSV and Parquet files.

Metres, radians and pixels. The camera frame is x right, y down, z forward; the ground frame of the `View`
has the same origin, y along the ground's normal and z forward on the ground. `x, y, z` is the middle of the
3D box's bottom face in the camera frame, `ground_x, ground_y, ground_z` the same point in the ground frame.
`heading` is the direction in which the object faces, in the camera's x-z plane; `ground_heading` is that on
the ground: 0 is away from the camera, pi / 2 to the right. `qw, qx, qy, qz` is the rotation from the object
to the camera frame. The corners of the 3D box are in the camera frame, in the order of `CORNERS`. Each
`_sigma` is a standard deviation. `time` is in seconds since a video's first frame. An object without an
answer has its 2D box and its status.
"""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.formats.conversions import covariance_at, to_quaternions
from groundpose.formats.frames import Frame
from groundpose.formats.kitti.results import bottom_centres
from groundpose.formats.records import boxes_3d
from groundpose.poses import PoseBatch

CORNERS = tuple(
    f"{end}_{height}_{side}"
    for height, (end, side) in itertools.product(
        ("bottom", "top"),
        (("front", "left"), ("front", "right"), ("rear", "right"), ("rear", "left")),
    )
)
"""Names of the corners: around the bottom face, then around the top one."""


def corner(end: str, height: str, side: str) -> int:
    """Number of a corner in `CORNERS`."""
    return CORNERS.index(f"{end}_{height}_{side}")


_XYZ = ("x", "y", "z")
_NUMBERS = (
    "time",
    *("probability", "class_probability", "vehicle_probability", "score"),
    *("left", "top", "right", "bottom"),
    *_XYZ,
    "heading",
    *("qw", "qx", "qy", "qz"),
    *(f"ground_{axis}" for axis in _XYZ),
    "ground_heading",
    *("length", "height", "width"),
    *(f"{axis}_sigma" for axis in _XYZ),
    *(f"ground_{axis}_sigma" for axis in _XYZ),
    "heading_sigma",
    *("length_sigma", "height_sigma", "width_sigma"),
    *(f"{corner}_{axis}" for corner in CORNERS for axis in _XYZ),
)
_TEXTS = ("frame", "image", "object", "class", "status")
COLUMNS = (*_TEXTS, *_NUMBERS)
"""Names in order: the first five are texts, the others numbers."""
TEXTS = len(_TEXTS)


def numbers(poses: PoseBatch) -> dict[str, FloatArray]:
    """The columns (N,) that follow from a batch; NaN where there is no answer or nothing is known."""
    ground = poses.view.R_camera_from_ground
    middle = bottom_centres(poses)
    place = _place_covariance(poses, middle)
    on_ground = ground.T @ place @ ground
    normal = ground[:, 1]
    turn = np.einsum("i,nij,j->n", normal, poses.covariance[:, :3, :3], normal)
    ahead = poses.R[:, :, 2]
    parts = (
        (_XYZ, middle),
        (("heading",), np.arctan2(ahead[:, 0], ahead[:, 2])[:, None]),
        (("qw", "qx", "qy", "qz"), to_quaternions(poses.R)),
        ([f"ground_{axis}" for axis in _XYZ], poses.position),
        (("ground_heading",), poses.heading[:, None]),
        (("length", "height", "width"), poses.size),
        ([f"{axis}_sigma" for axis in _XYZ], _sigmas(place)),
        ([f"ground_{axis}_sigma" for axis in _XYZ], _sigmas(on_ground)),
        (("heading_sigma",), np.sqrt(np.maximum(turn, 0.0))[:, None]),
        (("length_sigma", "height_sigma", "width_sigma"), poses.size_sigma),
        ([f"{corner}_{axis}" for corner in CORNERS for axis in _XYZ], corners(poses).reshape(-1, 24)),
        (("left", "top", "right", "bottom"), poses.bboxes),
        (("probability",), poses.probability[:, None]),
    )
    return {name: values[:, k] for names, values in parts for k, name in enumerate(names)}


def corners(poses: PoseBatch) -> FloatArray:
    """(N, 8, 3) metres in the camera frame, the corners of the estimated 3D boxes in the order of `CORNERS`;
    NaN without an answer."""
    found, boxes = np.full((len(poses), 8, 3), np.nan), boxes_3d(poses)
    for k in np.flatnonzero(poses.ok):
        low, high = boxes[k]
        found[k] = corners_of(low, high, poses.R[k], poses.t[k])
    return found


def corners_of(low: FloatArray, high: FloatArray, R: FloatArray, t: FloatArray) -> FloatArray:
    """(8, 3) of a 3D box whose lowest and highest corner are `low`, `high` (3,) in the object frame."""
    rows = [_corner(name, low, high) for name in CORNERS]
    return np.asarray(np.array(rows) @ R.T + t)


def _corner(name: str, low: FloatArray, high: FloatArray) -> tuple[float, float, float]:
    """In the object frame: x right, y down, z forward."""
    end, height, side = name.split("_")
    return (
        float((low if side == "left" else high)[0]),
        float((low if height == "top" else high)[1]),
        float((low if end == "rear" else high)[2]),
    )


def _place_covariance(poses: PoseBatch, middle: FloatArray) -> FloatArray:
    """(N, 3, 3) of the middles (N, 3)."""
    return covariance_at(poses.covariance, middle - poses.t)[:, 3:, 3:]


def _sigmas(covariance: FloatArray) -> FloatArray:
    """(N, 3) of covariances (N, 3, 3)."""
    return np.asarray(np.sqrt(np.maximum(np.einsum("nii->ni", covariance), 0.0)))


def rows(frame: Frame, poses: PoseBatch) -> Iterator[list[Any]]:
    """The rows of a frame in the order of `COLUMNS`: texts, and numbers or None."""
    found: dict[str, NDArray[Any]] = dict(numbers(poses))
    for name in ("class_probability", "vehicle_probability"):  # where a network looked at it
        found[name] = getattr(poses, name, np.full(len(poses), np.nan))
    found["time"] = np.full(len(poses), np.nan if frame.time is None else frame.time)
    found["score"] = np.array([np.nan if o.score is None else o.score for o in frame.objects], dtype=float)
    table = np.array([found[name] for name in _NUMBERS], dtype=float).T
    image = "" if frame.image is None else str(frame.image)
    for item, status, row in zip(frame.objects, poses.status.tolist(), table, strict=True):
        values = [value if np.isfinite(value) else None for value in row.tolist()]
        yield [str(frame.id), image, str(item.id), item.model, status, *values]


def csv_text(lines: list[list[Any]]) -> str:
    """Lines of CSV, RFC 4180: empty is not known."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()
