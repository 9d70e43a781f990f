"""Cameras from files: the format is recognised by the content.

A format is a row of `CALIBRATIONS`: what it is called, how it is recognised, how it is read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike

from groundpose._checks import input_error
from groundpose.calibration import read_kitti_projection
from groundpose.formats.camera_files import (
    is_camera_info,
    is_nuscenes,
    is_opencv,
    read_camera_info,
    read_nuscenes,
    read_opencv,
)
from groundpose.formats.content import Content, read_content
from groundpose.formats.fields import Field
from groundpose.formats.frames import FRAME_MEMBERS, TILT_MEMBERS, read_view
from groundpose.types import Camera, View


@dataclass(frozen=True)
class CalibrationFormat:
    """One format: its name in errors, whether a file's content is in it, and its reader.

    `read` raises InputError naming file and line or field. A tilt that the file does not tell is 0.
    """

    name: str
    suits: Callable[[Content], bool]
    read: Callable[[Content], View]


def read_calibration(path: str | PathLike[str]) -> View:
    """Camera and tilt from a file of any format of `CALIBRATIONS`.

    Raises:
        OSError: no such file. InputError: no format suits, or the file is not as its format has it.
    """
    content = read_content(path)
    for row in CALIBRATIONS:
        if row.suits(content):
            return row.read(content)
    known = "; ".join(row.name for row in CALIBRATIONS)
    raise input_error(str(path), f"a calibration ({known})", "something else")


def _is_kitti(content: Content) -> bool:
    """A line of a projection matrix."""
    return any(line.startswith(("P2", "P_rect_02")) for _, line in content.lines)


def _kitti(content: Content) -> View:
    return View(Camera.from_K(read_kitti_projection(content.place)[:, :3]))


def _is_json(content: Content) -> bool:
    """One object with a camera in it."""
    return len(content.json) == 1 and isinstance(content.json[0].value, dict)


def _json(content: Content) -> View:
    """A frame, of which only camera and tilt count, or `{"fx": ..., "fy": ..., "cx": ..., "cy": ...}`, which
    may have a camera's and a tilt's other members too."""
    root = content.json[0]
    if "camera" not in root.value:
        tilt = {name: value for name, value in root.value.items() if name in TILT_MEMBERS}
        camera = {name: value for name, value in root.value.items() if name not in tilt}
        root = Field({"camera": camera, **tilt}, root.place)
    root.members(FRAME_MEMBERS)
    return read_view(root)


CALIBRATIONS: tuple[CalibrationFormat, ...] = (
    CalibrationFormat("KITTI's text with a line P2", _is_kitti, _kitti),
    CalibrationFormat("OpenCV's or ROS's YAML with a camera_matrix", is_opencv, read_opencv),
    CalibrationFormat("ROS's camera_info", is_camera_info, read_camera_info),
    CalibrationFormat("nuScenes' calibrated_sensor of one camera", is_nuscenes, read_nuscenes),
    CalibrationFormat("JSON with fx, fy, cx, cy", _is_json, _json),
)
"""The formats, asked in this order."""
