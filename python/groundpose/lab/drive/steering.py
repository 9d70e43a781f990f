"""The angle of the front wheels of vehicles in traffic."""

from __future__ import annotations

import math

import numpy as np

from groundpose.lab.drive.body_cache import measures
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.traffic import Actor

LIMIT = math.radians(32.0)
"""Largest steering angle, radians."""

# Fraction of parked vehicles whose wheels were left turned.
_PARKED_TURNED = 0.4
# A vehicle that moves less than this between two frames keeps its wheels straight, metres.
_LEAST_WAY = 0.02


def steering(actor: Actor, frame: int, road: Road) -> float:
    """Angle of the front wheels in a frame, radians, positive to the right.

    Turning vehicles steer along their path, as a bicycle of the same wheelbase; parked ones stand with the
    wheels as their drivers left them; all others drive straight within a degree or two.
    """
    if actor.state[frame] == "parked":
        rng = np.random.default_rng([86, actor.look_seed])
        return float(rng.uniform(-LIMIT, LIMIT)) if rng.random() < _PARKED_TURNED else 0.0
    if actor.state[frame] != "turning":
        return 0.0
    pair = slice(frame - 1, frame + 1) if frame else slice(0, 2)
    heading = road.heading_at(actor.s[pair]) + actor.angle[pair]
    x, _, z = road.world(actor.s[pair], actor.d[pair]).T
    way = math.hypot(x[1] - x[0], z[1] - z[0])
    if way < _LEAST_WAY:
        return 0.0
    turned = math.remainder(float(heading[1] - heading[0]), 2.0 * math.pi)
    axles = measures(actor.class_name, actor.seed).wheels[:, 2]
    return min(max(math.atan(float(np.ptp(axles)) * turned / way), -LIMIT), LIMIT)
