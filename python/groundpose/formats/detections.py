"""Boxes of any detector, as it gives them; no detector has to be installed for that.

Taken are `supervision.Detections`, results of ultralytics (one, or the list of one that its models return), a
dictionary of torchvision's detectors, COCO results (dictionaries with `bbox`), KITTI labels or the path of
a text file, `Boxes` of `groundpose.formats.boxes`, and plain arrays (N, 4), (N, 5) with scores or (N, 6)
with classes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, float_array, input_error, shaped, type_error
from groundpose.formats import boxes
from groundpose.formats.boxes import Box, Boxes
from groundpose.formats.kitti.labels import DONT_CARE, KittiLabel
from groundpose.vehicles.words import first_number, numbered_name


def bboxes_of(detections: Any, image: str = "", size: tuple[int, int] | None = None) -> FloatArray:
    """`left, top, right, bottom` pixels (N, 4) of what a detector gave; see `boxes_of`."""
    return np.array([box.bbox for box in boxes_of(detections, image, size).boxes], dtype=float).reshape(-1, 4)


def boxes_of(detections: Any, image: str = "", size: tuple[int, int] | None = None) -> Boxes:
    """Boxes with scores, class names and tracks, as far as the detector gave any.

    Classes that are numbers without names are those of COCO, as detectors (from 0) or torchvision (from 1)
    count.

    Args:
        detections: what a detector gave for one image.
        image: its name, for a file with the boxes of several.
        size: its (width, height), for a file with fractions of the image or with boxes of another size.

    Raises:
        TypeError: none of the kinds above.
        InputError: of that kind but not as it should be.
        OSError: no such file.
    """
    if isinstance(detections, Boxes):
        return detections
    if isinstance(detections, (str, PathLike)):
        found = boxes.read_boxes(Path(detections)).of(image)
        if size is not None:
            return found.in_pixels(*size, str(detections))
        if found.fractions:
            raise input_error("size", f"(width, height) of the image, for {detections}", "none")
        return found
    for suits, read in _KINDS:
        if suits(detections):
            return Boxes(tuple(read(detections)))
    raise type_error("detections", "boxes of a detector or an array (N, 4)", detections)


def _supervision(value: Any) -> list[Box]:
    names = (getattr(value, "data", None) or {}).get("class_name")
    numbers = getattr(value, "class_id", None)
    return _boxes(value.xyxy, value.confidence, names, numbers, getattr(value, "tracker_id", None))


def _ultralytics(value: Any) -> list[Box]:
    result = value[0] if isinstance(value, (list, tuple)) else value
    classes = np.atleast_1d(_plain(result.boxes.cls)).astype(int)
    names = [str(result.names[k]) for k in classes.tolist()]
    tracks = getattr(result.boxes, "id", None)
    return _boxes(result.boxes.xyxy, result.boxes.conf, names, classes, tracks)


def _torchvision(value: Any) -> list[Box]:
    return _boxes(value["boxes"], value.get("scores"), None, value.get("labels"), first=1)


def _coco(value: Sequence[Mapping[str, Any]]) -> list[Box]:
    given = [shaped(f"detections[{k}]['bbox']", row["bbox"], (4,)).tolist() for k, row in enumerate(value)]
    corners = [(x, y, x + width, y + height) for x, y, width, height in given]
    scores = [row.get("score", math.nan) for row in value]
    names, numbers = ([row.get(name) for row in value] for name in ("category_name", "category_id"))
    first = first_number([n for n in numbers if isinstance(n, int)])
    return _boxes(np.array(corners), scores, names, numbers, [row.get("track_id") for row in value], first)


def _kitti(value: Sequence[KittiLabel]) -> list[Box]:
    rows = [row for row in value if row.type != DONT_CARE]
    scores = [math.nan if row.score is None else row.score for row in rows]
    return _boxes(np.array([row.bbox for row in rows]), scores, [row.type for row in rows])


def _array(value: Any) -> list[Box]:
    given = float_array("detections", _plain(value), "an array (N, 4), (N, 5) or (N, 6)")
    if given.size == 0:
        return []
    if given.ndim != 2 or given.shape[1] not in (4, 5, 6):
        raise input_error("detections", "shape (N, 4), (N, 5) or (N, 6)", f"shape {given.shape}")
    scores, classes = (given[:, k] if given.shape[1] > k else None for k in (4, 5))
    return _boxes(given[:, :4], scores, None, classes)


def _boxes(
    corners: Any, scores: Any, names: Any = None, numbers: Any = None, tracks: Any = None, first: int = 0
) -> list[Box]:
    """Boxes of columns that may be missing, as a whole or in a row; `first`: see `numbered_name`."""
    rows = np.asarray(_plain(corners), dtype=float).reshape(-1, 4)
    columns = [_column(given, len(rows)) for given in (scores, names, numbers, tracks)]
    if any(len(column) != len(rows) for column in columns):
        counts = f"{len(columns[0])} scores, {max(len(columns[1]), len(columns[2]))} classes"
        raise input_error("detections", f"as many scores and classes as boxes ({len(rows)})", counts)
    found = []
    for k, (bbox, score, word, number, track) in enumerate(zip(rows.tolist(), *columns, strict=True)):
        kind = int(number) if isinstance(number, (int, float)) and math.isfinite(number) else None
        name = str(word) if isinstance(word, str) else "" if kind is None else numbered_name(kind, first)
        label = k if track is None else int(track) if isinstance(track, float) else track
        found.append(
            Box(tuple(bbox), label, name, math.nan if score is None else float(score), class_id=kind)
        )
    return found


def _column(given: Any, count: int) -> list[Any]:
    """A column as a list; None for each row where it is missing."""
    plain = _plain(given)
    if plain is None:
        return [None] * count
    return plain.tolist() if isinstance(plain, np.ndarray) else list(plain)


def _plain(value: Any) -> Any:
    """A tensor of any library, on any device, as an array; everything else as it is."""
    for step in ("detach", "cpu", "numpy"):
        if hasattr(value, step):
            value = getattr(value, step)()
    return value


def _is_ultralytics(value: Any) -> bool:
    if isinstance(value, (list, tuple)):
        if len(value) > 1 and all(hasattr(one, "boxes") for one in value):
            raise input_error("detections", "the result of one image", f"{len(value)} results")
        value = value[0] if len(value) == 1 else None
    return hasattr(getattr(value, "boxes", None), "xyxy") and hasattr(value, "names")


def _all(kind: type[Any], member: str = "") -> Callable[[Any], bool]:
    """A list, not empty, of values of a kind, which have a member."""

    def suits(value: Any) -> bool:
        rows: list[Any] = list(value) if isinstance(value, (list, tuple)) else []
        return bool(rows) and all(isinstance(row, kind) and (not member or member in row) for row in rows)

    return suits


_KINDS: tuple[tuple[Callable[[Any], bool], Callable[[Any], list[Box]]], ...] = (
    (lambda value: hasattr(value, "xyxy") and hasattr(value, "confidence"), _supervision),
    (_is_ultralytics, _ultralytics),
    (lambda value: isinstance(value, Mapping) and "boxes" in value, _torchvision),
    (_all(Mapping, "bbox"), _coco),
    (_all(KittiLabel), _kitti),
    (lambda value: isinstance(value, (list, tuple, np.ndarray)) or hasattr(value, "__array__"), _array),
)
"""What a kind is known by, and its reader; asked in this order."""
