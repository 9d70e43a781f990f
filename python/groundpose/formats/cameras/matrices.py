"""Cameras as a matrix and a list of coefficients: OpenCV, ROS, Autoware, Open3D, MATLAB."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import partial

from groundpose._checks import FloatArray
from groundpose.formats.cameras.lenses import (
    COEFFICIENTS,
    NO_LENS,
    finished,
    listed,
    named_lens,
    pinhole,
    sized,
)
from groundpose.formats.cameras.record import Entry, Record, bare, is_numbers, matrix, numbers
from groundpose.formats.fields import Field
from groundpose.lens import DEFAULT_LENS
from groundpose.types import Camera, View

_MATRIX = (
    *("camera_matrix", "CameraMat", "K", "mtx", "intrinsic_matrix", "intrinsics", "intrinsic"),
    *("camera_intrinsics", "intrinsics_matrix", "cam_intrinsic", "cam_K"),
)
_PROJECTION = ("projection_matrix", "P")


def matrix_entries(record: Record) -> list[Entry]:
    """A camera matrix beside its coefficients; ROS's files have the "rectified" camera too."""
    names = set(map(bare, _MATRIX))
    if not any(_is_matrix(record.field.get(key)) for key in record.field.value if bare(key) in names):
        return []
    entries = [Entry(("raw",), partial(_read_raw, record), True)]
    projection = record.get(*_PROJECTION)
    if is_numbers(projection, 12) and projection is not None and any(numbers(projection)):
        entries.append(Entry(("rectified",), partial(_read_rectified, record, projection)))
    return entries


def _is_matrix(field: Field | None) -> bool:
    """Whether a value is meant to be a matrix: OpenCV's, or a list that is not fx, fy, cx, cy."""
    if field is None or not isinstance(field.value, (dict, list, str)):
        return False
    return "data" in field.value if isinstance(field.value, dict) else not is_numbers(field, 4, 5)


def _read_raw(record: Record) -> View:
    field = record.need(*_MATRIX)
    record.ignore("rectification_matrix", "R", *_PROJECTION)
    lens, window = listed(record), _window(record)
    camera = sized(record, field, _upright(field), lens)
    with record.field.blamed():
        return View(window.of(camera))


def _upright(field: Field) -> FloatArray:
    """The matrix; Open3D has it column by column."""
    K = matrix(field)
    columnwise = (
        bare(field.path.rpartition(".")[2]) == "intrinsicmatrix" and any(K[2, :2]) and not any(K[:2, 2])
    )
    return K.T if columnwise else K


def _read_rectified(record: Record, projection: Field) -> View:
    named_lens(record)
    record.ignore(*_MATRIX, *COEFFICIENTS)
    window = _window(record)
    camera = sized(record, projection, matrix(projection, 4)[:, :3], NO_LENS)
    with record.field.blamed():
        return View(window.of(camera))


@dataclass(frozen=True)
class _Window:
    """Which part of the sensor a picture is, and how many of its pixels make one, as ROS says it.

    `K` is that of the whole sensor; a pixel of `b` by `b` has its centre in the middle of theirs, at
    `(c + 0.5) / b - 0.5`.
    """

    offset: tuple[float, float]
    size: tuple[int, int] | None
    bins: tuple[float, float]

    def of(self, camera: Camera) -> Camera:
        """The camera of the picture."""
        if not any(self.offset) and self.size is None and self.bins == (1.0, 1.0):
            return camera
        (left, top), (bx, by), size = self.offset, self.bins, self.size or camera.image_size
        cx, cy = (camera.cx - left + 0.5) / bx - 0.5, (camera.cy - top + 0.5) / by - 0.5
        pixels = (int(size[0] / bx), int(size[1] / by)) if size else None
        return replace(camera, fx=camera.fx / bx, fy=camera.fy / by, cx=cx, cy=cy, image_size=pixels)


