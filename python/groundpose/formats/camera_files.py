"""Cameras for other tools: OpenCV's YAML, ROS's camera_info messages, nuScenes.

`groundpose.formats.calibrations` reads them, and those of more tools.
"""

from __future__ import annotations

import json

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.conversions import BODY_FROM_OBJECT, to_quaternions
from groundpose.lens import DEFAULT_LENS, LENSES
from groundpose.types import Camera, View


def format_opencv_yaml(camera: Camera) -> str:
    """As OpenCV's FileStorage writes it; read by it, by ROS and by `Camera.from_opencv_yaml`."""
    head = "%YAML:1.0\n---\n" + _size_lines(camera, "image_")
    model, distortion = ros_distortion(camera)
    head += _matrix("camera_matrix", camera.K) + f"distortion_model: {model}\n"
    return head + _matrix("distortion_coefficients", distortion.reshape(-1, 1))


def ros_distortion(camera: Camera) -> tuple[str, FloatArray]:
    """ROS's name of the lens model and the coefficients (n,); without distortion zeros of the default one."""
    if camera.distortion is None:
        model = LENSES[DEFAULT_LENS]
        return model.ros, np.zeros(len(model.coefficients))
    model = LENSES[camera.lens]
    return model.ros, np.array(
        model.shortest(camera.distortion) if len(model.counts) > 2 else camera.distortion
    )


def _matrix(name: str, a: FloatArray) -> str:
    rows, columns = a.shape
    data = ", ".join(repr(x) for x in a.ravel().tolist())
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n"


def format_camera_info(camera: Camera) -> str:
    """A camera_info message as ROS 1 prints it: for `rostopic pub` and readers of such files."""
    P = np.hstack([camera.K, np.zeros((3, 1))])
    model, distortion = ros_distortion(camera)
    rows = {"D": distortion, "K": camera.K, "R": np.eye(3), "P": P}
    lines = "".join(f"{name}: {json.dumps(a.ravel().tolist())}\n" for name, a in rows.items())
    return f"{_size_lines(camera, '')}distortion_model: {model}\n{lines}"


def _size_lines(camera: Camera, prefix: str) -> str:
    if camera.image_size is None:
        return ""
    width, height = camera.image_size
    return f"{prefix}height: {height}\n{prefix}width: {width}\n"


def format_nuscenes(view: View) -> str:
    """A record of calibrated_sensor.json; the ego frame stands below the camera."""
    rotation = to_quaternions((BODY_FROM_OBJECT @ view.R_camera_from_ground.T)[None])[0].tolist()
    size = view.camera.image_size
    record = {
        "translation": [0.0, 0.0, view.height or 0.0],
        "rotation": rotation,
        "camera_intrinsic": view.camera.K.tolist(),
        **({"width": size[0], "height": size[1]} if size else {}),
    }
    return json.dumps(record) + "\n"
