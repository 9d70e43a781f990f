"""The things beside a road that a frame shows."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive import mast
from groundpose.lab.drive.body_cache import measures
from groundpose.lab.drive.ego import Ego
from groundpose.lab.drive.footprints import Footprints, overlapping
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.scene import Prop, Vehicle

AHEAD, BEHIND = 160.0, 25.0
"""Things farther than this from the camera are omitted from a frame, metres."""


def near(
    props: tuple[Prop, ...], places: FloatArray, at: FloatArray, forward: FloatArray
) -> tuple[Prop, ...]:
    """The things around a camera above `at` that looks along `forward`; `places` (N, 3) of all `props`."""
    if not props:
        return ()
    ahead = (places - at) @ forward
    half = np.array([0.5 * max(prop.size[0], prop.size[2]) for prop in props])
    chosen = (ahead - half < AHEAD) & (ahead + half > -BEHIND)
    return tuple(props[i] for i in np.flatnonzero(chosen).tolist())


def without_vehicles(props: tuple[Prop, ...], vehicles: Sequence[Vehicle]) -> tuple[Prop, ...]:
    """The things that are not at the place of a vehicle."""
    if not vehicles or not props:
        return props
    cars = Footprints.of(
        np.array([v.t_world[[0, 2]] for v in vehicles]),
        np.array([math.atan2(v.R_world[0, 2], v.R_world[2, 2]) for v in vehicles]),
        np.array([measures(v.class_name, v.seed).bbox_3d[:, [0, 2]] for v in vehicles]),
    )
    free = np.flatnonzero(~overlapping(footprints(props), cars).any(axis=1))
    return tuple(props[i] for i in free)


def footprints(props: Sequence[Prop]) -> Footprints:
    """Those of things."""
    half = 0.5 * np.array([prop.size[[0, 2]] for prop in props])
    return Footprints.of(
        np.array([prop.position[[0, 2]] for prop in props]),
        np.array([prop.yaw for prop in props]),
        np.stack([-half, half], axis=1),
    )


def clear_of_mast(props: tuple[Prop, ...], road: Road, ego: Ego) -> tuple[Prop, ...]:
    """The things that leave room for a mast: no crown of a tree, lamp or house around the camera."""
    if not props or not ego.standing:
        return props
    at = road.world(ego.s[0], ego.d[0])[:, [0, 2]]
    half = 0.5 * mast.FREE * np.ones((1, 2))
    room = Footprints.of(at, road.heading_at(ego.s[0]), np.stack([-half, half], axis=1))
    taken = overlapping(footprints(props), room)[:, 0]
    return tuple(prop for prop, inside in zip(props, taken, strict=True) if not inside)
