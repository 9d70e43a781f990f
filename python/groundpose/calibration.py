"""Projection matrices of KITTI's calibration files: a path in, plain numbers out."""

from __future__ import annotations

import re
from os import PathLike

import numpy as np

from groundpose._checks import FloatArray, finite, input_error, read_text

_LINE = re.compile(r"\s*([A-Za-z]\w*)(?:\s*:\s*|\s+)(\S.*)")


def kitti_lines(text: str) -> dict[str, tuple[int, str]]:
    """Names of a KITTI calibration text's lines, each with its number from 1 and what stands behind it."""
    lines = ((number, _LINE.match(line)) for number, line in enumerate(text.splitlines(), 1))
    return {match[1]: (number, match[2].strip()) for number, match in lines if match}


def kitti_numbers(place: str, text: str, count: int) -> FloatArray:
    """The finite numbers (count,) of a line. Raises InputError, which begins with `place`."""
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != count:
        words = {9: "nine", 12: "twelve"}
        raise input_error(place, f"{words.get(count, count)} numbers", repr(text[:80]))
    return finite(place, numbers)


def read_kitti_projection(path: str | PathLike[str], name: str = "P2") -> FloatArray:
    """The 3 x 4 projection matrix `name` of a KITTI calibration file (object, tracking or raw set).

    Raises `InputError` when the file has no such line or not twelve numbers in it.
    """
    lines = kitti_lines(read_text(path))
    for key in (name, name.replace("P", "P_rect_0")):
        if key in lines:
            number, text = lines[key]
            return kitti_numbers(f"{path}:{number}: {key}", text, 12).reshape(3, 4)
    raise input_error(str(path), f"a KITTI calibration file with a line {name}", "none")
