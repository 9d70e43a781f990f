"""Cameras as other tools write them: OpenCV's YAML, ROS's calibration files and camera_info messages,
nuScenes.

Read by what `groundpose.formats.calibrations` sees in a file; written by the `format_` functions.
Lens models are those of `groundpose.lens`; other models are refused.
"""

from __future__ import annotations

import json
import math
import re

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose.formats.content import Content
from groundpose.formats.conversions import to_quaternions
from groundpose.formats.fields import Field
from groundpose.lens import LENSES, lens_of
from groundpose.types import Camera, View


def is_opencv(content: Content) -> bool:
    """A YAML file of OpenCV's FileStorage or of ROS's camera_calibration."""
    return bool(re.search(r"(?im)^camera_matrix\s*:", content.text))


def read_opencv(content: Content) -> View:
    """See `Camera.from_opencv_yaml`."""
    return View(Camera.from_opencv_yaml(content.place))


def is_camera_info(content: Content) -> bool:
    """A camera_info message as ROS 1 (`K: [...]`) or ROS 2 (`k:`, one number per line) prints it."""
    return bool(re.search(r"(?m)^[kK]\s*:", content.text)) and not content.json


def read_camera_info(content: Content) -> View:
    """K, D, width and height of a camera_info message; P and R are not looked at: images are raw."""
    lens = lens_of(content.text, content.place)
    K, distortion = _numbers(content, "k"), _numbers(content, "d")
    if len(K) != 9:
        raise input_error(f"{content.place}: K", "nine numbers", len(K))
    counts = LENSES[lens].counts
    if distortion and len(distortion) not in counts:
        expected = f"{', '.join(['none', *map(str, counts[:-1])])} or {counts[-1]} numbers"
        raise input_error(f"{content.place}: D", expected, len(distortion))
    sides = [re.search(rf"(?m)^{side}\s*:\s*(\d+)", content.text) for side in ("width", "height")]
    width, height = (int(match.group(1)) if match else 0 for match in sides)
    matrix, size = np.array(K).reshape(3, 3), (width, height) if width and height else None
    return View(Camera.from_K(matrix, distortion if np.any(distortion) else None, size, lens))


def _numbers(content: Content, name: str) -> list[float]:
    """Numbers of `name: [a, b]` (over several lines, too) or of lines `- a` below `name:`."""
    found = re.search(rf"(?im)^{name}\s*:\s*(?:\[([^\]]*)\]|((?:\n\s*-\s.*)+))", content.text)
    if found is None:
        return []
    words = re.split(r"[,\s]+|(?:^|\n)\s*-\s", (found.group(1) or found.group(2) or "").strip())
    try:
        return [float(word) for word in words if word and word != "-"]
    except ValueError:
        raise input_error(f"{content.place}: {name.upper()}", "numbers", " ".join(words)[:60]) from None


def format_opencv_yaml(camera: Camera) -> str:
    """As OpenCV's FileStorage writes it; read by it, by ROS and by `Camera.from_opencv_yaml`."""
    head = "%YAML:1.0\n---\n" + _size_lines(camera, "image_")
    model = f"distortion_model: {LENSES[camera.lens].ros}\n"
    distortion = _distortion(camera).reshape(-1, 1)
    return head + _matrix("camera_matrix", camera.K) + model + _matrix("distortion_coefficients", distortion)


def _distortion(camera: Camera) -> FloatArray:
    """Coefficients (n,), zeros without distortion."""
    return np.array(camera.distortion or (0.0,) * len(LENSES[camera.lens].coefficients))


def _matrix(name: str, a: FloatArray) -> str:
    rows, columns = a.shape
    data = ", ".join(repr(x) for x in a.ravel().tolist())
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n"


def format_camera_info(camera: Camera) -> str:
    """A camera_info message as ROS 1 prints it: for `rostopic pub` and readers of such files."""
    P = np.hstack([camera.K, np.zeros((3, 1))])
    rows = {"D": _distortion(camera), "K": camera.K, "R": np.eye(3), "P": P}
    lines = "".join(f"{name}: {json.dumps(a.ravel().tolist())}\n" for name, a in rows.items())
    return f"{_size_lines(camera, '')}distortion_model: {LENSES[camera.lens].ros}\n{lines}"


def _size_lines(camera: Camera, prefix: str) -> str:
    if camera.image_size is None:
        return ""
    width, height = camera.image_size
    return f"{prefix}height: {height}\n{prefix}width: {width}\n"


def is_nuscenes(content: Content) -> bool:
    """A record of calibrated_sensor.json, or a list of them."""
    rows = _records(content)
    return bool(rows) and all("camera_intrinsic" in row.value for row in rows)


def read_nuscenes(content: Content) -> View:
    """Camera, tilt and height of the one camera among records of calibrated_sensor.json.

    The ego frame has x forward, y left, z up and stands on the ground; `rotation` is the quaternion w, x,
    y, z from the sensor to it. Without a rotation the tilt is 0. nuScenes has no distortion.
    """
    cameras = [row for row in _records(content) if row.value["camera_intrinsic"]]
    if len(cameras) != 1:
        raise input_error(content.place, "the record of one camera", f"{len(cameras)} of them")
    root = cameras[0]
    width, height = (side.number() if (side := root.get(name)) else None for name in ("width", "height"))
    matrix = root.need("camera_intrinsic")
    with matrix.blamed():
        size = (int(width), int(height)) if width and height else None
        camera = Camera.from_K(matrix.rows(3), None, size)
    rotation, place = root.get("rotation"), root.get("translation")
    metres = place.numbers(3)[2] if place else None
    if rotation is None:
        return View(camera, height=metres)
    with rotation.blamed():
        down = 0.0 - _matrix_of(rotation.numbers(4))[2]  # against the ego frame's z axis; no -0.0
        return View.from_gravity(camera, down, metres if metres and metres > 0.0 else None)


def _records(content: Content) -> list[Field]:
    values = content.json[0].items() if _is_list(content) else list(content.json)
    return values if all(isinstance(row.value, dict) for row in values) else []


def _is_list(content: Content) -> bool:
    return len(content.json) == 1 and isinstance(content.json[0].value, list)


def _matrix_of(quaternion: list[float]) -> FloatArray:
    """Rotation (3, 3) of w, x, y, z."""
    w, x, y, z = np.array(quaternion) / math.hypot(*quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def format_nuscenes(view: View) -> str:
    """A record of calibrated_sensor.json: the inverse of `read_nuscenes`; the ego frame stands below the
    camera."""
    # the ground frame has x right, y down, z forward; the ego frame x forward, y left, z up
    ego_from_ground = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    rotation = to_quaternions((ego_from_ground @ view.R_camera_from_ground.T)[None])[0].tolist()
    size = view.camera.image_size
    record = {
        "translation": [0.0, 0.0, view.height or 0.0],
        "rotation": rotation,
        "camera_intrinsic": view.camera.K.tolist(),
        **({"width": size[0], "height": size[1]} if size else {}),
    }
    return json.dumps(record) + "\n"