def _window(record: Record) -> _Window:
    """`roi`, `binning_x` and `binning_y` of a camera_info; absent or 0: the whole sensor, one by one."""
    bx, by = (max(1.0, record.optional(f"binning_{axis}")) for axis in "xy")
    field = record.get("roi")
    if field is None or not isinstance(field.value, dict):
        if field is not None and any(numbers(field)):
            field.fail("x_offset, y_offset, width and height, as ROS has them")
        return _Window((0.0, 0.0), None, (bx, by))
    region = Record(field)
    left, top, width, height = (region.optional(key) for key in ("x_offset", "y_offset", "width", "height"))
    return _Window((left, top), (int(width), int(height)) if width and height else None, (bx, by))


_SIDE = re.compile(r"(?:m|k|cameramatrix|intrinsics|intrinsic|mtx)(1|2|l|r|left|right)")
_SIDE_OF = {"1": ("1", "left"), "2": ("2", "right"), "l": ("left", "l"), "r": ("right", "r")}


def stereo_entries(record: Record) -> list[Entry]:
    """OpenCV's stereo calibration: M1, D1, M2, D2, or cameraMatrix1, distCoeffs1 ..."""
    entries = []
    for key in record.field.value:
        match = _SIDE.fullmatch(bare(key))
        if match and is_numbers(record.field.get(key), 9):
            names = (*_SIDE_OF.get(match[1], (match[1],)), key)
            entries.append(Entry(names, partial(_read_side, record.field, key, match[1])))
    return entries


def _read_side(field: Field, key: str, side: str) -> View:
    record = Record(field)
    lens = listed(record, *(f"{name}{side}" for name in COEFFICIENTS))
    record.ignore(*(name for name in field.value if re.fullmatch(r"dist.*(1|2|l|r|left|right)", bare(name))))
    matrix_field = record.need(key)
    return View(sized(record, matrix_field, matrix(matrix_field), lens))


def matlab_entries(record: Record) -> list[Entry]:
    """MATLAB's cameraParameters and cameraIntrinsics."""
    exact = record.field.value
    is_matlab = "IntrinsicMatrix" in exact or {"FocalLength", "PrincipalPoint"} <= set(exact)
    return [Entry((), partial(_read_matlab, record))] if is_matlab else []


def _read_matlab(record: Record) -> View:
    """Its matrix is transposed, its size height and width, and its first pixel is number 1."""
    focal, point = record.get("FocalLength"), record.get("PrincipalPoint")
    if focal is not None and point is not None:
        field, K = focal, pinhole(record, *_pair(focal), *_pair(point))
        record.ignore("IntrinsicMatrix", "K")
        K[0, 1] = record.optional("Skew")
    else:
        field = record.need("IntrinsicMatrix")
        K = matrix(field).T
    radial, tangential = (
        numbers(part) if (part := record.get(key)) else []
        for key in ("RadialDistortion", "TangentialDistortion")
    )
    for key, given, most in (("RadialDistortion", radial, 3), ("TangentialDistortion", tangential, 2)):
        if len(given) > most:
            record.need(key).fail(f"at most {most} numbers", str(len(given)))
    k1, k2, k3 = (*radial, 0.0, 0.0, 0.0)[:3]
    p1, p2 = (*tangential, 0.0, 0.0)[:2]
    record.ignore("EstimateSkew", "NumRadialDistortionCoefficients", "EstimateTangentialDistortion")
    sides = numbers(size) if (size := record.get("ImageSize")) else []
    K[:2, 2] -= 1.0
    k = (k1, k2, p1, p2, k3)
    lens = (DEFAULT_LENS, k if any(k) else None)
    return View(finished(record, field, K, lens, (int(sides[1]), int(sides[0])) if len(sides) == 2 else None))


def _pair(field: Field) -> tuple[float, float]:
    found = numbers(field)
    return (found[0], found[1]) if len(found) == 2 else field.fail("two numbers")
