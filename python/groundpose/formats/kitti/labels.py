"""KITTI's object labels, results, tracking labels and calibration files.

One line per object: type, truncated, occluded, alpha, bbox (4), height, width, length, x, y, z of the bottom
centre, rotation_y; metres, radians, frame of camera 0. Results add a score, tracking labels begin with frame
and track. Where the development kits write -1, -10 or -1000 for what is not known, so do these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TypeVar

import numpy as np

from groundpose._checks import input_error
from groundpose.formats.skips import Skips
from groundpose.types import Camera
from groundpose.vehicles.classes import TABLE

TYPES = (
    *("Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Person", "Cyclist", "Tram", "Misc"),
    "DontCare",
)
DONT_CARE = "DontCare"
TYPE_OF = {row.name: row.kitti_type for row in TABLE}
"""KITTI's type of each of our classes."""
CLASS_OF = {type_: next(c.name for c in TABLE if c.kitti_type == type_) for type_ in TYPE_OF.values()}
"""Our class of each of KITTI's types that is one of ours."""
_NUMBERS = 14
_TRACKING_COLUMNS = 2
_SHOWN = 60
"""Characters of a bad line in an error."""
T = TypeVar("T")


@dataclass(frozen=True)
class KittiLabel:
    """One line. `type` is KITTI's class ("Car", "Van", "Truck" ...), `occluded` its level 0 to 3."""

    type: str
    truncated: float
    occluded: int
    alpha: float
    bbox: tuple[float, float, float, float]
    height: float
    width: float
    length: float
    location: tuple[float, float, float]
    rotation_y: float
    score: float | None = None
    """Of a result; None in labels."""

    @property
    def has_pose(self) -> bool:
        """Whether size and place are known: not for regions to ignore and 2D detections."""
        return min(self.height, self.width, self.length) > 0.0 and self.location[2] > -100.0


@dataclass(frozen=True)
class TrackedLabel:
    """A line of a tracking label file."""

    frame: int
    track: int
    label: KittiLabel


def format_labels(labels: Iterable[KittiLabel]) -> str:
    """The text of a label or, with scores, of a result file."""
    return "".join(_line(label) for label in labels)


def format_tracking(rows: Iterable[TrackedLabel]) -> str:
    """The text of a tracking label file."""
    return "".join(f"{row.frame} {row.track} {_line(row.label)}" for row in rows)


def _line(label: KittiLabel) -> str:
    size = (label.height, label.width, label.length)
    numbers = (label.alpha, *label.bbox, *size, *label.location, label.rotation_y)
    text = " ".join(f"{value:.4f}" for value in numbers)
    score = "" if label.score is None else f" {label.score:.4f}"
    return f"{label.type} {label.truncated:.2f} {label.occluded} {text}{score}\n"


def read_labels(path: str | PathLike[str], skipped: Skips | None = None) -> list[KittiLabel]:
    """The labels or results of a file.

    Args:
        path: the file; line ends may be those of Windows, empty lines are nothing.
        skipped: takes lines that cannot be used, and the others are read; None: the first one is an error.

    Raises:
        OSError: no such file. InputError: a line that is none, with file and line.
    """
    return list(_each(path, skipped, label_of))


def read_tracking(path: str | PathLike[str], skipped: Skips | None = None) -> dict[int, list[TrackedLabel]]:
    """The labels of a tracking sequence by frame; see `read_labels`. A track twice in a frame is left out
    but for the first time."""
    found: dict[int, list[TrackedLabel]] = {}
    seen: set[tuple[int, int]] = set()
    for number, row in enumerate(_each(path, skipped, _tracked), 1):
        if row.track >= 0 and (row.frame, row.track) in seen:
            place = f"{path}: track {row.track} of frame {row.frame} (object {number} of the file)"
            if skipped is None:
                raise input_error(place, "each track once a frame", "twice")
            skipped.add("duplicate track", place)
            continue
        seen.add((row.frame, row.track))
        found.setdefault(row.frame, []).append(row)
    return found


def _each(path: str | PathLike[str], skipped: Skips | None, parse: Callable[[str], T]) -> Iterator[T]:
    text = Path(path).read_text(encoding="utf-8-sig", errors="surrogateescape")
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            yield parse(line)
        except _BadLineError as bad:
            if skipped is None:
                raise input_error(f"{path}:{number}", bad.expected, repr(line[:_SHOWN])) from None
            skipped.add(bad.reason, f"{path}:{number}: {line.strip()[:_SHOWN]!r}")


class _BadLineError(Exception):
    def __init__(self, reason: str, expected: str) -> None:
        super().__init__(reason)
        self.reason, self.expected = reason, expected


_COUNT = f"a type and {_NUMBERS} numbers"


def label_of(line: str, loose: bool = False) -> KittiLabel:
    """One line that is not empty; `loose` takes any type, decimal commas, and more columns, which say
    nothing."""
    name, *values = (line.replace(",", ".") if loose else line).split()
    if len(values) < _NUMBERS:
        raise _BadLineError("cut-off line", _COUNT)
    if len(values) > _NUMBERS + 1:
        if not loose:
            raise _BadLineError("too many values", f"{_COUNT}, or one more in results")
        values = values[:_NUMBERS]
    try:
        n = [float(x) for x in values]
        occluded = int(n[1])
    except (ValueError, OverflowError):
        raise _BadLineError("not a number", _COUNT) from None
    if not all(map(math.isfinite, n)):
        raise _BadLineError("not a finite number", f"{_COUNT}, all finite")
    if name not in TYPES and not loose:
        raise _BadLineError("unknown class", f"one of {', '.join(TYPES)}")
    box, place = (n[3], n[4], n[5], n[6]), (n[10], n[11], n[12])
    score = n[14] if len(n) > _NUMBERS else None
    return KittiLabel(name, n[0], occluded, n[2], box, n[7], n[8], n[9], place, n[13], score)


def loose_label(place: str, line: str) -> KittiLabel:
    """One line of a file that is nearly KITTI's. Raises InputError with its place, `file:number`."""
    return _loosely(place, line, lambda text: label_of(text, loose=True))


def loose_tracked_label(place: str, line: str) -> TrackedLabel:
    """The same of a tracking label file."""
    return _loosely(place, line, lambda text: _tracked(text, loose=True))


def _loosely(place: str, line: str, parse: Callable[[str], T]) -> T:
    try:
        return parse(line)
    except _BadLineError as bad:
        raise input_error(place, bad.expected, repr(line[:_SHOWN])) from None


def _tracked(line: str, loose: bool = False) -> TrackedLabel:
    head = line.split(maxsplit=_TRACKING_COLUMNS)
    if len(head) <= _TRACKING_COLUMNS:
        raise _BadLineError("cut-off line", f"frame, track, {_COUNT}")
    try:
        frame, track = int(head[0]), int(head[1])
    except ValueError:
        raise _BadLineError("not a number", f"frame, track, {_COUNT}") from None
    return TrackedLabel(frame, track, label_of(head[2], loose))


def format_calibration(camera: Camera) -> str:
    """A calibration file for one camera: P0 to P3 are the same, the laser scanner stands where it does."""
    P = np.hstack([camera.K, np.zeros((3, 1))])
    # KITTI's scanner frame: x forward, y left, z up
    scanner = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    rows = {
        **{f"P{i}": P for i in range(4)},
        "R0_rect": np.eye(3),
        "Tr_velo_to_cam": scanner,
        "Tr_imu_to_velo": np.eye(3, 4),
    }
    return "".join(f"{name}: {' '.join(f'{x:.12e}' for x in a.ravel())}\n" for name, a in rows.items())
