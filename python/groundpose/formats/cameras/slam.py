"""Cameras of programs for odometry and mapping: Kalibr, EuRoC, OpenVSLAM, ORB-SLAM, VINS."""

from __future__ import annotations

from functools import partial

from groundpose.formats.cameras.lenses import by_name, listed, pinhole, sized
from groundpose.formats.cameras.record import Entry, Record, numbers
from groundpose.types import View


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


def _read_kalibr(record: Record) -> View:
    lens, field = listed(record), record.need("intrinsics")
    given = numbers(field)
    if len(given) != 4:
        field.fail("fu, fv, pu, pv of a pinhole camera", f"{len(given)} numbers")
    fx, fy, cx, cy = given
    return View(sized(record, field, pinhole(record, fx, fy, cx, cy), lens))


def vins_entries(record: Record) -> list[Entry]:
    """VINS, camodocal and KITTI-360's fisheyes: `model_type` and `projection_parameters`."""
    is_vins = record.has("projection_parameters", "mirror_parameters")
    return [Entry((), partial(_read_vins, record))] if is_vins else []


def _read_vins(record: Record) -> View:
    """A KANNALA_BRANDT has its coefficients, k2 to k5, among the parameters of its projection."""
    field, distortion = record.need("projection_parameters"), record.get("distortion_parameters")
    inner = Record(field)
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
