"""Tracks from the files that `groundpose track` writes as CSV or JSON lines.

`groundpose.formats.tracks` says what their columns mean.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, input_error, regular_file
from groundpose._core import InputError
from groundpose.formats.fields import Field, parse
from groundpose.formats.tracks import COLUMNS, KMH
from groundpose.tracking.tracks import Tracks

_TURN = "camera_heading_deg"
"""The column that tables written before it was added lack; a camera that stands does not need it."""
_OTHERS = ("id", "class", "frame", "object", "standing")
_NUMBERS = tuple(name for name in COLUMNS if name not in _OTHERS)
_KNOWN = ("time", "x", "z", "heading_deg", "right", "ahead", _TURN)
"""Numbers that each row has; of the others null or an empty cell is NaN."""
_SAME = 1e-5
"""Metres within which rounded places are the same."""
_REQUIRED = frozenset(COLUMNS) - {_TURN}
_LARGEST = 1e12
"""Of all numbers: squares of larger ones may be none."""
_DIGITS = 18
"""Of a frame's number; more are a name."""
_KITTI_WORDS = 17
_MARK = "heading_deg"
"""The column by which tracks are known."""


def _limits(name: str) -> tuple[float, float, str]:
    """The least and the largest number of a column, and what is said of others."""
    if "_sigma" in name:
        return 0.0, _LARGEST, "a standard deviation from 0"
    if name in ("length", "height", "width"):
        return 1e-6, _LARGEST, "metres above 0"
    if name == "facing_probability":
        return 0.0, 1.0, "a probability from 0 to 1"
    return -_LARGEST, _LARGEST, f"a number up to {_LARGEST:g}"


_LIMITS = {name: _limits(name) for name in _NUMBERS}


@dataclass(frozen=True, eq=False)
class TrackTable:
    """A file of tracks.

    Attributes:
        tracks: the rows by vehicle and time. Frames are numbered from 0 in the order of their times: a file
            says nothing of frames without a vehicle. It has no correlation of a place's errors to the right
            and forward: that is 0.
        frames: names of the frames by their number.
        bad: errors of the lines that were left out.
    """

    tracks: Tracks
    frames: dict[int, str | int]
    bad: tuple[InputError, ...]


def is_tracks(path: str | PathLike[str]) -> bool:
    """Whether a file has tracks as `groundpose track` writes them, by its first good line.

    Raises OSError; InputError for tracks as KITTI's text, which has neither times nor speeds.
    """
    for place, text in _lines(path):
        if not text.startswith("{"):
            _refuse_kitti(text, str(path))
            return _MARK in _cells(text)
        with suppress(InputError):  # a damaged line does not decide what a file is
            return _MARK in parse(text, place).value
    return False


def _refuse_kitti(text: str, place: str) -> None:
    words = text.split()
    if len(words) == _KITTI_WORDS and words[0].isdigit() and words[1].lstrip("-").isdigit():
        wanted = "tracks as CSV or JSON lines (groundpose track -o tracks.csv)"
        raise input_error(place, wanted, "KITTI's text, which has neither times nor speeds")


def _cells(text: str) -> list[str]:
    """Of a line of CSV; none of a text that is no CSV."""
    try:
        return next(csv.reader([text]), [])
    except csv.Error:
        return []


def read_tracks(path: str | PathLike[str]) -> TrackTable:
    """The tracks of a file that `groundpose track` wrote as CSV or JSON lines.

    A bad line costs itself alone: it is in `bad`.

    Raises:
        OSError: no such file. InputError: naming the file, which is of another kind or lacks a column.
    """
    if not is_tracks(path):
        raise input_error(str(path), "tracks as groundpose track writes them (.csv, .jsonl)", "another file")
    first = next(text for _, text in _lines(path))
    rows = _Rows()
    for line in _of_json(path) if first.startswith("{") else _of_csv(path):
        try:
            if isinstance(line, InputError):
                raise line
            rows.add(line)
        except InputError as error:
            rows.bad.append(error)
    return rows.table()


def _lines(path: str | PathLike[str]) -> Iterator[tuple[str, str]]:
    """The lines that are not blank, each with its place."""
    with regular_file(path).open(encoding="utf-8-sig", errors="surrogateescape") as stream:
        for number, line in enumerate(stream, 1):
            if line.strip():
                yield f"{path}:{number}", line.strip()


def _of_json(path: str | PathLike[str]) -> Iterator[Field | InputError]:
    for place, text in _lines(path):
        try:
            yield parse(text, place)
        except InputError as error:
            yield error


def _of_csv(path: str | PathLike[str]) -> Iterator[Field | InputError]:
    """Each row as the object that JSON lines have. Raises InputError for a table that lacks a column."""
    with regular_file(path).open(encoding="utf-8-sig", errors="surrogateescape", newline="") as stream:
        reader = csv.reader(stream)
        head = next(row for row in reader if "".join(row).strip())
        _refuse_lacking(head, str(path))
        while True:
            try:
                row = next(reader)
            except StopIteration:
                return
            except csv.Error as error:
                yield input_error(f"{path}:{reader.line_num}", "a row of CSV", error)
                continue
            if not row:
                continue
            place = f"{path}:{reader.line_num}"
            if len(row) != len(head):
                yield input_error(place, f"{len(head)} cells, as in the first line", len(row))
                continue
            yield Field({name: _cell(name, text) for name, text in zip(head, row, strict=True)}, place)


