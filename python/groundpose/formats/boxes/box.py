"""Boxes of images, and which of a file's are those of an image."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import PurePosixPath
from typing import TypeVar
from urllib.parse import unquote

from groundpose._checks import FloatArray, input_error
from groundpose._core import InputError
from groundpose.formats.skips import Skips
from groundpose.types import View
from groundpose.vehicles.words import NO_CLASS, vehicle_class

ANY = ""
"""The image of boxes that a file gives without naming an image."""
T = TypeVar("T")
S = TypeVar("S")


@dataclass(frozen=True)
class Box:
    """One box.

    Attributes:
        bbox: left, top, right, bottom pixels; NaN = not known.
        id: of the object, its track's if the file has tracks. name: the class that the file gives it, "" for
            none.
        score: of the detector, NaN for none. truth: its pose `(R, t)`, if the file has one.
        class_id: the number of its class, if the file has one.
    """

    bbox: tuple[float, float, float, float]
    id: str | int
    name: str = ""
    score: float = math.nan
    truth: tuple[FloatArray, FloatArray] | None = None
    class_id: int | None = field(default=None, compare=False)

    @property
    def is_vehicle(self) -> bool:
        """By its name."""
        return self.means_vehicle({})

    def means_vehicle(self, classes: Mapping[str, str]) -> bool:
        """By its name or the number of its class; `classes` as in
        `groundpose.vehicles.words.vehicle_class`."""
        number = str(self.class_id)
        meant = classes.get(number) or vehicle_class(self.name, classes)
        return meant != NO_CLASS


@dataclass(frozen=True)
class Boxes:
    """The boxes of one image, and its camera if the file has it.

    Attributes:
        size: (width, height) of the image that the file says the boxes are of; None: not said.
        fractions: whether the boxes are fractions of the image's width and height; `in_pixels` mends it.
        remarks: what was done to the boxes.
    """

    boxes: tuple[Box, ...]
    view: View | None = None
    size: tuple[int, int] | None = None
    fractions: bool = False
    remarks: tuple[str, ...] = ()

    def in_pixels(self, width: int, height: int, place: str = "boxes") -> Boxes:
        """The boxes in pixels of an image of this size.

        Boxes of the same image at another size are scaled, and a remark says so. Raises InputError when the
        file says a size of another aspect.
        """
        size, remarks = (width, height), self.remarks
        if self.size is None or self.size == size:
            scale = (float(width), float(height)) if self.fractions else (1.0, 1.0)
        else:
            scale = self._scale(size, place)
            there = f"{self.size[0]} x {self.size[1]}"
            remarks += (f"boxes of another image size: {place}: scaled from {there} to {width} x {height}",)
        if scale == (1.0, 1.0):
            return replace(self, size=size)
        boxes = tuple(replace(box, bbox=_scaled(box.bbox, *scale)) for box in self.boxes)
        return Boxes(boxes, self.view, size, remarks=remarks)

    def _scale(self, size: tuple[int, int], place: str) -> tuple[float, float]:
        assert self.size is not None
        (w, h), (width, height) = self.size, size
        slack = 1.0 + max(width / max(w, 1), height / max(h, 1))  # a pixel of either
        if min(w, h) < 1 or abs(w * height - h * width) > slack * max(w, h):
            turned = "; is the picture turned? --no-exif takes it as it is stored" if (h, w) == size else ""
            raise input_error(place, f"boxes of an image of {width} x {height}", f"of {w} x {h}{turned}")
        return (width, height) if self.fractions else (width / w, height / h)


def _scaled(bbox: tuple[float, float, float, float], x: float, y: float) -> tuple[float, float, float, float]:
    return (bbox[0] * x, bbox[1] * y, bbox[2] * x, bbox[3] * y)


@dataclass(frozen=True)
class BoxFile:
    """The boxes of a file: `images` maps the name of an image (or a number) to its boxes.

    Attributes:
        skipped: entries that are no boxes, which were left out.
        first_frame: the number that the file gives a video's first frame.
    """

    place: str
    images: Mapping[str, Boxes]
    skipped: Skips = field(default_factory=Skips)
    first_frame: int = 0

    @cached_property
    def _by_name(self) -> list[dict[str, list[str]]]:
        """Keys of `images` by what they may be called, the surest names first."""
        tables: list[dict[str, list[str]]] = [{} for _ in range(5)]
        for key in filter(None, self.images):
            for table, name in zip(tables, _names(key), strict=True):
                table.setdefault(name, []).append(key)
        return tables

    def of(self, image: str) -> Boxes:
        """The boxes of an image.

        Those of the same path, the same file name, the same name without what tools put before or behind it
        and without its ending, the same number, or those of any image. Raises InputError when the file has
        none for it, or several that are as good.
        """
        path = PurePosixPath(image.replace("\\", "/"))
        wanted = _names(str(path))
        for table, name in zip(self._by_name, wanted, strict=True):
            if name in table:
                return self.images[self._one(table[name], path)]
        if ANY in self.images:
            return self.images[ANY]
        return self._numbered(path)

    def frame(self, number: int) -> Boxes:
        """The boxes of a video's frame, from 0; none where the file numbers frames and has none of it."""
        if any(key.isdecimal() for key in self.images):
            return self.images.get(str(number + self.first_frame), Boxes(()))
        return self.of(f"{number:06d}")

    def _one(self, keys: list[str], path: PurePosixPath) -> str:
        """The key that has most folders of the path."""
        if len(keys) > 1:
            common = {key: _common_tail(PurePosixPath(_slashes(key)).parts, path.parts) for key in keys}
            best = [key for key in keys if common[key] == max(common.values())]
            if len(best) > 1:
                raise input_error(
                    self.place, f"boxes of one image named {path.name}", f"of {', '.join(best[:3])}"
                )
            keys = best
        return keys[0]

    def _numbered(self, path: PurePosixPath) -> Boxes:
        """By the number at the end of the name; frames in between that have no boxes are empty."""
        numbers = sorted(number for key in self.images if isinstance(number := whole(key), int))
        digits = re.search(r"\d+$", path.stem)
        if digits:
            number = int(digits[0])
            if str(number) in self.images:
                return self.images[str(number)]
            if numbers and numbers[0] <= number <= numbers[-1]:
                return Boxes(())
        elif len(self.images) == 1 and (numbers or PurePosixPath(self.place).stem == path.stem):
            return next(iter(self.images.values()))  # the only frame there is
        there = ", ".join(list(self.images)[:3]) + (", ..." if len(self.images) > 3 else "")
        raise input_error(self.place, f"boxes of {path.name}", f"none; it has {there}" if there else "none")


