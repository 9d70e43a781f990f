"""Boxes from lines of text: KITTI, YOLO, MOT Challenge and plain numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from groundpose._checks import input_error
from groundpose.formats.boxes.box import ANY, Box, Boxes, by_image, kept
from groundpose.formats.content import Content
from groundpose.formats.kitti.labels import DONT_CARE, KittiLabel, loose_label, loose_tracked_label
from groundpose.formats.skips import Skips
from groundpose.vehicles.words import numbered_name

Line = tuple[str, str]
"""Place `file:number` and text."""
_KITTI_COLUMNS = 15
_LOOKED_AT = 50


def lines_of(content: Content) -> list[Line]:
    """The lines that say something: neither blank nor comments."""
    return [line for line in content.lines if not line[1].startswith(("#", "//"))]


def _words(content: Content) -> list[list[str]]:
    """Columns of the first lines, apart by blanks, or by commas or semicolons and blanks."""
    if content.json or content.text.lstrip()[:1] == "<":
        return []
    return [re.split(r"[\s,;]+", text.strip(",; ")) for _, text in lines_of(content)[:_LOOKED_AT]]


def is_number(word: str) -> bool:
    """Whether it is a finite number."""
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _numeric(rows: list[list[str]], *counts: int) -> bool:
    """Whether most of the first lines are of so many numbers."""
    good = sum(len(row) in counts and all(map(is_number, row)) for row in rows)
    return bool(rows) and 2 * good > len(rows)


def is_kitti(content: Content) -> bool:
    """A word and 14 columns; also no text at all, which is how KITTI writes an image without objects."""
    if content.json:
        return False
    texts = lines_of(content)
    return not texts or _kitti_like(texts, 0)


def is_kitti_tracking(content: Content) -> bool:
    """Frame and track before KITTI's columns."""
    return not content.json and _kitti_like(lines_of(content), 2)


def _kitti_like(texts: Sequence[Line], before: int) -> bool:
    """Whether one of the first lines has the columns: numbers but for the word after `before` of them."""
    for _, text in texts[:_LOOKED_AT]:
        words = text.replace(",", ".").split()
        if len(words) < _KITTI_COLUMNS + before or text.startswith("<"):
            continue
        head, name, box = words[:before], words[before], words[before + 4 : before + 8]
        if not is_number(name) and all(map(is_number, head + box)):
            return True
    return False


