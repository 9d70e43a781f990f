"""Views of the virtual drive as a calibration leaves them: one for all frames of a camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._checks import FloatArray

SIGHT = 80.0
"""Vehicles within so many metres show a calibration where the road is."""
PRIORS = gp.FramePriors(pitch_sigma=math.radians(0.1), roll_sigma=math.radians(0.1), height_sigma=0.01)
"""How well a calibration knows the road: as after 80 vehicles or more (`groundpose calibrate`)."""


def view_of(record: dict[str, Any], told: dict[str, Any], height: float | None) -> gp.View:
    """A frame's camera with this tilt."""
    c = record["camera"]
    camera = gp.Camera(c["fx"], c["fy"], c["cx"], c["cy"], image_size=tuple(c["image_size"]))
    return gp.View(camera, math.radians(told["pitch_deg"]), math.radians(told["roll_deg"]), height)


def bottoms(record: dict[str, Any]) -> FloatArray:
    """(M, 3) m, middles of the bottom faces of a frame's vehicles in the frame of the camera."""
    items = record["objects"]
    R = np.array([item["truth"]["R"] for item in items]).reshape(-1, 3, 3)
    boxes = np.array([item["_bbox_3d"] for item in items]).reshape(-1, 2, 3)
    middle: FloatArray = boxes.mean(axis=1)
    middle[:, 1] = boxes[:, 1, 1]
    t = np.array([item["truth"]["t"] for item in items]).reshape(-1, 3)
    return np.asarray((R @ middle[..., None])[..., 0] + t)


def road_view(records: list[dict[str, Any]]) -> gp.View:
    """Of a camera that stands: tilt and height against the plane through all vehicles in sight. The road may
    fall away from the camera: its tilt is another than that against the ground at the mast's foot."""
    first = view_of(records[0], records[0]["_tilt"], None)
    ground = first.R_camera_from_ground
    found = np.concatenate([bottoms(record) for record in records]) @ ground
    near = found[np.hypot(found[:, 0], found[:, 2]) < SIGHT]
    if len(near) < 3:
        return view_of(records[0], records[0]["_tilt"], records[0]["_tilt"]["camera_height"])
    right, forward, height = np.linalg.lstsq(
        np.column_stack([near[:, 0], near[:, 2], np.ones(len(near))]), near[:, 1], rcond=None
    )[0].tolist()
    length = math.sqrt(1.0 + right**2 + forward**2)
    down = ground @ np.array([-right, 1.0, -forward]) / length
    pitch, roll = -math.asin(down[2]), math.atan2(-down[0], down[1])
    return gp.View(first.camera, pitch, roll, height / length)


def mean_view(views: list[gp.View]) -> gp.View:
    """Of a car that sways: as its camera was mounted."""
    pitch, roll = (float(np.mean([getattr(view, name) for view in views])) for name in ("pitch", "roll"))
    return gp.View(views[0].camera, pitch, roll, views[0].height)