_UPLOAD = re.compile(r"^[0-9a-f]{8}(-[0-9a-f]{4}){0,3}-(?=.)")
"""What Label Studio puts before the names of uploads."""
_EXPORT = re.compile(r"_(jpe?g|png|bmp|webp|tiff?|ppm)\.rf\.\w+$", re.IGNORECASE)
"""What Roboflow puts behind them."""


def _slashes(name: str) -> str:
    bare = name.replace("\\", "/")
    if "://" in bare or "?" in bare:
        bare = unquote(re.split(r"[?#]", bare.partition("?d=")[2] or bare, maxsplit=1)[0])
    return bare


def _names(key: str) -> tuple[str, str, str, str, str]:
    """Path, file name, name without its ending, without what tools add, number."""
    path = _slashes(key)
    name = path.rpartition("/")[2]
    stem = name.rpartition(".")[0] or name
    plain = _EXPORT.sub("", _UPLOAD.sub("", stem))
    return path, name, stem, plain, stem.lstrip("0") or "0"


def _common_tail(one: tuple[str, ...], other: tuple[str, ...]) -> int:
    count = 0
    for a, b in zip(reversed(one), reversed(other), strict=False):
        if a != b:
            break
        count += 1
    return count


BAD = "entry without a box"


def kept(rows: Iterable[S], read: Callable[[S, int], T | None], skipped: Skips) -> list[T]:
    """What `read(row, number of those before it)` makes of rows; one that raises InputError costs itself
    alone.

    `None` is passed over. Where all of them raise it, the first error is that of the file.
    """
    found: list[T] = []
    first: InputError | None = None
    for row in rows:
        try:
            made = read(row, len(found))
        except InputError as error:
            first = first or error
            skipped.add(BAD, str(error))
            continue
        if made is not None:
            found.append(made)
    if first is not None and not found:
        raise first
    return found


def whole(text: str) -> str | int:
    """A name of digits as the number it is, if it is one of a usual length."""
    return int(text) if text.isdecimal() and len(text) <= _LONGEST else text


_LONGEST = 18


def by_image(pairs: Iterable[tuple[str, Box]], known: Iterable[str] = ()) -> dict[str, Boxes]:
    """Boxes by the image that each names; `known` are images that may have none."""
    found: dict[str, list[Box]] = {image: [] for image in known}
    for image, box in pairs:
        found.setdefault(image, []).append(box)
    return {image: Boxes(tuple(boxes)) for image, boxes in found.items()}
