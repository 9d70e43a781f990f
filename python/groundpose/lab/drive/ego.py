"""The car that carries the camera: its place on the road, its speed, its pitch and roll.

Pitch and roll each follow a damped spring driven by the car's own accelerations, by bumps that grow with
speed and by single potholes, plus a constant mounting error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.road_kinds import ROAD_KINDS, wave

FRAMES_PER_DRIVE = 20
FRAME_INTERVAL = 0.5
"""Seconds between frames."""
FRAME_TIMES: FloatArray = FRAME_INTERVAL * np.arange(FRAMES_PER_DRIVE, dtype=np.float64)
"""Of the frames of a drive, seconds."""

LENGTH, WIDTH, CAMERA_TO_FRONT = 4.6, 1.85, 1.8
"""Distance of the camera behind the front of the car, metres."""

HEIGHT = (1.2, 1.8)
"""Of the camera above the road where its rig does not say, metres."""

STEP = 0.01
"""Of the integration, seconds."""
_WARM_UP = 3.0  # seconds before the first frame, in which the springs settle

_MOUNT_STD_DEG = (0.6, 0.35)  # of the constant pitch and roll of a drive
_BUMP_STD_DEG = (0.5, 0.45)  # of pitch and roll on a road of roughness 1 at 10 m/s
_LEAN_DEG = (0.3, 0.35)  # of pitch and roll for an acceleration of 1 m/s^2
_FREQUENCY_HZ = (1.2, 1.8)
_DAMPING = (0.2, 0.4)
_POTHOLES_PER_M = 1 / 120
_POTHOLE_DEG = 1.2


@dataclass(frozen=True, eq=False)
class Ego:
    """The camera's motion; one value per frame. `s`, `d` of the road under the camera, `yaw` against the road
    (positive to the right), `height` of the camera above the plane of the road there; `pitch` and `roll` are
    added to the nominal tilt. `standing`: on a mast, not on a car."""

    s: FloatArray
    d: FloatArray
    yaw: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    pitch: FloatArray
    roll: FloatArray
    height: FloatArray
    standing: bool = False


def drive_along(rng: np.random.Generator, road: Road, lane_d: float, speed: float) -> Ego:
    """A drive from s = 0 in the lane at `lane_d` with a typical speed (m/s)."""
    kind = ROAD_KINDS[road.layout.kind]
    t = np.arange(-_WARM_UP, FRAMES_PER_DRIVE * FRAME_INTERVAL, STEP)
    # the car sometimes stops in towns; on a motorway its speed hardly changes
    change = 0.55 if speed < 14.0 else 0.12
    v = np.clip(speed * (1.0 + change * wave(rng, t, (6.0, 25.0))), 0.0, None)
    acceleration = np.clip(np.gradient(v, STEP), -6.0, 3.5)
    s = np.cumsum(v) * STEP
    first = round(_WARM_UP / STEP)
    s -= s[first]
    at = np.arange(first, len(t), round(FRAME_INTERVAL / STEP))[:FRAMES_PER_DRIVE]
    wander = rng.uniform(0.05, 0.3) * wave(rng, s, (60.0, 200.0))
    curvature = np.interp(s, road.start + 0.5 * np.arange(len(road.curvature)), road.curvature)
    roughness = rng.uniform(*kind.roughness)
    pitch = sway(rng, 0, acceleration, v, roughness)
    roll = sway(rng, 1, v**2 * curvature, v, roughness)
    moved = np.maximum(np.gradient(s, STEP), 1.0)
    return Ego(
        s=s[at],
        d=lane_d + wander[at],
        yaw=(np.gradient(wander, STEP) / moved)[at] + rng.normal(0.0, math.radians(0.5)),
        speed=v[at],
        acceleration=acceleration[at],
        pitch=pitch[at],
        roll=roll[at],
        height=np.full(len(at), rng.uniform(*HEIGHT)),
    )


def sway(
    rng: np.random.Generator, axis: int, acceleration: FloatArray, speed: FloatArray, roughness: float
) -> FloatArray:
    """Pitch (axis 0) or roll (1), radians: q'' + 2 zeta w q' + w^2 (q - lean) = bumps."""
    w, zeta = 2.0 * math.pi * rng.uniform(*_FREQUENCY_HZ), rng.uniform(*_DAMPING)
    lean = np.radians(_LEAN_DEG[axis]) * acceleration
    # White noise of intensity S moves a damped spring with a variance of S / (4 zeta w^3).
    std = np.radians(_BUMP_STD_DEG[axis]) * roughness * np.sqrt(speed / 10.0)
    bumps = std * math.sqrt(4.0 * zeta * w**3 / STEP) * rng.normal(size=len(speed))
    holes = rng.random(len(speed)) < _POTHOLES_PER_M * roughness * speed * STEP
    kicks = np.radians(_POTHOLE_DEG) * w / STEP * holes * rng.normal(size=len(speed))
    drive = w**2 * lean + bumps + kicks
    q, rate = float(lean[0]), 0.0
    swayed = np.empty(len(drive))
    for i, force in enumerate(drive.tolist()):
        rate += STEP * (force - 2.0 * zeta * w * rate - w**2 * q)
        q += STEP * rate
        swayed[i] = q
    return swayed + rng.normal(0.0, math.radians(_MOUNT_STD_DEG[axis]))