def _refuse_lacking(given: Collection[str], place: str) -> None:
    if _REQUIRED.issubset(given):
        return
    lacking = ", ".join(name for name in COLUMNS if name in _REQUIRED and name not in given)
    raise input_error(place, "the columns that groundpose track writes", f"none called {lacking}")


def _cell(name: str, text: str) -> Any:
    """The text of a cell as JSON has it."""
    if name == "class":
        return text
    if name == "frame":  # 000012 is a name, 12 a number
        is_number = text.isascii() and text.isdigit() and len(text) <= _DIGITS
        return int(text) if is_number and str(int(text)) == text else text
    if name == "standing":
        return {"True": True, "False": False}.get(text, text)
    try:
        return float(text) if text else None
    except ValueError:
        return text


@dataclass
class _Rows:
    """Rows as they come, checked against those before."""

    columns: dict[str, list[Any]] = field(default_factory=lambda: {name: [] for name in COLUMNS})
    bad: list[InputError] = field(default_factory=list)
    _frames: dict[float, str | int] = field(default_factory=dict)
    _times: dict[str | int, float] = field(default_factory=dict)
    _taken: set[tuple[int, float]] = field(default_factory=set)

    def add(self, line: Field) -> None:
        """One more. Raises InputError naming place and column."""
        if not isinstance(line.value, dict):
            line.fail("an object {...}")
        _refuse_lacking(line.value, line.place)
        numbers = _numbers(line)
        number, frame, time = _id(line), line.need("frame").label(), numbers["time"]
        if self._frames.get(time, frame) != frame or self._times.get(frame, time) != time:
            line.need("time").fail("one time for each frame", f"{time:g} of frame {frame} beside another")
        if (number, time) in self._taken:
            line.need("id").fail(
                "one row of a vehicle in each frame", f"another of {number} in frame {frame}"
            )
        self._frames[time], self._times[frame] = frame, time
        self._taken.add((number, time))
        index, standing = line.get("object"), line.need("standing")
        others = {
            "id": number,
            "class": "" if line.get("class") is None else line.need("class").text(),
            "frame": frame,
            "object": -1 if index is None else _whole(index, 0),
            "standing": standing.value
            if isinstance(standing.value, bool)
            else standing.fail("true or false"),
        }
        for name, value in (others | numbers).items():
            self.columns[name].append(value)

    def table(self) -> TrackTable:
        """All rows."""
        order = {time: number for number, time in enumerate(sorted(self._frames))}
        frames = {number: self._frames[time] for time, number in order.items()}
        return TrackTable(_tracks(self.columns, order).sorted(), frames, tuple(self.bad))


def _id(line: Field) -> int:
    return _whole(line.need("id"), 1)


def _whole(given: Field, least: int) -> int:
    value = given.number()
    good = value.is_integer() and least <= value < _LARGEST
    return int(value) if good else given.fail(f"a whole number from {least}")


def _numbers(line: Field) -> dict[str, float]:
    given = line.value
    found = {name: _number(line, name) for name in _NUMBERS if name != _TURN or given.get(_TURN) is not None}
    if _TURN not in found:
        moved = math.hypot(found["x"] - found["right"], found["z"] - found["ahead"])
        if moved > _SAME:  # of several vehicles the turn would follow, of one it does not
            line.child(None, f".{_TURN}").fail("the direction of a camera that moves; track again", "none")
        found[_TURN] = 0.0
    return found


def _number(line: Field, name: str) -> float:
    low, high, words = _LIMITS[name]
    value = line.value.get(name)
    if type(value) is float and low <= value <= high:
        return value  # the usual case, quickly
    given = line.need(name) if name in _KNOWN else line.get(name)
    if given is None:
        return math.nan
    number = given.number()
    return number if low <= number <= high else given.fail(words)


def _tracks(columns: dict[str, list[Any]], order: dict[float, int]) -> Tracks:
    def one(name: str) -> FloatArray:
        return np.array(columns[name], dtype=np.float64)

    def of(*names: str) -> FloatArray:
        return np.stack([one(name) for name in names], axis=1)

    heading, spread = np.radians(one("heading_deg")), of("x_sigma", "z_sigma") ** 2
    turned = heading - np.radians(one(_TURN))
    return Tracks(
        id=np.array(columns["id"], dtype=np.int64),
        name=np.array(columns["class"], dtype=str),
        frame=np.array([order[time] for time in columns["time"]], dtype=np.int64),
        time=one("time"),
        index=np.array(columns["object"], dtype=np.int64),
        place=of("x", "z"),
        place_covariance=spread[:, :, None] * np.eye(2),
        heading=heading,
        heading_sigma=np.radians(one("heading_sigma_deg")),
        facing_probability=one("facing_probability"),
        speed=one("speed_kmh") / KMH,
        speed_sigma=one("speed_sigma_kmh") / KMH,
        yaw_rate=np.radians(one("yaw_rate_deg")),
        yaw_rate_sigma=np.radians(one("yaw_rate_sigma_deg")),
        acceleration=one("acceleration"),
        acceleration_sigma=one("acceleration_sigma"),
        size=of("length", "height", "width"),
        size_sigma=of("length_sigma", "height_sigma", "width_sigma"),
        standing=np.array(columns["standing"], dtype=bool),
        seen_from=np.column_stack([of("right", "ahead"), np.arctan2(np.sin(turned), np.cos(turned))]),
    )
