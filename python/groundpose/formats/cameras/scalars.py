"""Cameras as fx, fy, cx, cy or as a field of view: groundpose's own, RealSense, CARLA."""

from __future__ import annotations

import math
from functools import partial

from groundpose.formats.cameras.lenses import listed, pinhole, sized
from groundpose.formats.cameras.record import Entry, Record, image_size
from groundpose.formats.fields import Field
from groundpose.formats.frames import FRAME_MEMBERS, TILT_MEMBERS, read_view
from groundpose.types import Camera, View


def realsense_entries(record: Record) -> list[Entry]:
    """librealsense's intrinsics: fx, fy, ppx, ppy, model, coeffs."""
    return [Entry((), partial(_read_realsense, record))] if record.has("ppx") else []


def _read_realsense(record: Record) -> View:
    K = pinhole(record, *(record.number(name) for name in ("fx", "fy", "ppx", "ppy")))
    return View(sized(record, record.field, K, listed(record)))


def carla_entries(record: Record) -> list[Entry]:
    """CARLA's attributes of a camera: fov in degrees across image_size_x pixels."""
    is_carla = record.has("fov") and record.has("image_size_x", "width", "image_width")
    return [Entry((), partial(_read_carla, record))] if is_carla else []


def _read_carla(record: Record) -> View:
    """Its lens distortion is taken for none: as CARLA has it by default."""
    for name, default in (("lens_k", -1.0), ("lens_kcube", 0.0)):
        field = record.get(name)
        if field is not None and record.number(name) != default:
            field.fail(f"{default:g}, CARLA's default")
    record.ignore(*(f"lens_{name}" for name in ("x_size", "y_size", "circle_falloff", "circle_multiplier")))
    size, fov = image_size(record), record.need("fov")
    if size is None:
        record.field.fail("the height of the image beside its width", "none")
    record.refuse_unread()
    with fov.blamed():
        return View(Camera.from_fov(*size, math.radians(record.number("fov"))))


def own_entries(record: Record) -> list[Entry]:
    """A frame, of which only camera and tilt count, or a camera's and a tilt's members without the frame:
    `{"fx": ..., "fy": ..., "cx": ..., "cy": ...}`."""
    camera = record.field.value.get("camera")
    is_own = "fx" in record.field.value or (isinstance(camera, dict) and "fx" in camera)
    return [Entry((), partial(_read_own, record.field))] if is_own else []


def _read_own(root: Field) -> View:
    if "camera" not in root.value:
        tilt = {name: value for name, value in root.value.items() if name in TILT_MEMBERS}
        camera = {name: value for name, value in root.value.items() if name not in tilt}
        root = root.with_value({"camera": _with_size(camera), **tilt})
    root.members(FRAME_MEMBERS)
    return read_view(root)


def _with_size(camera: dict[str, object]) -> dict[str, object]:
    """`width` and `height` as `image_size`."""
    if "image_size" in camera or not {"width", "height"} <= set(camera):
        return camera
    sides = {"image_size": [camera["width"], camera["height"]]}
    return {name: value for name, value in camera.items() if name not in ("width", "height")} | sides
