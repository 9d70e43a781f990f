"""Poses as an Arrow table, a row for each object, and back, bit for bit.

A frame without objects and a frame that cannot be estimated have one row, without an object, whose `status`
says so: `NO_OBJECTS` or `BAD_FRAME`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error, type_error
from groundpose.formats import arrow_schema as schemas
from groundpose.formats.arrow_lists import nested, own_parts, padded
from groundpose.formats.arrow_schema import FRAME_KEY, POSES, Column, arrow_type, checked, schema_of
from groundpose.formats.arrow_values import model_of, model_text, view_of, view_value
from groundpose.formats.parquet import package
from groundpose.poses import PoseBatch

NO_OBJECTS, BAD_FRAME = "no_objects", "bad_frame"
"""Statuses of the row of a frame without objects."""
_Batch = TypeVar("_Batch", bound=PoseBatch)
_FLAT = (*schemas.RESULTS, *schemas.OBJECTS, *schemas.NETWORK)
_MORE: dict[str, Callable[[PoseBatch], NDArray[Any]]] = {
    "bbox": lambda poses: poses.bboxes,
    "scale_covariance": lambda poses: poses.scale_covariance[:, :-1],
    "scale_variance": lambda poses: poses.scale_covariance[:, -1],
}
"""Columns that a batch does not have as a field of that name."""
_SHARED = ("error_dof", "nominal_tilt_sigma", "tilt_covariance")


@dataclass(frozen=True)
class Answer:
    """What came of one frame: its poses, or what was wrong with it.

    `objects`, `classes` and `scores` are of its N objects, None: by number, the model's name, none.
    """

    frame: str
    poses: PoseBatch | None = None
    message: str | None = None
    time: float | None = None
    image: str | None = None
    objects: Sequence[str] | None = None
    classes: Sequence[str] | None = None
    scores: Sequence[float | None] | None = None


def poses_table(answers: Sequence[Answer]) -> Any:
    """The table of frames, in order. Raises InputError when pyarrow is not installed."""
    arrow = package()
    counts = np.array([0 if a.poses is None else len(a.poses) for a in answers], dtype=np.int64)
    rows = np.repeat(np.arange(len(answers)), np.maximum(counts, 1))
    has_object = np.repeat(counts > 0, np.maximum(counts, 1))
    objects = [a for a, count in zip(answers, counts, strict=True) if count]
    columns = {**_labels(answers, rows, counts), **_of_frames(answers, rows)}
    own = _Objects.of([a.poses for a in objects if a.poses is not None])
    place = np.where(has_object, np.cumsum(has_object) - 1, 0)
    picked = None if has_object.all() else arrow.array(place, mask=~has_object)
    for column in _FLAT:
        made = own.column(column)
        columns[column.name] = made if picked is None else made.take(picked)
    schema = schema_of(POSES)
    return arrow.Table.from_arrays([columns[name] for name in schema.names], schema=schema)


@dataclass(frozen=True)
class _Objects:
    """All objects of some batches: of each the batch, and numbers of keypoints ("P") and modes ("M")."""

    batches: list[PoseBatch]
    sizes: list[dict[str, FloatArray]]
    ends: NDArray[np.int64]
    lengths: dict[int | str, NDArray[np.int64]]

    @classmethod
    def of(cls, batches: list[PoseBatch]) -> _Objects:
        sizes = [(len(model.keypoints_3d), model.modes) for poses in batches for model in poses.models]
        points, modes = np.array(sizes, dtype=np.int64).reshape(-1, 2).T
        both = [dict(zip(("size", "size_sigma"), poses.size_and_sigma(), strict=True)) for poses in batches]
        return cls(batches, both, np.cumsum([len(poses) for poses in batches]), {"P": points, "M": modes})

    def column(self, column: Column) -> Any:
        """The column of all objects; null where only a network says it."""
        arrow, kind = package(), arrow_type(column.type, column.shape)
        known = [
            sizes[column.name] if column.name in sizes else _values(column.name, poses)
            for sizes, poses in zip(self.sizes, self.batches, strict=True)
        ]
        values = [v for v in known if v is not None]
        if not values:
            return arrow.nulls(len(self.lengths["P"]), kind)
        if len(values) == len(known) and len({v.shape[1:] for v in values}) == 1:
            return self._made(column, [np.concatenate(values)], [slice(None)]).cast(kind)
        rows = [slice(b - len(p), b) for p, b in zip(self.batches, self.ends.tolist(), strict=True)]
        made = self._made(column, values, [r for r, v in zip(rows, known, strict=True) if v is not None])
        there = np.repeat([v is not None for v in known], [len(poses) for poses in self.batches])
        place = arrow.array(np.where(there, np.cumsum(there) - 1, 0), mask=~there)
        return made.cast(kind).take(place)

    def _made(self, column: Column, values: list[NDArray[Any]], rows: list[slice]) -> Any:
        """Of batches of unlike widths, whose objects are `rows` of all."""
        if not column.shape:
            return package().array(np.concatenate(values))
        own = [
            [
                self.lengths[n][r] if n in self.lengths else np.full(len(v), width)
                for n, width in zip(column.shape, v.shape[1:], strict=True)
            ]
            for v, r in zip(values, rows, strict=True)
        ]
        flat = np.concatenate([own_parts(v, lengths) for v, lengths in zip(values, own, strict=True)])
        return nested(flat, [np.concatenate(lengths) for lengths in zip(*own, strict=True)])


def _values(name: str, poses: PoseBatch) -> NDArray[Any] | None:
    """(N, ...) of a batch; None where only batches of a network have it."""
    values = _MORE[name](poses) if name in _MORE else getattr(poses, name, None)
    return None if values is None else np.asarray(values)


def _labels(answers: Sequence[Answer], rows: NDArray[np.intp], counts: NDArray[np.int64]) -> dict[str, Any]:
    arrow = package()
    listed: dict[str, list[Any]] = {
        name: [] for name in ("status", "object", "class", "detection_score", "model")
    }
    texts: dict[int, str] = {}
    for answer, count in zip(answers, counts.tolist(), strict=True):
        poses = answer.poses
        if poses is None or not count:
            status = NO_OBJECTS if poses is not None else BAD_FRAME
            said: tuple[Sequence[Any], ...] = ([status], [None], [None], [None], [None])
        else:
            for model in poses.models:
                if id(model) not in texts:
                    texts[id(model)] = model_text(model)
            models = [texts[id(model)] for model in poses.models]
            numbers = getattr(poses, "ids", range(count))
            classes = getattr(poses, "classes", [model.name for model in poses.models])
            said = (
                poses.status.tolist(),
                answer.objects or [str(label) for label in numbers],
                answer.classes or [str(name) for name in classes],
                answer.scores or [None] * count,
                models,
            )
        for column, values in zip(listed.values(), said, strict=True):
            column.extend(values)
    columns = {
        name: arrow.array(values, type=arrow_type("double" if name == "detection_score" else "string"))
        for name, values in listed.items()
    }
    for name, kind in (("frame", "string"), ("time", "double"), ("image", "string"), ("message", "string")):
        column = arrow.array([getattr(a, name) for a in answers], type=arrow_type(kind))
        columns[name] = column.take(arrow.array(rows))
    return columns


def _of_frames(answers: Sequence[Answer], rows: NDArray[np.intp]) -> dict[str, Any]:
    arrow = package()
    values = [None if a.poses is None else frame_values(a.poses) for a in answers]
    return {
        column.name: arrow.array(
            [None if v is None else v[column.name] for v in values],
            type=arrow_type(column.type, column.shape),
        ).take(arrow.array(rows))
        for column in schemas.FRAME
    }


def frame_values(poses: PoseBatch) -> dict[str, Any]:
    """What is the same for all objects of a batch."""
    shared = {name: np.asarray(getattr(poses, name)).tolist() for name in _SHARED}
    views = {name: view_value(getattr(poses, name)) for name in ("view", "nominal_view")}
    return {**shared, **views, "remarks": list(poses.remarks)}


def to_arrow(poses: PoseBatch, frame: str = "") -> Any:
    """The table of one batch, N rows; its schema's metadata has what a batch without objects would lose."""
    arrow = package()
    table = poses_table([Answer(frame, poses)])
    said = arrow.array([frame_values(poses)], type=arrow_type_of_frame())
    text = json.dumps(said.to_pylist()[0]).encode()
    table = table.replace_schema_metadata({**table.schema.metadata, FRAME_KEY: text})
    return table if len(poses) else table.slice(0, 0)


