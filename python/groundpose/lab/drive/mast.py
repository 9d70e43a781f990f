"""A camera that stands still on a mast beside the road or on a gantry above it."""

from __future__ import annotations

import math

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.ego import FRAME_TIMES, HEIGHT, Ego
from groundpose.lab.drive.rigs import Mount
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.road_kinds import wave

AHEAD, BEHIND = 110.0, 45.0
"""Lengths of road ahead of and behind a mast with traffic, metres."""

FREE = 3.0
"""Around a mast there is nothing beside the road within a square of this side, metres."""

# Fraction of cameras above a lane, by kind of road, and otherwise.
_ABOVE, _ABOVE_OTHERWISE = {"motorway": 0.5, "avenue": 0.3}, 0.15
# Distances at which the optical axis meets the ground, cut for the choice of the direction, metres.
_AIM = (8.0, 80.0)
# Largest angle to the road, and the spread around the direction of the target as a fraction of the view.
_LARGEST_TURN, _TURN_STD = math.radians(80.0), 0.12
_ERROR_STD_DEG = (0.5, 0.3)  # of the true pitch and roll against the nominal tilt
_SWAY_DEG, _SWAY_SECONDS = 0.04, (1.0, 5.0)


def stand(rng: np.random.Generator, road: Road, mount: Mount, t: FloatArray = FRAME_TIMES) -> Ego:
    """The camera of a drive that does not move, in frames at times `t` in seconds. It sees a lane or, where
    there is one, the junction."""
    layout = road.layout
    lane = layout.lanes[int(rng.integers(len(layout.lanes)))]
    if rng.random() < _ABOVE.get(layout.kind, _ABOVE_OTHERWISE):
        d = lane.d
    else:
        side = int(rng.choice([-1, 1]))
        room = (0.4, max(0.8, layout.pavement - 0.4)) if layout.kerb else (1.0, 4.0)
        d = side * (layout.edge(side) + rng.uniform(*room))
    height = mount.height if mount.height is not None else float(rng.uniform(*HEIGHT))
    away = height / math.tan(max(-mount.pitch, math.radians(1.0)))
    away = min(max(away, _AIM[0]), _AIM[1])
    across = layout.lanes[int(rng.integers(len(layout.lanes)))].d - d
    turn = math.asin(min(max(across / away, -1.0), 1.0))
    turn += rng.normal(0.0, _TURN_STD) * mount.fov
    turn = min(max(turn, -_LARGEST_TURN), _LARGEST_TURN)
    s = rng.uniform(0.0, 10.0)
    if road.junction is not None:
        before = road.junction.s - road.junction.half_width - 1.5
        s = min(max(road.junction.s - away * math.cos(turn) + rng.normal(0.0, 4.0), 0.0), before)
    pitch, roll = (
        math.radians(_SWAY_DEG) * wave(rng, t, _SWAY_SECONDS) + rng.normal(0.0, math.radians(std))
        for std in _ERROR_STD_DEG
    )
    still, ones = np.zeros(len(t)), np.ones(len(t))
    return Ego(s * ones, d * ones, turn * ones, still, still, pitch, roll, height * ones, standing=True)
