"""Boxes from tables with named columns: CSV with a header, and JSON objects with the same names.

ultralytics' and supervision's JSON, pandas' records, COCO-like CSV of labelling tools are such tables.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from typing import Any

from groundpose._checks import input_error
from groundpose.formats.boxes.box import ANY, Box, Boxes, kept
from groundpose.formats.boxes.tools import entries, first
from groundpose.formats.content import Content
from groundpose.formats.fields import Field
from groundpose.formats.skips import Skips
from groundpose.vehicles.words import numbered_name

Row = dict[str, Field]
_COLUMNS = {
    "image": "image filename file_name file image_name image_path path img imageid image_id frame_name",
    "frame": "frame frame_number frame_id frame_index frame_no",
    "left": "xmin x_min x1 left bbox_left bbox_x1 box_x1 bbox_xmin xtl",
    "top": "ymin y_min y1 top bbox_top bbox_y1 box_y1 bbox_ymin ytl",
    "right": "xmax x_max x2 right bbox_right bbox_x2 box_x2 bbox_xmax xbr",
    "bottom": "ymax y_max y2 bottom bbox_bottom bbox_y2 box_y2 bbox_ymax ybr",
    "x": "x bbox_x box_x",
    "y": "y bbox_y box_y",
    "w": "w bbox_w bbox_width box_w box_width",
    "h": "h bbox_h bbox_height box_h box_height",
    "width": "width",
    "height": "height",
    "name": "class_name label category category_name labelname object_class vehicle_type name class type",
    "class_id": "class_id cls category_id label_id",
    "score": "score confidence conf probability",
    "track": "track_id tracker_id track object_id trackid id",
}
"""What columns are called, in lower case; the first that is there counts."""
_CORNERS, _CORNER = ("left", "top", "right", "bottom"), (("left", "x"), ("top", "y"))


def header(names: list[str]) -> dict[str, str]:
    """Our name of a column to the file's."""
    given = {name.strip().lower().replace(" ", "_").replace("-", "_"): name for name in names}
    found: dict[str, str] = {}
    for ours, theirs in _COLUMNS.items():
        there = next((given[name] for name in theirs.split() if name in given), None)
        if there is not None:
            found[ours] = there
    return found


def has_box(columns: Mapping[str, Any]) -> bool:
    """Whether there are four numbers of a box."""
    corner = all(any(name in columns for name in pair) for pair in _CORNER)
    size = {"w", "h"} <= set(columns) or {"width", "height"} <= set(columns)
    return set(_CORNERS) <= set(columns) or (corner and size)


def is_csv(content: Content) -> bool:
    """A first line of names, apart by commas, semicolons or tabs, four of which are those of a box."""
    first = content.text.lstrip().partition("\n")[0]
    return not content.json and first[:1] != "<" and has_box(header(_split(first)))


def _split(line: str) -> list[str]:
    return _cells(line.strip(), _delimiter(line))


def _cells(line: str, delimiter: str) -> list[str]:
    """The cells of a line; none of one that is no CSV."""
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return []


def _delimiter(line: str) -> str:
    return max(",;\t", key=line.count)


def csv_table(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """A row for each box; empty cells are not known."""
    lines = content.lines
    delimiter = _delimiter(lines[0][1])
    columns = header(_split(lines[0][1]))
    order = _split(lines[0][1])

    def cells(line: tuple[str, str]) -> Row:
        values = _cells(line[1], delimiter)
        if len(values) != len(order):
            raise input_error(line[0], f"{len(order)} columns", str(len(values)))
        by_name = dict(zip(order, values, strict=True))
        return {
            ours: Field(_value(by_name[theirs], delimiter), line[0], theirs)
            for ours, theirs in columns.items()
            if by_name[theirs].strip()
        }

    return _boxes(kept(lines[1:], lambda line, k: _box(cells(line), k), skipped))


def _value(text: str, delimiter: str) -> str | int | float:
    """A cell: a number if it is one; where columns are apart by semicolons, a comma may be in it."""
    bare = text.strip()
    try:
        number = float(bare.replace(",", ".") if delimiter == ";" else bare)
    except ValueError:
        return bare
    digits = bare.removeprefix("-")
    return int(bare) if digits.isdecimal() and len(digits) <= _LONGEST else number


_LONGEST = 18
"""Digits of a whole number."""


def is_rows(content: Content) -> bool:
    """A list of objects with the columns of a box, themselves or in a member `box` (ultralytics)."""
    one = first(content)
    return isinstance(one.value, dict) and has_box(_row(one))


def _row(field: Field) -> Row:
    """Members by our names; those of a member `box` count as the row's."""
    box = field.value.get("box") if isinstance(field.value, dict) else None
    members = {name: field.get(name) for name in field.value} if isinstance(field.value, dict) else {}
    if isinstance(box, dict):
        inner = field.need("box")
        members |= {name: inner.get(name) for name in box}
    given = {name: there for name, there in members.items() if there is not None and there.value != ""}
    return {ours: given[theirs] for ours, theirs in header(list(given)).items()}


def rows(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """A JSON object for each box; `class` may be a name or a number."""
    return _boxes(kept(entries(content), lambda field, k: _box(_row(field), k, field), skipped))


Found = tuple[str, Box, tuple[int, int] | None]


def _box(row: Row, number: int, whole: Field | None = None) -> Found:
    if not has_box(row):
        where = (whole or next(iter(row.values()))).where if row or whole else "a row"
        raise input_error(where, "four numbers of a box", f"only {', '.join(row) or 'nothing'}")
    size = None
    if set(_CORNERS) <= set(row):
        left, top, right, bottom = (row[name].number() for name in _CORNERS)
        if {"width", "height"} <= set(row):  # TensorFlow's tables have the image's beside the corners
            size = (int(row["width"].number()), int(row["height"].number()))
    else:
        left, top = (row[a if a in row else b].number() for a, b in _CORNER)
        width, height = (row[short if short in row else long].number() for short, long in _SIZES)
        right, bottom = left + width, top + height
    name, kind = _class(row)
    label = row.get("track")
    score = row["score"].number() if "score" in row else math.nan
    box = Box((left, top, right, bottom), label.label() if label else number, name, score, class_id=kind)
    key = row.get("image") or row.get("frame")
    return (ANY if key is None else str(key.label())), box, size


_SIZES = (("w", "width"), ("h", "height"))


def _class(row: Row) -> tuple[str, int | None]:
    """Name and number: either may be there, and a column `class` may have numbers."""
    given = [row[name].value for name in ("name", "class_id") if name in row]
    numbers = (value for value in given if isinstance(value, (int, float)))
    kind = next((int(value) for value in numbers if isinstance(value, int) or math.isfinite(value)), None)
    name = next((value for value in given if isinstance(value, str)), "")
    return name or ("" if kind is None else numbered_name(kind)), kind


def _boxes(found: list[Found]) -> dict[str, Boxes]:
    """By image, with the size that is said of it if it is no box's."""
    images: dict[str, list[Box]] = {}
    sizes: dict[str, tuple[int, int] | None] = {}
    for image, box, size in found:
        images.setdefault(image, []).append(box)
        sizes.setdefault(image, size)
    return {image: Boxes(tuple(boxes), size=sizes[image]) for image, boxes in images.items()}
