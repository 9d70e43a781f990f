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
from groundpose.formats.boxes import Box, Boxes, read_boxes
from groundpose.formats.kitti.labels import DONT_CARE, KittiLabel


def bboxes_of(detections: Any, image: str = "") -> FloatArray:
    """`left, top, right, bottom` pixels (N, 4) of what a detector gave; see `boxes_of`."""
    return np.array([box.bbox for box in boxes_of(detections, image).boxes], dtype=float).reshape(-1, 4)


def boxes_of(detections: Any, image: str = "") -> Boxes:
    """Boxes with scores and class names, as far as the detector gave any.

    Args:
        detections: what a detector gave for one image.
        image: its name, for a file with the boxes of several.

    Raises:
        TypeError: none of the kinds above. InputError: of that kind but not as it should be. OSError: no
        file.
    """
    if isinstance(detections, Boxes):
        return detections
    if isinstance(detections, (str, PathLike)):
        return read_boxes(Path(detections)).of(image)
    for suits, read in _KINDS:
        if suits(detections):
            return Boxes(tuple(read(detections)))
    raise type_error("detections", "boxes of a detector or an array (N, 4)", detections)


def _supervision(value: Any) -> list[Box]:
    names = (getattr(value, "data", None) or {}).get("class_name")
    return _boxes(value.xyxy, value.confidence, value.class_id if names is None else names)


def _ultralytics(value: Any) -> list[Box]:
    result = value[0] if isinstance(value, (list, tuple)) else value
    classes = np.atleast_1d(_plain(result.boxes.cls)).astype(int)
    names = [str(result.names[k]) for k in classes.tolist()]
    return _boxes(result.boxes.xyxy, result.boxes.conf, names)


def _torchvision(value: Any) -> list[Box]:
    return _boxes(value["boxes"], value.get("scores"), value.get("labels"))


def _coco(value: Sequence[Mapping[str, Any]]) -> list[Box]:
    given = [shaped(f"detections[{k}]['bbox']", row["bbox"], (4,)).tolist() for k, row in enumerate(value)]
    corners = [(x, y, x + width, y + height) for x, y, width, height in given]
    scores = [row.get("score", math.nan) for row in value]
    return _boxes(np.array(corners), scores, [row.get("category_name", "") for row in value])


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
    return _boxes(given[:, :4], given[:, 4] if given.shape[1] > 4 else None, None)


def _boxes(corners: Any, scores: Any, names: Any) -> list[Box]:
    """Boxes of arrays; names that are numbers say nothing."""
    rows = np.asarray(_plain(corners), dtype=float).reshape(-1, 4)
    values = np.full(len(rows), np.nan) if scores is None else np.asarray(_plain(scores), dtype=float)
    words = [""] * len(rows) if names is None else list(_plain(names))
    if len(values) != len(rows) or len(words) != len(rows):
        counts = f"{len(values)} scores, {len(words)} classes"
        raise input_error("detections", f"as many scores and classes as boxes ({len(rows)})", counts)
    return [
        Box((left, top, right, bottom), k, word if isinstance(word, str) else "", score)
        for k, ((left, top, right, bottom), score, word) in enumerate(
            zip(rows.tolist(), values.tolist(), words, strict=True)
        )
    ]


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
