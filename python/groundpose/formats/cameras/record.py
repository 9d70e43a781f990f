"""The record of a camera as a tool wrote it: keys in any spelling, numbers in any nesting.

A record knows what was read of it, and refuses what may not be passed over.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose._core import InputError
from groundpose.formats.fields import Field
from groundpose.types import View


@dataclass(frozen=True)
class Entry:
    """One camera of a file: what it may be called (the first is shown), how it is read, and whether it is
    taken before the others when no name is given."""

    names: tuple[str, ...]
    read: Callable[[], View]
    is_default: bool = False


def bare(word: str) -> str:
    """A word in small letters and digits alone: `CameraMat`, `camera_mat`, `camera-mat` are the same."""
    return re.sub(r"[^a-z0-9]", "", word.lower())


# Keys that say something of the picture's geometry: not read, they must at least say nothing.
_MEANINGFUL = re.compile(r"dist(?!ance)|fisheye|omni|^xi$|mirror|skew|^roi|binning|^lens(?!name)|crop")


class Record:
    """The keys of a mapping in any spelling; remembers which were asked for."""

    def __init__(self, field: Field) -> None:
        """Of a mapping."""
        if not isinstance(field.value, dict):
            field.fail("an object {...}")
        self.field = field
        self._keys: dict[str, list[str]] = {}
        for key in field.value:
            self._keys.setdefault(bare(key), []).append(key)
        self._asked: set[str] = set()

    def get(self, *names: str) -> Field | None:
        """The value under one of these names; None: absent or null. Raises InputError for two of them."""
        self._asked.update(map(bare, names))
        spelled = [key for name in dict.fromkeys(map(bare, names)) for key in self._keys.get(name, ())]
        found = [child for key in spelled if (child := self.field.get(key)) is not None]
        if len(found) > 1:
            found[1].fail("one of the two", f"{spelled[0]} and {spelled[1]}")
        return found[0] if found else None

    def need(self, *names: str) -> Field:
        """The value under one of these names, which must be there."""
        return self.get(*names) or self.field.need(names[0])

    def number(self, *names: str) -> float:
        """One number, which must be there."""
        return only(self.need(*names))

    def optional(self, *names: str) -> float:
        """One number, 0 where there is none."""
        field = self.get(*names)
        return only(field) if field else 0.0

    def has(self, *names: str) -> bool:
        """Whether one of these names is there with a value."""
        return any(
            self.field.value[key] is not None for name in names for key in self._keys.get(bare(name), ())
        )

    def ignore(self, *names: str) -> None:
        """Keys that are known and do not matter here."""
        self._asked.update(map(bare, names))

    def refuse_unread(self) -> None:
        """Raise InputError for a key that was not asked for and looks as if it mattered."""
        for name, keys in self._keys.items():
            if name in self._asked or not _MEANINGFUL.search(name):
                continue
            for key in keys:
                child = self.field.get(key)
                if child is not None and _says_something(child.value):
                    child.fail("a key that is read (this one may change what the camera sees)", f"{key!r}")


def _says_something(value: Any) -> bool:
    if isinstance(value, dict):
        return any(_says_something(item) for item in value.values())
    if isinstance(value, list):
        return any(_says_something(item) for item in value)
    if isinstance(value, str):
        return bare(value) not in ("", "none", "false", "0", "00")
    return bool(value)


def numbers(field: Field) -> list[float]:
    """All numbers of a value: a list, lists in a list, OpenCV's rows, cols and data, or a text of numbers.

    Raises InputError for anything else, for one that is not finite, and for other rows and cols than numbers.
    """
    value = field.value
    if isinstance(value, dict):
        data = numbers(field.need("data"))
        sides = [only(side) for name in ("rows", "cols") if (side := field.get(name))]
        if len(sides) == 2 and sides[0] * sides[1] != len(data):
            field.need("data").fail(f"{sides[0]:g} x {sides[1]:g} numbers", str(len(data)))
        return data
    if isinstance(value, list):
        if all(type(item) in (int, float) for item in value):
            return (
                [child.number() for child in field.items()] if not _finite(value) else list(map(float, value))
            )
        return [number for child in field.items() for number in numbers(child)]
    if isinstance(value, str):
        words = value.strip("()[] \t\r\n").replace(",", " ").split()
        try:
            found = [float(word) for word in words]
        except ValueError:
            found = []
        return found if (found or not words) and _finite(found) else field.fail("numbers")
    return [field.number()]


def _finite(values: list[Any]) -> bool:
    try:
        return all(map(math.isfinite, values))
    except OverflowError:
        return False


def only(field: Field) -> float:
    """One number. Raises InputError."""
    found = numbers(field)
    return found[0] if len(found) == 1 else field.fail("a number")


def is_numbers(field: Field | None, *counts: int) -> bool:
    """Whether a value holds this many numbers and nothing else."""
    if field is None or (isinstance(field.value, dict) and "data" not in field.value):
        return False
    try:
        return len(numbers(field)) in counts
    except InputError:
        return False


def matrix(field: Field, columns: int = 3) -> FloatArray:
    """A matrix (3, columns) in rows. Raises InputError."""
    found = numbers(field)
    if len(found) != 3 * columns:
        words = {9: "nine", 12: "twelve"}[3 * columns]
        field.fail(f"a 3 x {columns} matrix, {words} numbers", f"{len(found)} numbers")
    if not any(found):
        field.fail("a calibrated camera", "zeros alone: the camera is not calibrated")
    return np.array(found).reshape(3, columns)


_SIDES = (
    ("width", "image_width", "img_width", "Camera.width", "cols", "image_size_x", "width_px"),
    ("height", "image_height", "img_height", "Camera.height", "rows", "image_size_y", "height_px"),
)


def image_size(record: Record) -> tuple[int, int] | None:
    """Width and height in pixels, under the usual names; None: not said, or 0 as ROS says it."""
    pair = record.get("image_size", "resolution", "img_size", "size")
    if pair is not None:
        found = [(number, pair) for number in numbers(pair)]
        if len(found) != 2:
            pair.fail("width and height")
    else:
        sides = [record.get(*names) for names in _SIDES]
        found = [(only(side), side) for side in sides if side is not None]
    for side, field in found:
        if side < 0 or side != int(side):
            field.fail("a whole number of pixels")
    width, height = (int(side) for side, _ in found) if len(found) == 2 else (0, 0)
    return (width, height) if width and height else None