def kitti(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Any names in any case; columns after the sixteenth say nothing here."""

    def read(line: Line, number: int) -> Box | None:
        return _kitti_box(loose_label(*line), number)

    return {ANY: Boxes(tuple(kept(lines_of(content), read, skipped)))}


def kitti_tracking(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """By the numbers of frames, from 0; the id is the track."""

    def read(line: Line, _: int) -> tuple[str, Box] | None:
        row = loose_tracked_label(*line)
        box = _kitti_box(row.label, row.track)
        return None if box is None else (str(row.frame), box)

    return by_image(kept(lines_of(content), read, skipped))


def _kitti_box(row: KittiLabel, number: int) -> Box | None:
    if row.type.casefold() == DONT_CARE.casefold():
        return None
    return Box(row.bbox, number, row.type, math.nan if row.score is None else row.score)


def is_yolo(content: Content) -> bool:
    """A class and fractions of the image: centre, width and height; or a polygon."""
    rows = [] if "," in content.text else _words(content)
    return bool(rows) and 2 * sum(map(_yolo_like, rows)) > len(rows)


def _yolo_like(row: list[str]) -> bool:
    fractions = len(row) >= 5 and all(map(is_number, row)) and re.fullmatch(r"\d+", row[0])
    return bool(fractions) and all(-0.5 <= float(word) <= 1.5 for word in row[1:5])


def yolo(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """`class x y width height`, with a score, with a track, or `class` and a polygon.

    Names of the classes stand in `classes.txt`, `obj.names` or the like beside the file or in the folder
    above; without them the numbers are those of COCO's 80 classes.
    """
    names = names_beside(Path(content.place))
    texts = lines_of(content)
    sixth = [row[5] for row in _words(content) if len(row) == 6]
    tracks = any(is_number(word) and float(word) > 1.0 for word in sixth)

    def read(line: Line, number: int) -> Box:
        row = numbers_of(line)
        kind = int(row[0])
        if len(row) < 5 or row[0] != kind:
            raise input_error(line[0], "a class and four numbers", repr(line[1][:60]))
        bbox, more = _yolo_bbox(row), row[5:] if len(row) <= 7 else []
        score = more[0] if more and not (tracks and len(more) == 1) else math.nan
        track = int(more[-1]) if len(more) == 2 or (more and tracks) else number
        name = names.get(kind, f"class {kind}") if names else numbered_name(kind)
        return Box(bbox, track, name, score, class_id=kind)

    return {ANY: Boxes(tuple(kept(texts, read, skipped)), fractions=True)}


def _yolo_bbox(row: list[float]) -> tuple[float, float, float, float]:
    if len(row) > 7 and len(row) % 2 and all(x <= 1.5 for x in row[1:]):
        xs, ys = row[1::2], row[2::2]
        return min(xs), min(ys), max(xs), max(ys)
    x, y, width, height = row[1:5]
    return x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height


def names_beside(path: Path, first: int = 0) -> dict[int, str]:
    """Names of classes, one a line, from the file with them beside a file of boxes or in the folder above."""
    for folder in (path.parent, path.parent.parent):
        for name in ("classes.txt", "obj.names", "labels.txt", "predefined_classes.txt"):
            file = folder / name
            if file.is_file() and file != path:
                texts = file.read_text(encoding="utf-8-sig", errors="replace").split("\n")
                return {first + k: text.strip() for k, text in enumerate(texts) if text.strip()}
    return {}


def is_mot(content: Content) -> bool:
    """Frame, track, four numbers, score or flag, and up to three more, apart by commas."""
    rows = _words(content)
    return "," in content.text and _numeric(rows, 7, 8, 9, 10) and all(_whole(row[:2]) for row in rows[:1])


def _whole(words: list[str]) -> bool:
    return all(is_number(word) and float(word) == int(float(word)) for word in words)


_MOT_NAMES = (
    "person, person on vehicle, car, bicycle, motorcycle, non motorized vehicle, static person, distractor, "
    "occluder, occluder on the ground, occluder full, reflection, crowd"
)
_MOT_CLASSES = dict(enumerate(_MOT_NAMES.split(", "), 1))
_MOT_TRUTH = (8, 9)
"""Columns of the truth: a flag, a class, a visibility. Detections and results have 7 or 10 and no class."""


def mot(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """By the numbers of frames, from 1; the id is the track, if it is not -1."""
    names = names_beside(Path(content.place), 1) or _MOT_CLASSES

    def read(line: Line, number: int) -> tuple[str, Box]:
        row = numbers_of(line)
        if not 7 <= len(row) <= 10:
            raise input_error(line[0], "7 to 10 numbers", repr(line[1][:60]))
        left, top, width, height = row[2:6]
        truth = len(row) in _MOT_TRUTH
        kind = int(row[7]) if truth else None
        name = "" if kind is None else names.get(kind, f"class {kind}")
        track = int(row[1]) if row[1] >= 0 else number
        bbox, score = (left, top, left + width, top + height), math.nan if truth else row[6]
        return str(int(row[0])), Box(bbox, track, name, score, class_id=kind)

    return by_image(kept(lines_of(content), read, skipped))


def is_numbers(content: Content) -> bool:
    """Lines of four to six numbers."""
    return _numeric(_words(content), 4, 5, 6)


def numbers(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """`left, top, right, bottom[, score[, class]]`, as in arrays."""

    def read(line: Line, number: int) -> Box:
        return numbered_box(numbers_of(line), number, line[0])

    return {ANY: Boxes(tuple(kept(lines_of(content), read, skipped)))}


def numbered_box(row: Sequence[float], number: int, place: str) -> Box:
    """A box of 4, 5 or 6 numbers; a class is one of COCO's 80."""
    if not 4 <= len(row) <= 6:
        raise input_error(place, "a list of 4 numbers, 5 with a score, 6 with a class", f"{len(row)}")
    kind = int(row[5]) if len(row) == 6 and math.isfinite(row[5]) else None
    name, score = "" if kind is None else numbered_name(kind), row[4] if len(row) > 4 else math.nan
    return Box((row[0], row[1], row[2], row[3]), number, name, score, class_id=kind)


def numbers_of(line: Line) -> list[float]:
    """The numbers of a line, all finite."""
    words = re.split(r"[\s,;]+", line[1].strip(",; "))
    if not all(map(is_number, words)):
        raise input_error(line[0], "finite numbers", repr(line[1][:60]))
    return [float(word) for word in words]
