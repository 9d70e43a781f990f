"""Vehicles stood on a road: from places seen from above to poses in the world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.body_cache import measures
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.scene import Vehicle

# Fraction of moving vehicles with their lamps on, by light.
_LAMPS = {"night": 1.0, "dusk": 0.95, "shade": 0.5, "overcast": 0.4}
_LAMPS_OTHERWISE, _LAMPS_PARKED = 0.25, 0.02


@dataclass(frozen=True)
class Placed:
    """A vehicle of a frame without its pose; fields as in `Vehicle`. Low `lamps` (0 to 1) are on first."""

    class_name: str
    seed: int
    look_seed: int
    lamps: float
    state: str
    braking: bool
    steering: float


def standing(
    road: Road, light: str, placed: Sequence[Placed], centres: FloatArray, headings: FloatArray
) -> tuple[Vehicle, ...]:
    """Vehicles on the ground under their wheels. Seen from above their origins are at `centres` (N, 3), world
    headings (N,); `light` is the kind of the drive's light."""
    if not placed:
        return ()
    wheels = [measures(p.class_name, p.seed).wheels[:, [0, 2]] for p in placed]
    cos, sin = np.cos(headings), np.sin(headings)
    spots = [
        centre[[0, 2]] + np.stack([w[:, 0] * c + w[:, 1] * n, w[:, 1] * c - w[:, 0] * n], axis=1)
        for w, centre, c, n in zip(wheels, centres, cos, sin, strict=True)
    ]
    y, _ = road.surface(*np.concatenate(spots).T)
    heights = np.split(y, np.cumsum([len(w) for w in wheels])[:-1])
    lamps = _LAMPS.get(light, _LAMPS_OTHERWISE)
    vehicles = []
    for p, w, h, centre, c, n in zip(placed, wheels, heights, centres, cos, sin, strict=True):
        tilt, level = _on_plane(w, h)
        yaw = np.array([[c, 0.0, n], [0.0, 1.0, 0.0], [-n, 0.0, c]])
        vehicles.append(
            Vehicle(
                class_name=p.class_name,
                seed=p.seed,
                R_world=yaw @ tilt,
                t_world=np.array([centre[0], level, centre[2]]),
                look_seed=p.look_seed,
                lamps_on=p.lamps < (_LAMPS_PARKED if p.state == "parked" else lamps),
                braking=p.braking,
                state=p.state,
                steering=p.steering,
            )
        )
    return tuple(vehicles)


def _on_plane(wheels: FloatArray, heights: FloatArray) -> tuple[FloatArray, float]:
    """Rotation (3, 3) of a vehicle whose wheels (W, 2) x, z touch the ground at world y `heights`, in the
    frame of its heading, and the y of its origin: the plane nearest to the points under the wheels."""
    columns = np.column_stack([np.ones(len(wheels)), wheels])
    (level, across, along), *_ = np.linalg.lstsq(columns, heights, rcond=None)
    down = np.array([-across, 1.0, -along]) / math.sqrt(1.0 + across**2 + along**2)
    forward = np.array([0.0, along, 1.0]) / math.hypot(along, 1.0)
    right = _cross(down, forward)
    return np.column_stack([right, down, forward]), float(level)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of two vectors (3,); numpy's own is slow for one pair."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
