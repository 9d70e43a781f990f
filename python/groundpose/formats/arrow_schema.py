"""Schemas of Arrow tables: frames that are to be estimated, and poses.

Both are kept stable: the number of `VERSION` stands in a schema's metadata under `VERSION_KEY` and grows when
a reader of the former version could not read the new one. Each column's unit and shape stand in its own
metadata. Lists are plain lists, which every engine knows. A number that there is not is NaN, as in
`PoseBatch`; null is what a row does not have. The columns of a pose are the fields of `PoseBatch`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

from groundpose._checks import input_error
from groundpose.formats.parquet import package
from groundpose.poses import ResultFields
from groundpose.types import Camera

FRAMES, POSES = "frames", "poses"
VERSION = "1"
SCHEMA_KEY, VERSION_KEY, FRAME_KEY = b"groundpose.schema", b"groundpose.version", b"groundpose.frame"
"""Of a schema's metadata; the last is of the frame, in a table of `PoseBatch.to_arrow`."""

Shape = tuple[int | str, ...]
_RESULT_TYPES = {
    "Text": "string",
    "Flag": "bool",
    "Number": "double",
    "Count": "int64",
    "FloatArray": "double",
    "NDArray[np.bool_]": "bool",
    "NDArray[np.int64]": "int64",
}
"""Arrow's types of the annotations of `ResultFields`."""


@dataclass(frozen=True)
class Column:
    """A column: its name, Arrow's type of one number, its shape for one row, its unit, and a word on it."""

    name: str
    type: str
    shape: Shape = ()
    unit: str = ""
    text: str = ""


RESULTS = tuple(
    Column(f.name, _RESULT_TYPES[str(f.type)], f.metadata["shape"], f.metadata["unit"])
    for f in fields(ResultFields)
    if f.name != "status"
)
"""The result fields of `PoseBatch`, in its order, without the status, which frames have too."""
OBJECTS = (
    Column("bbox", "double", (4,), "px", "left, top, right, bottom as given"),
    Column("scale_covariance", "double", ("M",), "m", "log scale of the model with the coefficients"),
    Column("scale_variance", "double", (), "", "of the log scale"),
    Column("position", "double", (3,), "m", "middle of the bottom face in the ground frame"),
    Column(
        "heading", "double", (), "rad", "in the ground frame: 0 away from the camera, pi / 2 to the right"
    ),
    Column("size", "double", (3,), "m", "length, height, width"),
    Column("size_sigma", "double", (3,), "m", "standard deviations of `size`"),
)
"""What `PoseBatch` has beside its result fields by object, and what follows from them."""
NETWORK = (
    Column("class_probabilities", "double", ("C",), "", "in the order of `groundpose.vehicles.CLASSES`"),
    Column("vehicle_probability", "double", (), "", "that there is a vehicle in the box"),
    Column("viewing_angle_probabilities", "double", (16,), "", "of the angle from which it is seen"),
    Column("keypoint_scores", "double", ("P",), "", "probability of each keypoint to be right"),
)
"""What `VehiclePoses` has beside it."""
LABELS = (
    Column("frame", "string", (), "", "which frame"),
    Column("time", "double", (), "s", "of the frame"),
    Column("image", "string", (), "", "file of the picture"),
    Column("status", "string", (), "", "of the object, or of a frame without objects"),
    Column("message", "string", (), "", "what is wrong with a bad frame"),
    Column(
        "object", "string", (), "", "which object of the frame; null in the row of a frame without objects"
    ),
    Column("class", "string", (), "", "of the object"),
    Column("detection_score", "double", (), "", "of its detector"),
    Column("model", "string", (), "", "`bundled:CLASS`, or a shape model as JSON"),
)
FRAME = (
    Column("error_dof", "double", (), "", "degrees of freedom of the errors, infinite: Gaussian"),
    Column("nominal_tilt_sigma", "double", (2,), "rad", "of pitch and roll"),
    Column("tilt_covariance", "double", (2, 2), "rad^2", "of pitch and roll"),
    Column("view", "view", (), "m, rad, px", "camera and tilt of the poses; `estimated` where they are"),
    Column("nominal_view", "view", (), "m, rad, px", "camera and tilt as given"),
    Column("remarks", "string", ("R",), "", "what looks wrong in the input"),
)
"""The same for all objects of a frame."""
POSE_COLUMNS = (*LABELS, *RESULTS, *OBJECTS, *NETWORK, *FRAME)
FRAME_COLUMNS = (
    Column("frame", "string", (), "", "which frame; required"),
    Column("time", "double", (), "s", "of the frame"),
    Column("image", "string", (), "", "file of the picture, relative to the folder of the tables"),
    Column("image_bytes", "binary", (), "", "the file's bytes instead"),
    Column("camera", "camera", (), "px", "as `Camera`; required"),
    Column("pitch", "double", (), "rad", "as `View`; null: 0"),
    Column("roll", "double", (), "rad", "as `View`; null: 0"),
    Column("height", "double", (), "m", "of the camera above the ground, if known"),
    Column("objects", "objects", (), "", "boxes with or without keypoints; null: a detector is asked"),
)
OBJECT_MEMBERS = (
    Column("object", "string", (), "", "which object; null: its number from 0"),
    Column("class", "string", (), "", "that a detector gives it"),
    Column("score", "double", (), "", "of the detector"),
    Column("bbox", "double", (4,), "px", "left, top, right, bottom; null or NaN: not known"),
    Column("model", "string", (), "", "with keypoints: `bundled:CLASS`, or a shape model as JSON"),
    Column("keypoints_2d", "double", ("P", 2), "px", "NaN or null: not seen"),
    Column("keypoint_scores", "double", ("P",), "", "of each, null: all weigh the same"),
)
COLUMNS = {FRAMES: FRAME_COLUMNS, POSES: POSE_COLUMNS}
REQUIRED = {FRAMES: ("frame", "camera"), POSES: tuple(c.name for c in POSE_COLUMNS)}
_CAMERA_TYPES = {"distortion": ("double", ("D",)), "image_size": ("int64", (2,)), "lens": ("string", ())}
ESTIMATED = ("pitch_sigma", "roll_sigma", "height_sigma", "agreeing", "height_conflict")
"""Numbers of an `EstimatedView` beside those of a `View`."""


