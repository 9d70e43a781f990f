"""Readers of calibration files: paths in, plain numbers out."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose.lens import lens_of

Path_ = str | PathLike[str]


def read_kitti_projection(path: Path_, name: str = "P2") -> FloatArray:
    """The 3 x 4 projection matrix `name` of a KITTI calibration file (object, tracking or raw set).

    Raises `InputError` when the file has no such line or not twelve numbers in it.
    """
    for line in Path(path).read_text(encoding="utf-8").splitlines():
        key, _, values = line.strip().partition(" ")
        if key.rstrip(":") not in (name, name.replace("P", "P_rect_0")):
            continue
        try:
            numbers = [float(x) for x in values.split()]
        except ValueError:
            numbers = []
        if len(numbers) != 12:
            raise input_error(f"{path}: {name}", "twelve numbers", repr(values))
        return np.array(numbers).reshape(3, 4)
    raise input_error(str(path), f"a KITTI calibration file with a line {name}", "none")


def read_opencv_yaml(path: Path_) -> tuple[FloatArray, FloatArray, tuple[int, int] | None, str]:
    """`(K, distortion, image_size, lens)` from a file of OpenCV's FileStorage or of ROS camera_calibration.

    Read are `camera_matrix`, `distortion_coefficients` (absent: none), `image_width` and
    `image_height` (absent: None), in any spelling of upper and lower case, and the name of the lens
    model. Raises `InputError`.
    """
    text = Path(path).read_text(encoding="utf-8")
    K = _yaml_matrix(text, "camera_matrix")
    if K is None or K.size != 9:
        raise input_error(str(path), "a YAML file with a 3 x 3 camera_matrix", "none")
    distortion = _yaml_matrix(text, "distortion_coefficients")
    size = [re.search(rf"(?im)^image_{side}\s*:\s*(\d+)", text) for side in ("width", "height")]
    width, height = (int(match.group(1)) if match else None for match in size)
    image_size = (width, height) if width is not None and height is not None else None
    distortion = np.zeros(0) if distortion is None else distortion
    return K.reshape(3, 3), distortion, image_size, lens_of(text, str(path))


def _yaml_matrix(text: str, name: str) -> FloatArray | None:
    """The numbers of `data: [...]` below `name:`; both writers use this form and no other."""
    match = re.search(rf"(?ims)^{name}\s*:.*?^\s+data\s*:\s*\[(.*?)\]", text)
    if match is None:
        return None
    try:
        return np.array([float(x) for x in match.group(1).replace(",", " ").split()])
    except ValueError:
        return None
