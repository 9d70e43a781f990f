"""Cameras of texts that are neither YAML nor JSON nor XML: KITTI's calibration, COLMAP's cameras.txt."""

from __future__ import annotations

import re
from functools import partial

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose.calibration import kitti_lines, kitti_numbers
from groundpose.formats.cameras.record import Entry
from groundpose.formats.content import Content
from groundpose.lens import DEFAULT_LENS, LENSES
from groundpose.types import Camera, View

_KITTI = re.compile(r"P([0-9])|P_rect_([0-9]{2})|K_([0-9]{2})")
_KITTI_DEFAULT = ("P2", "P_rect_02")


def kitti_entries(content: Content) -> list[Entry]:
    """KITTI's lines P0 to P3, of which P2 is the usual one; the raw set's and KITTI-360's P_rect_00 ...

    K_00 ... with D_00 are the cameras of images that are not rectified.
    """
    lines = kitti_lines(content.text)
    if not any(line.startswith("P") and _KITTI.fullmatch(line) for line in lines):
        return []
    entries = []
    for name in lines:
        match = _KITTI.fullmatch(name)
        if match:
            digits = match[1] or match[2] or match[3]
            short = () if match[3] else (digits, f"image_{digits:0>2}", str(int(digits)))
            read = partial(_read_unrectified if match[3] else _read_kitti, content, name, digits)
            entries.append(Entry((name, *short), read, name in _KITTI_DEFAULT))
    only_rectified = [entry for entry in entries if not entry.names[0].startswith("K")]
    if len(only_rectified) == 1 and not only_rectified[0].is_default:
        (one,) = only_rectified
        entries = [Entry(entry.names, entry.read, entry is one) for entry in entries]
    return entries


def _line(content: Content, name: str, count: int) -> tuple[str, list[float]]:
    number, text = kitti_lines(content.text)[name]
    place = f"{content.place}:{number}: {name}"
    return place, kitti_numbers(place, text, count).tolist()


def _kitti_size(content: Content, name: str) -> tuple[int, int] | None:
    if name not in kitti_lines(content.text):
        return None
    width, height = _line(content, name, 2)[1]
    return int(width), int(height)


def _read_kitti(content: Content, name: str, digits: str) -> View:
    place, P = _line(content, name, 12)
    return _view(place, [P[0:3], P[4:7], P[8:11]], None, _kitti_size(content, f"S_rect_{digits}"))


def _read_unrectified(content: Content, name: str, digits: str) -> View:
    place, K = _line(content, name, 9)
    D = f"D_{digits}"
    k = _line(content, D, 5)[1] if D in kitti_lines(content.text) else []
    return _view(place, [K[:3], K[3:6], K[6:]], k if any(k) else None, _kitti_size(content, f"S_{digits}"))


def _view(
    place: str,
    K: list[list[float]],
    k: list[float] | None = None,
    size: tuple[int, int] | None = None,
    lens: str = DEFAULT_LENS,
) -> View:
    try:
        return View(Camera.from_K(K, k, size, lens))
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


_FISHEYE, _OPENCV = "equidistant", DEFAULT_LENS
_COLMAP: dict[str, tuple[str, tuple[int, ...]]] = {
    "SIMPLE_PINHOLE": (_OPENCV, ()),
    "PINHOLE": (_OPENCV, ()),
    "SIMPLE_RADIAL": (_OPENCV, (0,)),
    "RADIAL": (_OPENCV, (0, 1)),
    "OPENCV": (_OPENCV, (0, 1, 2, 3)),
    "FULL_OPENCV": ("rational", (0, 1, 2, 3, 4, 5, 6, 7)),
    "SIMPLE_RADIAL_FISHEYE": (_FISHEYE, (0,)),
    "RADIAL_FISHEYE": (_FISHEYE, (0, 1)),
    "OPENCV_FISHEYE": (_FISHEYE, (0, 1, 2, 3)),
    "FOV": ("field_of_view", (0,)),
}
"""Models of COLMAP: our lens model, and the places of their coefficients in it."""
_ONE_FOCAL_LENGTH = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE")
_COLMAP_LINE = re.compile(r"[0-9]+\s+[A-Z][A-Z0-9_]+\s+[0-9]{1,9}\s+[0-9]{1,9}(\s+\S+)+")


def colmap_entries(content: Content) -> list[Entry]:
    """COLMAP's cameras.txt: a line `CAMERA_ID MODEL WIDTH HEIGHT PARAMS` per camera."""
    lines = [(place, line) for place, line in content.lines if not line.startswith("#")]
    if not lines or not all(_COLMAP_LINE.fullmatch(line) for _, line in lines):
        return []
    return [Entry((line.split()[0],), partial(_read_colmap, place, line.split())) for place, line in lines]


def _read_colmap(place: str, words: list[str]) -> View:
    """COLMAP's image begins at its first pixel's corner, which is (-0.5, -0.5) here."""
    _, model, width, height, *rest = words
    if model not in _COLMAP:
        raise input_error(f"{place}: MODEL", f"one of {', '.join(_COLMAP)}", model)
    lens, places = _COLMAP[model]
    shared = model in _ONE_FOCAL_LENGTH
    given = kitti_numbers(f"{place}: PARAMS", " ".join(rest), (3 if shared else 4) + len(places)).tolist()
    fx, fy, cx, cy, *k = [given[0], *given] if shared else given
    size = (int(width), int(height))
    coefficients = (*k, *[0.0] * (LENSES[lens].counts[0] - len(k)))
    ideal = lens != _FISHEYE and not any(k)
    K = [[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]]
    return _view(place, K, None if ideal else list(coefficients), size, _OPENCV if ideal else lens)
