"""Cameras of programs for odometry and mapping: Kalibr, EuRoC, Basalt, OpenVSLAM, ORB-SLAM, VINS."""

from __future__ import annotations

from functools import partial

from groundpose._checks import FloatArray
from groundpose.formats.cameras.lenses import COEFFICIENTS, NO_LENS, by_name, finished, listed, pinhole, sized
from groundpose.formats.cameras.record import Entry, Record, bare, numbers
from groundpose.formats.fields import Field
from groundpose.lens import DEFAULT_LENS, LENSES
from groundpose.types import Camera, View


def kalibr_entries(record: Record) -> list[Entry]:
    """One camera of Kalibr's camchain, or EuRoC's sensor.yaml: `intrinsics` is fu, fv, pu, pv."""
    field = record.get("intrinsics")
    is_list = (
        field is not None
        and isinstance(field.value, list)
        and not any(isinstance(x, list) for x in field.value)
    )
    named = record.has("camera_model", "distortion_model", "resolution")
    return [Entry((), partial(_read_kalibr, record))] if is_list and named and len(field.value) < 9 else []  # type: ignore[union-attr]


_KALIBR_SPHERES = {"ds": "double_sphere", "omni": "omnidirectional"}
"""Camera models of Kalibr whose intrinsics begin with what is a part of the lens model here."""


def _read_kalibr(record: Record) -> View:
    model = record.get("camera_model")
    if model is not None and isinstance(model.value, str) and bare(model.value) in _KALIBR_SPHERES:
        return _read_kalibr_sphere(record, _KALIBR_SPHERES[bare(model.value)])
    lens, field = listed(record), record.need("intrinsics")
    given = numbers(field)
    if len(given) != 4:
        field.fail("fu, fv, pu, pv of a pinhole camera", f"{len(given)} numbers")
    fx, fy, cx, cy = given
    return View(sized(record, field, pinhole(record, fx, fy, cx, cy), lens))


def _read_kalibr_sphere(record: Record, lens: str) -> View:
    """`intrinsics` is xi, alpha (of a double sphere), fu, fv, pu, pv."""
    field, behind = record.need("intrinsics"), listed(_without(record, "camera_model"))
    given, first = numbers(field), 2 if lens == "double_sphere" else 1
    if len(given) != first + 4:
        names = (*LENSES[lens].coefficients[:first], "fu", "fv", "pu", "pv")
        field.fail(f"{', '.join(names)} of the camera model {lens}", f"{len(given)} numbers")
    rest = _without(record, "camera_model")
    K = pinhole(rest, *given[first:])
    return View(_behind_sphere(rest, field, K, lens, given[:first], behind))


def _behind_sphere(
    record: Record,
    field: Field,
    K: FloatArray,
    lens: str,
    spheres: list[float],
    behind: tuple[str, tuple[float, ...] | None],
) -> Camera:
    """The camera of a lens of spheres, with or without the model of a plane behind them, which is read.

    Raises InputError for a model that may not stand there.
    """
    record.ignore("distortion_model", *COEFFICIENTS)
    model, k = behind
    count = len(LENSES[lens].coefficients) - len(spheres)
    k = k or (0.0,) * count
    if model != DEFAULT_LENS or any(k[count:]):
        expected = "k1, k2, p1, p2 of radtan" if count else "none"
        record.field.fail(f"{expected} as the distortion of the lens model {lens}", f"{model} with {list(k)}")
    return sized(record, field, K, (lens, (*spheres, *k[:count])))


def _without(record: Record, *names: str) -> Record:
    """The record without some of its keys."""
    left_out = set(map(bare, names))
    kept = {key: value for key, value in record.field.value.items() if bare(key) not in left_out}
    return Record(record.field.with_value(kept))


_BASALT = {
    "pinhole": (DEFAULT_LENS, ()),
    "kb4": ("equidistant", ("k1", "k2", "k3", "k4")),
    "ds": ("double_sphere", ("xi", "alpha")),
    "fov": ("field_of_view", ("w",)),
    "pinhole-radtan8": ("rational", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
}
"""Camera types of Basalt: our lens model, and its coefficients by their names there."""


def basalt_entries(record: Record) -> list[Entry]:
    """Basalt's calibration: a list `intrinsics` of `camera_type` and numbers by name, a list `resolution`."""
    field = record.get("intrinsics")
    if field is None or not isinstance(field.value, list):
        return []
    cameras = [
        child for child in field.items() if isinstance(child.value, dict) and "camera_type" in child.value
    ]
    return [
        Entry((f"cam{i}", str(i)), partial(_read_basalt, record, camera, i))
        for i, camera in enumerate(cameras)
    ]


def _read_basalt(record: Record, camera: Field, index: int) -> View:
    kind, values = camera.need("camera_type"), Record(camera.need("intrinsics"))
    if kind.text() not in _BASALT:
        kind.fail(f"one of {', '.join(_BASALT)}")
    lens, names = _BASALT[kind.text()]
    K = pinhole(values, *(values.number(name) for name in ("fx", "fy", "cx", "cy")))
    k = tuple(values.number(name) for name in names)
    sizes = record.get("resolution")
    size = None
    if sizes is not None and isinstance(sizes.value, list) and index < len(sizes.value):
        width, height = sizes.items()[index].numbers(2)
        size = int(width), int(height)
    return View(finished(values, camera, K, (lens, k) if k else NO_LENS, size))


def vins_entries(record: Record) -> list[Entry]:
    """VINS, camodocal and KITTI-360's fisheyes: `model_type` and `projection_parameters`."""
    is_vins = record.has("projection_parameters", "mirror_parameters")
    return [Entry((), partial(_read_vins, record))] if is_vins else []


def _read_vins(record: Record) -> View:
    """A KANNALA_BRANDT has its coefficients, k2 to k5, among the parameters of its projection, a MEI `xi`
    among those of its mirror."""
    field, distortion = record.need("projection_parameters"), record.get("distortion_parameters")
    inner = Record(field)
    if record.has("mirror_parameters"):
        mirror = Record(record.need("mirror_parameters"))
        rest = _without(record, "mirror_parameters", "model_type")
        K = pinhole(rest, *(inner.number(name) for name in ("gamma1", "gamma2", "u0", "v0")))
        behind = by_name(rest, Record(distortion) if distortion else None)
        return View(_behind_sphere(rest, field, K, "omnidirectional", [mirror.number("xi")], behind))
    if inner.has("mu"):
        named = {f"k{i}": inner.optional(f"k{i + 1}") for i in range(1, 5)}
        lens = by_name(record, Record(field.with_value(named)))
        names = ("mu", "mv", "u0", "v0")
    else:
        lens = by_name(record, Record(distortion) if distortion else None)
        names = ("fx", "fy", "cx", "cy")
    K = pinhole(record, *(inner.number(name) for name in names))
    return View(sized(record, field, K, lens))


def orb_entries(record: Record) -> list[Entry]:
    """A block `Camera.fx`, `Camera.k1` ... of ORB-SLAM and OpenVSLAM, or stella_vslam's mapping `Camera`."""
    name = record.field.path.rpartition(".")[2]
    is_block = name.lower().startswith("camera") and record.has("fx") and record.has("cx")
    said = is_block and record.has("k1", "model", "type", "setup", "cols", "fps", "bf", "p1", "RGB")
    return [Entry((), partial(_read_orb, record))] if said else []


def _read_orb(record: Record) -> View:
    lens = by_name(record)
    K = pinhole(record, *(record.number(name) for name in ("fx", "fy", "cx", "cy")))
    return View(sized(record, record.field, K, lens))