@lru_cache
def schema_of(name: str) -> Any:
    """The `pyarrow.Schema` of "frames" or "poses". Raises InputError when pyarrow is not installed."""
    metadata = {SCHEMA_KEY: name.encode(), VERSION_KEY: VERSION.encode()}
    return package().schema([_field(column) for column in COLUMNS[name]], metadata)


@lru_cache
def arrow_type(kind: str, shape: Shape = ()) -> Any:
    """Arrow's type of a column."""
    if shape:
        return package().list_(arrow_type(kind, shape[1:]))
    if kind in ("double", "int64", "string", "bool", "binary"):
        return package().type_for_alias(kind)
    members = {"camera": _camera_members, "view": _view_members, "objects": _object_members}[kind]()
    inside = package().struct(members)
    return package().list_(inside) if kind == "objects" else inside


def _field(column: Column) -> Any:
    said = {"unit": column.unit, "shape": ", ".join(map(str, column.shape)), "description": column.text}
    metadata = {key: text for key, text in said.items() if text}
    return package().field(column.name, arrow_type(column.type, column.shape), metadata=metadata or None)


def _camera_members() -> list[Any]:
    kinds = {f.name: _CAMERA_TYPES.get(f.name, ("double", ())) for f in fields(Camera) if f.init}
    return [package().field(name, arrow_type(*kind)) for name, kind in kinds.items()]


def _view_members() -> list[Any]:
    arrow = package()
    scale = arrow.struct([("class", arrow.string()), ("mean", arrow.float64()), ("sigma", arrow.float64())])
    estimated = [(name, arrow.float64()) for name in ESTIMATED]
    estimated += [("covariance", arrow_type("double", (3, 3))), ("class_scales", arrow.list_(scale))]
    angles = [arrow.field(name, arrow.float64()) for name in ("pitch", "roll", "height")]
    return [
        arrow.field("camera", arrow_type("camera")),
        *angles,
        arrow.field("estimated", arrow.struct(estimated)),
    ]


def _object_members() -> list[Any]:
    return [_field(column) for column in OBJECT_MEMBERS]


def checked(table: Any, name: str, place: str) -> Any:
    """A table as one of the schema: its columns in order and of its types, those that may be missing added as
    nulls, others left out.

    Raises InputError naming `place`: another schema or version, a column that is missing or of another type.
    """
    schema = schema_of(name)
    _check_version(table.schema.metadata or {}, name, place)
    missing = [column for column in REQUIRED[name] if column not in table.column_names]
    if missing:
        got = f"none among {', '.join(map(str, table.column_names)) or 'no columns'}"
        raise input_error(place, f"the columns {', '.join(missing)} of {name}", got)
    arrow = package()
    columns = [
        _cast(table.column(field.name), field, place)
        if field.name in table.column_names
        else arrow.nulls(table.num_rows, field.type)
        for field in schema
    ]
    return arrow.Table.from_arrays(columns, schema=schema.with_metadata(table.schema.metadata))


def _cast(column: Any, field: Any, place: str) -> Any:
    if column.type == field.type:
        return column
    try:
        return column.cast(field.type)
    except (package().ArrowException, NotImplementedError):
        raise input_error(f"{place}: column {field.name}", str(field.type), str(column.type)) from None


def _check_version(metadata: dict[bytes, bytes], name: str, place: str) -> None:
    """Tables without a word on it are judged by their columns."""
    of = metadata.get(SCHEMA_KEY, name.encode()).decode("utf-8", "replace")
    version = metadata.get(VERSION_KEY, VERSION.encode()).decode("utf-8", "replace")
    if of != name:
        raise input_error(place, f"a table of {name}", f"one of {of}")
    if version != VERSION:
        raise input_error(place, f"{name} of version {VERSION}", f"version {version}")
