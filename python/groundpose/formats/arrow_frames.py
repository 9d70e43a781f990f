"""Frames that are to be estimated as rows of Arrow tables: what `groundpose.fleet` and Parquet files give.

A row that cannot be used is a `BadRow`, which costs the others nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, blamed, input_error, shaped
from groundpose._core import InputError
from groundpose.formats.arrow_schema import FRAMES, checked, schema_of
from groundpose.formats.arrow_values import camera_of, camera_value, model_of, model_text
from groundpose.formats.boxes import Box, Boxes
from groundpose.formats.frames import Frame
from groundpose.formats.parquet import package
from groundpose.shape import ShapeModel
from groundpose.types import Camera, View

ByteArray = NDArray[np.uint8]
_NOT_SEEN = (math.nan, math.nan)


@dataclass(frozen=True)
class RowObject:
    """An object of a row: a box, and its keypoints (P, 2) where they are known."""

    id: str
    class_name: str
    score: float | None
    bbox: list[float] | None
    model: ShapeModel | None
    keypoints_2d: FloatArray | None
    keypoint_scores: list[float] | None


@dataclass(frozen=True)
class FrameRow:
    """A frame: `objects` are None where a detector is to find them; `picture` is a file's name, its bytes or
    its pixels (H, W, 3)."""

    frame: str
    time: float | None
    image: str | None
    picture: str | bytes | ByteArray | None
    view: View
    objects: tuple[RowObject, ...] | None

    @property
    def needs_picture(self) -> bool:
        """Whether no keypoints are known of it: not one of objects that there are."""
        return self.objects is None or any(o.keypoints_2d is None for o in self.objects)

    @property
    def boxes(self) -> Boxes:
        """Those of the objects, as a detector gives them."""
        nothing = [math.nan] * 4
        return Boxes(
            tuple(
                Box(
                    _box(o.bbox or nothing),
                    o.id,
                    o.class_name,
                    math.nan if o.score is None else o.score,
                )
                for o in self.objects or ()
            )
        )


@dataclass(frozen=True)
class BadRow:
    """A row that cannot be used, and why."""

    frame: str
    time: float | None
    image: str | None
    message: str


def frame_rows(given: Any, place: str = "frames") -> Iterator[FrameRow | BadRow]:
    """The rows of a table or record batch of frames.

    Raises InputError: a schema of another version, a column that is missing or of another type.
    """
    arrow = package()
    given = arrow.Table.from_batches([given]) if isinstance(given, arrow.RecordBatch) else given
    if not isinstance(given, arrow.Table):
        raise input_error(place, "a pyarrow Table or RecordBatch", type(given).__name__)
    table = checked(given, FRAMES, place)
    points = _keypoints(table.column("objects"))
    plain = _without_keypoints(table).to_pylist()
    for row, own in zip(plain, points, strict=True):
        yield _row(row, own)


def _row(row: Mapping[str, Any], points: Sequence[Any] | None) -> FrameRow | BadRow:
    label = row["frame"]
    said = (label or "", row["time"], row["image"])
    try:
        with blamed("row"):
            if label is None:
                raise input_error("frame", "a text", "null")
            if row["camera"] is None:
                raise input_error("camera", "a camera", "null")
            camera = tuple((k, tuple(v) if isinstance(v, list) else v) for k, v in row["camera"].items())
            view = _view(camera, row["pitch"], row["roll"], row["height"])
            listed = row["objects"]
            objects = (
                None if listed is None else tuple(map(_object, listed, points or (), range(len(listed))))
            )
            picture = row["image"] if row["image_bytes"] is None else row["image_bytes"]
            return FrameRow(*said, picture, view, objects)
    except InputError as error:
        return BadRow(*said, str(error))


@lru_cache(1024)
def _view(camera: tuple[tuple[str, Any], ...], pitch: Any, roll: Any, height: Any) -> View:
    return View(_camera(camera), pitch or 0.0, roll or 0.0, height)


@lru_cache(1024)
def _camera(members: tuple[tuple[str, Any], ...]) -> Camera:
    return camera_of(dict(members))


def _object(value: Mapping[str, Any] | None, points: Any, number: int) -> RowObject:
    where = f"objects[{number}]"
    if value is None:
        raise input_error(where, "an object", "null")
    text, bbox = value["model"], value["bbox"]
    if points is not None and text is None:
        raise input_error(f"{where}.model", "the model of the keypoints", "null")
    if bbox is not None and len(bbox) != 4:
        raise input_error(f"{where}.bbox", "4 numbers", len(bbox))
    scores = value["keypoint_scores"]
    return RowObject(
        id=str(number) if value["object"] is None else value["object"],
        class_name=value["class"] or "",
        score=value["score"],
        bbox=None if bbox is None else _known(bbox),
        model=None if points is None else model_of(text),
        keypoints_2d=None if points is None else _points(f"{where}.keypoints_2d", points),
        keypoint_scores=None if scores is None else _known(scores),
    )


def _known(numbers: Sequence[float | None]) -> list[float]:
    return [math.nan if x is None else x for x in numbers]


def _points(name: str, points: Any) -> FloatArray:
    if isinstance(points, np.ndarray):
        return points
    rows = [_NOT_SEEN if point is None else _known(point) for point in points]
    return shaped(name, np.array(rows) if rows else np.empty((0, 2)), ("P", 2))


def _box(values: Sequence[float]) -> tuple[float, float, float, float]:
    left, top, right, bottom = values
    return left, top, right, bottom


def _keypoints(column: Any) -> list[Sequence[Any] | None]:
    """Of each row, of each of its objects, keypoints (P, 2) as an array or nested lists; None: not known.

    A quarter of a million numbers a second come out of Arrow as Python's, hundreds of millions as arrays.
    """
    whole = column.combine_chunks()
    lists = whole.chunk(0) if hasattr(whole, "num_chunks") else whole
    valid = lists.is_valid().to_numpy(zero_copy_only=False)
    offsets = np.concatenate([[0], np.cumsum(np.diff(lists.offsets.to_numpy()) * valid)])
    objects = lists.flatten()
    place = [f.name for f in objects.type].index("keypoints_2d")
    each = _each(objects.flatten()[place])
    return [each[a:b] if ok else None for a, b, ok in zip(offsets[:-1], offsets[1:], valid, strict=True)]


def _each(lists: Any) -> list[Any]:
    valid = lists.is_valid().to_numpy(zero_copy_only=False)
    points = lists.flatten()
    if points.null_count or (np.diff(points.offsets.to_numpy()) != 2).any() or points.flatten().null_count:
        return list(lists.to_pylist())
    numbers = points.flatten().to_numpy().reshape(-1, 2)
    ends = np.concatenate([[0], np.cumsum(np.diff(lists.offsets.to_numpy()) * valid)]).tolist()
    return [
        numbers[a:b] if ok else None for a, b, ok in zip(ends[:-1], ends[1:], valid.tolist(), strict=True)
    ]


def _without_keypoints(table: Any) -> Any:
    """The table whose objects have lost their keypoints."""
    arrow, place = package(), table.column_names.index("objects")
    lists = [_stripped(chunk) for chunk in table.column(place).chunks]
    kind = lists[0].type if lists else table.schema.field(place).type
    return table.set_column(place, "objects", arrow.chunked_array(lists, type=kind))


def _stripped(lists: Any) -> Any:
    arrow, objects = package(), lists.flatten()
    kept = [f for f in objects.type if f.name != "keypoints_2d"]
    columns = dict(zip([f.name for f in objects.type], objects.flatten(), strict=True))
    made = arrow.StructArray.from_arrays(
        [columns[f.name] for f in kept], fields=kept, mask=objects.is_null() if objects.null_count else None
    )
    valid = lists.is_valid().to_numpy(zero_copy_only=False)
    offsets = np.concatenate([[0], np.cumsum(np.diff(lists.offsets.to_numpy()) * valid)])
    mask = arrow.array(~valid) if lists.null_count else None
    return arrow.ListArray.from_arrays(arrow.array(offsets, type=arrow.int32()), made, mask=mask)


def frames_table(frames: Sequence[Frame]) -> Any:
    """The table of frames with keypoints, as `groundpose.formats.frames` reads them."""
    rows = []
    for frame in frames:
        view = frame.view
        objects = [
            {
                "object": str(o.id),
                "class": o.model,
                "score": o.score,
                "bbox": o.bbox,
                "model": model_text(model),
                "keypoints_2d": o.keypoints_2d.tolist(),
                "keypoint_scores": o.keypoint_scores,
            }
            for o, model in zip(frame.objects, frame.models, strict=True)
        ]
        rows.append(
            {
                "frame": str(frame.id),
                "time": frame.time,
                "image": None if frame.image is None else str(frame.image),
                "camera": camera_value(view.camera),
                "pitch": view.pitch,
                "roll": view.roll,
                "height": view.height,
                "objects": objects,
            }
        )
    return package().Table.from_pylist(rows, schema=schema_of(FRAMES))