def arrow_type_of_frame() -> Any:
    """The struct of what is the same for all objects of a frame."""
    return package().struct([schema_of(POSES).field(column.name) for column in schemas.FRAME])


def from_arrow(cls: type[_Batch], given: Any) -> _Batch:
    """The batch of the table of one frame: a pyarrow Table or RecordBatch, a pandas DataFrame, or the list of
    `to_records`. Raises InputError, TypeError."""
    table = checked(_as_table(given), POSES, "poses")
    frames = table.column("frame").unique().to_pylist()
    if len(frames) > 1:
        raise input_error("poses", "the rows of one frame", f"those of {len(frames)} frames")
    shared = _shared(table)
    table = table.filter(package().compute.is_valid(table.column("object")))
    status = np.array(table.column("status").to_pylist(), dtype=np.str_)
    models = tuple(model_of(text) for text in table.column("model").to_pylist())
    values: dict[str, Any] = {"status": status, **_fields(table, schemas.RESULTS)}
    values |= {"bboxes": _fields(table, schemas.OBJECTS[:1])["bbox"], "models": models}
    values["scale_covariance"] = _scale(table)
    values |= {name: np.array(shared[name], dtype=float) for name in _SHARED[1:]}
    values["error_dof"] = shared["error_dof"]
    values |= {name: view_of(shared[name]) for name in ("view", "nominal_view")}
    return cls._of(values | _said_by_network(cls, table, shared))


