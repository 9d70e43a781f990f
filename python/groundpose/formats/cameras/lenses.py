"""From what a file says of the lens to a model of `groundpose.lens`, and from there to a camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.cameras.record import Record, bare, image_size, numbers, only
from groundpose.formats.fields import Field
from groundpose.lens import DEFAULT_LENS, LENSES
from groundpose.types import Camera

_MODEL_KEYS = (
    *("distortion_model", "camera_model", "model_type", "lens_model", "lens_type", "projection_model"),
    *("model", "camera_type", "type", "Camera.type", "Camera.model"),
)
_FISHEYE_KEYS = ("fisheye_model", "fisheye", "is_fisheye", "use_fisheye")
_NO_MODEL = (
    "",
    "none",
    "pinhole",
    "perspective",
    "linear",
    "nodistortion",
    "rectified",
    "undistorted",
    "0",
    "camera",
)
"""What files of cameras say instead of the name of a lens model; some say only that it is no panorama."""
_IDEAL_AT_ZERO = ("inversebrownconrady", "modifiedbrownconrady")
"""RealSense's models that are no model of ours, but move no point when their coefficients are 0."""
_NAMES = {name: lens for lens, model in LENSES.items() for name in model.names}
_OPENCV_COUNTS = (4, 5, 8, 12, 14)
NO_LENS = (DEFAULT_LENS, None)
COEFFICIENTS = (
    *(
        "distortion_coefficients",
        "dist_coeffs",
        "dist_coeff",
        "dist_coefs",
        "distortion_coeffs",
        "distortion",
    ),
    *("distortion_parameters", "dist", "D", "coeffs", "cam_dist"),
)


def named_lens(record: Record) -> Field | None:
    """The field that names the lens model: a name of `LENSES` is `lens_in` it; None: none does.

    Raises InputError for a model that groundpose has not, for two that differ, and for the parameters of a
    mirror or of spheres where the format has no place for them.
    """
    for key in ("xi", "mirror_parameters"):
        field = record.get(key)
        if field is not None and (isinstance(field.value, dict) or any(numbers(field))):
            field.fail("a pinhole camera or a fisheye", "an omnidirectional one")
    found: list[Field] = []
    for key in _MODEL_KEYS:
        field = record.get(key)
        if field is not None and not (isinstance(field.value, str) and _word(field) in _NO_MODEL):
            found.append(field)
    fisheye = record.get(*_FISHEYE_KEYS)
    if fisheye is not None and _is_true(fisheye):
        found.append(fisheye)
    for other in found[1:]:
        if lens_in(other) != lens_in(found[0]):
            other.fail(f"the lens model that {found[0].path} names")
    return found[0] if found else None


def lens_in(field: Field | None) -> str | None:
    """The lens model that a field of `named_lens` names; None: it names none. Raises InputError."""
    if field is None:
        return None
    if not isinstance(field.value, str) or bare(field.path.rpartition(".")[2]) in map(bare, _FISHEYE_KEYS):
        return "equidistant" if _is_true(field) else None
    word = _word(field)
    if word in _IDEAL_AT_ZERO:
        return word
    return _NAMES.get(word) or field.fail(f"one of {', '.join(_ros_names())} or none")


def _ros_names() -> list[str]:
    return [model.ros for model in LENSES.values()]


def _word(field: Field) -> str:
    return bare(field.text()).removeprefix("distortion")


def _is_true(field: Field) -> bool:
    if isinstance(field.value, (bool, int, float)):
        return bool(field.value)
    word = bare(field.text())
    if word in ("true", "yes", "on", "1"):
        return True
    return False if word in ("false", "no", "off", "0", "") else field.fail("true or false")


def listed(record: Record, *keys: str) -> tuple[str, tuple[float, ...] | None]:
    """Lens model and coefficients that stand as a list under one of the keys, in OpenCV's order."""
    name, field = named_lens(record), record.get(*(keys or COEFFICIENTS))
    given = numbers(field) if field else []
    return _lens(lens_in(name), given, field or name or record.field)


def by_name(record: Record, names: Record | None = None) -> tuple[str, tuple[float, ...] | None]:
    """Lens model and coefficients that stand each under its own key (k1, k2, p1 ...) of `names`."""
    lens, names = lens_in(named_lens(record)), names or record
    order = LENSES[lens if lens and _is_wide(lens) else "rational"].coefficients
    for key in LENSES["rational"].coefficients:
        field = names.get(key)
        if field is not None and key not in order and only(field):
            field.fail(f"{', '.join(order)} of the lens model {lens}", f"{key} beside them")
    return _lens(lens, [names.optional(key) for key in order], names.field)


def _is_wide(lens: str) -> bool:
    return lens in LENSES and LENSES[lens].is_wide


def _lens(lens: str | None, given: Sequence[float], field: Field) -> tuple[str, tuple[float, ...] | None]:
    """The model that these coefficients need, of the family that the file names. Raises InputError."""
    k = list(given)
    while k and k[-1] == 0.0:
        k.pop()
    if lens is not None and _is_wide(lens):
        names = LENSES[lens].coefficients
        if len(given) < len(names) or len(k) > len(names):
            said = f"{', '.join(names)} of the lens model {lens}"
            expected = "four coefficients of a fisheye" if lens == "equidistant" else said
            field.fail(expected, f"{len(given)} numbers")
        return lens, (*k, *[0.0] * (len(names) - len(k)))
    if not k:
        return DEFAULT_LENS, None
    if lens in _IDEAL_AT_ZERO:
        field.fail(f"zeros ({lens} is no lens model of groundpose)", f"{k[0]:g}, ...")
    counts = LENSES[lens].counts if lens == DEFAULT_LENS else _OPENCV_COUNTS
    room = max((count for count in counts if count <= len(given)), default=0)
    if len(k) > room:
        beyond = " (zeros behind them do no harm)" if len(k) > counts[0] else ""
        *first, last = map(str, counts)
        field.fail(f"none, {', '.join(first)} or {last} numbers{beyond}", f"{len(given)} numbers")
    model = DEFAULT_LENS if len(k) <= len(LENSES[DEFAULT_LENS].coefficients) else "rational"
    return model, (*k, *[0.0] * (len(LENSES[model].coefficients) - len(k)))


def pinhole(record: Record, fx: float, fy: float, cx: float, cy: float) -> FloatArray:
    """The matrix of these numbers; all 0 says that the camera is not calibrated."""
    if not any((fx, fy, cx, cy)):
        record.field.fail("a calibrated camera", "zeros alone: the camera is not calibrated")
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def finished(
    record: Record,
    field: Field,
    K: FloatArray,
    lens: tuple[str, tuple[float, ...] | None],
    size: tuple[int, int] | None = None,
) -> Camera:
    """The camera of a record that is read; `field` is blamed for what cannot be.

    Raises InputError, also for a key of the record that was passed over and looks as if it mattered.
    """
    record.refuse_unread()
    with field.blamed():
        return Camera.from_K(K, lens[1], size, lens[0])


def sized(record: Record, field: Field, K: FloatArray, lens: tuple[str, tuple[float, ...] | None]) -> Camera:
    """`finished` with the size of the picture that the record says."""
    return finished(record, field, K, lens, image_size(record))
