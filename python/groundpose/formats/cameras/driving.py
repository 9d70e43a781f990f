"""Cameras of data sets of driving: nuScenes, Waymo, Cityscapes, Argoverse.

Where a camera stands on the vehicle tells its tilt. Their images are free of distortion, but for Waymo's.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.cameras.lenses import NO_LENS, pinhole, sized
from groundpose.formats.cameras.record import Entry, Record, is_numbers, matrix, numbers
from groundpose.formats.fields import Field
from groundpose.lens import DEFAULT_LENS
from groundpose.types import Camera, View


def nuscenes_entries(record: Record) -> list[Entry]:
    """A record of nuScenes' calibrated_sensor.json; those of other sensors have no intrinsics."""
    value = record.field.value.get("camera_intrinsic")
    if not value:
        return []
    return [Entry((), partial(_read_nuscenes, record))]


def _read_nuscenes(record: Record) -> View:
    """Camera, tilt and height: the ego frame has x forward, y left, z up and stands on the ground.

    `rotation` is the quaternion w, x, y, z from the sensor to it. nuScenes' images are undistorted.
    """
    field = record.need("camera_intrinsic")
    record.ignore("camera_distortion")
    camera = sized(record, field, matrix(field), NO_LENS)
    rotation, place = record.get("rotation"), record.get("translation")
    metres = place.numbers(3)[2] if place else None
    if rotation is None:
        return View(camera, height=metres)
    with rotation.blamed():
        return tilted(camera, rotation_of(rotation.numbers(4)), metres if metres and metres > 0.0 else None)


def tilted(camera: Camera, vehicle_from_camera: FloatArray, height: float | None = None) -> View:
    """The view of a camera by its rotation (3, 3) into a frame whose z axis points up."""
    return View.from_gravity(camera, 0.0 - vehicle_from_camera[2], height)  # no -0.0


def rotation_of(quaternion: list[float]) -> FloatArray:
    """Rotation (3, 3) of w, x, y, z."""
    w, x, y, z = np.array(quaternion) / math.hypot(*quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


# right, down, forward of a camera in axes forward, left, up
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def waymo_entries(record: Record) -> list[Entry]:
    """Waymo's CameraCalibration as JSON: `intrinsic` is f_u, f_v, c_u, c_v, k1, k2, p1, p2, k3."""
    field = record.get("intrinsic")
    if field is None or not is_numbers(field, 9) or numbers(field)[1] == 0.0:  # a matrix has its zero there
        return []
    return [Entry((), partial(_read_waymo, record, field))]


def _read_waymo(record: Record, field: Field) -> View:
    """`extrinsic` is the transform (4, 4) from the camera, with axes forward, left, up, to the vehicle."""
    fx, fy, cx, cy, *k = numbers(field)
    lens = (DEFAULT_LENS, tuple(k) if any(k) else None)
    camera = sized(record, field, pinhole(record, fx, fy, cx, cy), lens)
    extrinsic = record.get("extrinsic")
    if extrinsic is None:
        return View(camera)
    if isinstance(extrinsic.value, dict):
        extrinsic = extrinsic.need("transform")
    found = numbers(extrinsic)
    if len(found) != 16:
        extrinsic.fail("a 4 x 4 matrix", f"{len(found)} numbers")
    with extrinsic.blamed():
        return tilted(camera, np.array(found).reshape(4, 4)[:3, :3] @ _OPTICAL)


def cityscapes_entries(record: Record) -> list[Entry]:
    """Cityscapes' camera.json: `intrinsic` with fx, fy, u0, v0 and `extrinsic` with angles and place."""
    field = record.get("intrinsic")
    if field is None or not isinstance(field.value, dict) or not {"fx", "u0"} <= set(field.value):
        return []
    return [Entry((), partial(_read_cityscapes, record, field))]


def _read_cityscapes(record: Record, field: Field) -> View:
    """The vehicle frame has x forward, y left, z up from the ground.

    Its rotation from the camera's axes forward, left, up is `Rz(yaw) Ry(pitch) Rx(roll)`: a positive pitch
    looks down.
    """
    inner = Record(field)
    K = pinhole(inner, *(inner.number(key) for key in ("fx", "fy", "u0", "v0")))
    inner.refuse_unread()
    camera = sized(record, field, K, NO_LENS)
    extrinsic = record.get("extrinsic")
    if extrinsic is None:
        return View(camera)
    placed = Record(extrinsic)
    pitch, roll, height = (placed.optional(key) for key in ("pitch", "roll", "z"))
    c, s = math.cos, math.sin
    up = np.array([-s(pitch), c(pitch) * s(roll), c(pitch) * c(roll)])  # row z of the rotation
    with extrinsic.blamed():
        return View.from_gravity(camera, 0.0 - up @ _OPTICAL, height if height > 0.0 else None)


_ARGOVERSE = tuple(f"focal_{part}_px_" for part in ("length_x", "length_y", "center_x", "center_y"))
_ARGOVERSE_2 = ("fx_px", "fy_px", "cx_px", "cy_px")


def argoverse_entries(record: Record) -> list[Entry]:
    """Argoverse's vehicle_calibration_info.json, and rows of Argoverse 2's intrinsics as JSON."""
    names = next((names for names in (_ARGOVERSE, _ARGOVERSE_2) if record.has(names[0])), None)
    return [Entry((), partial(_read_argoverse, record, names))] if names else []


def _read_argoverse(record: Record, names: tuple[str, ...]) -> View:
    """Coefficients of a lens are given for information alone: the published images are undistorted.

    The ego frame stands on the rear axle, so the height above the ground is not known.
    """
    record.ignore("distortion_coefficients_")
    K = pinhole(record, *(record.number(name) for name in names))
    K[0, 1] = record.optional("skew_")
    camera = sized(record, record.field, K, NO_LENS)
    placed = record.get("vehicle_SE3_camera_")
    if placed is None:
        return View(camera)
    rotation = placed.need("rotation")
    coefficients = rotation.need("coefficients") if isinstance(rotation.value, dict) else rotation
    with coefficients.blamed():
        return tilted(camera, rotation_of(coefficients.numbers(4)))
