"""What looks wrong in a camera, in boxes and in answers: remarks, not errors, since each of it can be true.

A remark is "kind: details"; the kind is the same for all images that it is made of.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lens import LENSES
from groundpose.types import Camera, View

FAR_OFF = 0.2
"""Of the width or height: a principal point that is this far from the middle is remarkable."""
NARROWEST_DEG, WIDEST_DEG, WIDEST_FISHEYE_DEG = 3.0, 150.0, 240.0
"""Horizontal fields of view that cameras on the road have."""
STEEPEST_DEG = 45.0
BEYOND = 0.1
"""Of the width or height: boxes of labels end this far beyond the image, those of another image farther."""
SMALLEST = 2.0
"""Pixels of a side of a box."""

_ENDLESS = (math.inf, math.inf)
"""Of an image whose size is not known."""

Size = tuple[int, int]
Mask = NDArray[np.bool_]


def camera_remarks(view: View) -> list[str]:
    """Of camera and tilt; those of the image need the camera's `image_size`."""
    camera, said = view.camera, []
    if camera.image_size is not None:
        width, height = camera.image_size
        middle = ((width - 1) / 2, (height - 1) / 2)
        if abs(camera.cx - middle[0]) > FAR_OFF * width or abs(camera.cy - middle[1]) > FAR_OFF * height:
            said.append(
                f"principal point: ({camera.cx:g}, {camera.cy:g}) is far off the middle ({middle[0]:g}, "
                f"{middle[1]:g}) of the image; a camera of another image size?"
            )
        field, widest = _field_deg(camera, width, height)
        if not NARROWEST_DEG <= field <= widest:
            said.append(
                f"field of view: {field:.1f} deg across; is the focal length in pixels of this image?"
            )
    if abs(view.pitch) > math.radians(STEEPEST_DEG):
        said.append(f"pitch: {math.degrees(view.pitch):.0f} deg, expected a camera that looks along the road")
    return said


def _field_deg(camera: Camera, width: int, height: int) -> tuple[float, float]:
    """Degrees across the picture, and how many there can be; the most, where the lens ends within it.

    The circle that a fisheye draws may be narrower than the picture, rarely lower.
    """
    if camera.distortion is None or not LENSES[camera.lens].is_wide:
        return math.degrees(2.0 * math.atan(0.5 * width / camera.fx)), WIDEST_DEG
    ends = np.array([[camera.cx, -0.5], [camera.cx, height - 0.5]])
    angles = np.arccos(np.clip(camera.directions_of(ends)[:, 2], -1.0, 1.0))
    across = float(np.degrees(angles.sum()))
    return WIDEST_FISHEYE_DEG if math.isnan(across) else across, WIDEST_FISHEYE_DEG


def box_remarks(bboxes: FloatArray, size: Size | None) -> list[str]:
    """Of boxes (N, 4) left, top, right, bottom of an image (width, height), if that is known; NaN is not
    judged."""
    if _all_fit(bboxes, size or _ENDLESS) or not np.isfinite(bboxes).any():
        return []
    left, top, right, bottom = bboxes.T
    with np.errstate(invalid="ignore"):
        backward = int(((right < left) | (bottom < top)).sum())
        beyond = 0 if size is None else int((~_inside(bboxes, size)).sum())
    reading = "" if size is None else other_reading(bboxes, size)
    hint = f"; are they {reading}?" if reading else ""
    count, said = len(bboxes), []
    if _fractions(bboxes):
        return [f"boxes within 0..1: expected pixels{hint or '; are they fractions of the image?'}"]
    if backward:
        ask = hint or "; are they left, top, width, height?"
        said.append(f"boxes with right < left or bottom < top: {backward} of {count}{ask}")
    if size is not None and beyond:
        said.append(
            f"boxes outside the image: {beyond} of {count} end far beyond {size[0]} x {size[1]}"
            f"{hint or '; are they of another image size?'}"
        )
    return said


def answer_remarks(status: Collection[str]) -> list[str]:
    """Of N statuses: that none is "ok"."""
    if not len(status) or "ok" in status:
        return []
    counts = Counter(map(str, status))
    why = ", ".join(f"{count} {reason}" for reason, count in counts.most_common())
    return [f"no answer: none of {counts.total()} objects has a pose ({why})"]


def other_reading(bboxes: FloatArray, size: Size) -> str:
    """How boxes (N, 4) are probably meant, if not as left, top, right, bottom pixels; else "".

    At least two boxes, most of which cannot be of this image as they are, and all of which can when they are
    read in one of the other ways.
    """
    known = bboxes[np.isfinite(bboxes).all(axis=1)]
    if len(known) < 2 or 2 * _fits(known, size).sum() >= len(known):
        return ""
    if _fractions(known):
        return "fractions of the image's width and height"
    return next((name for name, read in _READINGS.items() if _fits(read(known), size).all()), "")


def _columns(*order: int) -> Callable[[FloatArray], FloatArray]:
    return lambda b: np.asarray(b[:, list(order)])


_READINGS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "left, top, width, height": lambda b: np.concatenate([b[:, :2], b[:, :2] + b[:, 2:]], axis=1),
    "left, top, right, bottom where the format has left, top, width, height": lambda b: np.concatenate(
        [b[:, :2], b[:, 2:] - b[:, :2]], axis=1
    ),
    "top, left, bottom, right": _columns(1, 0, 3, 2),
    "centre x, centre y, width, height": lambda b: np.concatenate(
        [b[:, :2] - 0.5 * b[:, 2:], b[:, :2] + 0.5 * b[:, 2:]], axis=1
    ),
}


def _fractions(bboxes: FloatArray) -> bool:
    """Whether all numbers are within 0..1, and not just a box in the corner."""
    known = bboxes[np.isfinite(bboxes)]
    return bool(len(known) and ((known >= 0.0) & (known <= 1.0)).all() and (known != np.round(known)).any())


def _inside(bboxes: FloatArray, size: Size) -> Mask:
    """(N,): which boxes do not end far beyond the image; NaN does not."""
    limit = np.array([*size, *size], dtype=float)
    with np.errstate(invalid="ignore"):
        return np.asarray(~((bboxes < -BEYOND * limit) | (bboxes > (1.0 + BEYOND) * limit)).any(axis=1))


def _fits(bboxes: FloatArray, size: Size) -> Mask:
    """(N,): which boxes have an area and are inside the image but for `BEYOND`."""
    sides = bboxes[:, 2:] - bboxes[:, :2]
    return np.asarray((sides >= SMALLEST).all(axis=1) & _inside(bboxes, size))


def _all_fit(bboxes: FloatArray, size: tuple[float, float]) -> bool:
    """Whether all boxes fit, in a tenth of the time for the few that an image has. Fractions never do."""
    (width, height), more = size, 1.0 + BEYOND
    return all(
        left >= -BEYOND * width
        and top >= -BEYOND * height
        and right <= more * width
        and bottom <= more * height
        and right - left >= SMALLEST
        and bottom - top >= SMALLEST
        for left, top, right, bottom in bboxes.tolist()
    )