def _as_table(given: Any) -> Any:
    arrow = package()
    if isinstance(given, arrow.Table):
        return given
    if isinstance(given, arrow.RecordBatch):
        return arrow.Table.from_batches([given])
    try:
        if isinstance(given, list):
            return arrow.Table.from_pylist(given, schema=schema_of(POSES))
        if type(given).__name__ == "DataFrame" and hasattr(given, "columns"):
            return _of_pandas(given)
    except (arrow.ArrowException, KeyError, AttributeError) as error:
        raise input_error("poses", "the columns of `PoseBatch.to_arrow`", error) from None
    raise type_error("poses", "a pyarrow Table, a pandas DataFrame or records", given)


def _of_pandas(given: Any) -> Any:
    """pyarrow's own way makes nulls of all NaN, and pandas NaN of texts that are null."""
    columns = {}
    for field in schema_of(POSES):
        values = list(given[field.name])
        if field.type == arrow_type("string"):
            values = [value if isinstance(value, str) else None for value in values]
        columns[field.name] = package().array(values, type=field.type, from_pandas=False)
    return package().table(columns, schema=schema_of(POSES).with_metadata(_metadata(given)))


def _metadata(given: Any) -> dict[bytes, bytes]:
    """What `PoseBatch.to_pandas` keeps of the schema's."""
    kept = getattr(given, "attrs", {})
    ours = {str(key): str(text) for key, text in kept.items() if str(key).startswith("groundpose.")}
    return {**schema_of(POSES).metadata, **{key.encode(): text.encode() for key, text in ours.items()}}


def _shared(table: Any) -> Mapping[str, Any]:
    """What is the same for all objects."""
    if table.num_rows:
        row: Mapping[str, Any] = table.select([c.name for c in schemas.FRAME]).slice(0, 1).to_pylist()[0]
        if row["view"] is None:
            said = table.column("message")[0].as_py()
            raise input_error("poses", "a frame that was estimated", f"a bad one: {said}")
        return row
    text = (table.schema.metadata or {}).get(FRAME_KEY)
    if text is None:
        raise input_error("poses", "a row, or the metadata of `PoseBatch.to_arrow`", "neither")
    stored: Mapping[str, Any] = json.loads(text)
    return stored


def _fields(table: Any, columns: Sequence[Column]) -> dict[str, NDArray[Any]]:
    ok = np.asarray(table.column("ok").to_pylist(), dtype=bool)
    return {column.name: _field(table, column, ok) for column in columns}


def _field(table: Any, column: Column, ok: NDArray[np.bool_]) -> NDArray[Any]:
    """One field (N, ...), filled as batches are."""
    shape = [n if isinstance(n, int) else None for n in column.shape]
    fill = 0 if column.type != "double" or "M" in column.shape else np.nan
    values = padded(table.column(column.name), shape, fill, f"poses: column {column.name}")
    if "M" in column.shape:
        values[~ok] = np.nan
    return values.astype(np.str_) if column.type == "string" else values


def _scale(table: Any) -> NDArray[np.float64]:
    with_shape, own = (
        padded(table.column(n), s, 0.0, n) for n, s in (("scale_covariance", [None]), ("scale_variance", []))
    )
    with_shape[np.isnan(own)] = np.nan
    return np.concatenate([with_shape, own[:, None]], axis=1)


def _said_by_network(cls: type[PoseBatch], table: Any, shared: Mapping[str, Any]) -> dict[str, Any]:
    """The further fields of `VehiclePoses`."""
    if "class_probabilities" not in cls.__dataclass_fields__:
        return {}
    labels = {name: table.column(name).to_pylist() for name in ("object", "class")}
    ids = np.empty(table.num_rows, dtype=object)
    ids[:] = labels["object"]
    return {
        **_fields(table, schemas.NETWORK),
        "classes": np.array(labels["class"], dtype=np.str_),
        "ids": ids,
        "seconds": {},
        "box_remarks": (),
    }
