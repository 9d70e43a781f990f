"""What each driver has ahead: the first vehicle in the way, and room beside for a change of lanes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.drive.footprints import Footprints
from groundpose.lab.drive.video.mover import Mover

_SAMPLES = 40  # points of the way ahead
_BESIDE, _BEFORE = 0.15, 0.2  # margins around other vehicles, metres
_LONG = 12.0  # no vehicle is longer, metres
_TURNED = 0.35  # sine of the angle from which a vehicle stands across the way


def footprints(movers: list[Mover], margin: float = 0.0) -> Footprints:
    """Those of vehicles."""
    return Footprints.of(
        np.array([m.origin for m in movers]),
        np.array([m.heading for m in movers]),
        np.array([m.chassis.box for m in movers]),
        margin,
    )


def leaders(movers: list[Mover]) -> list[tuple[float, float] | None]:
    """Gap in metres and speed along the way of the first vehicle on the way of each."""
    gap = _gaps(movers)
    # two that are in each other's way: the one that is nearer to the meeting point goes on
    both = np.isfinite(gap) & np.isfinite(gap.T)
    order = np.arange(len(movers))
    first = both & ((gap < gap.T) | ((gap == gap.T) & (order[:, None] < order)))
    gap[first] = np.inf
    found: list[tuple[float, float] | None] = []
    for i, mover in enumerate(movers):
        j = int(gap[i].argmin())
        speed = movers[j].v * math.cos(movers[j].heading - mover.heading)
        found.append((float(gap[i, j]), max(speed, 0.0)) if math.isfinite(gap[i, j]) else None)
    return found


def _gaps(movers: list[Mover]) -> FloatArray:
    """(N, N) metres from the front end of a vehicle along its way to another; inf: not on its way."""
    gaps = np.full((len(movers), len(movers)), np.inf)
    if len(movers) < 2:
        return gaps
    reach = np.array([12.0 + 2.5 * m.v + m.v**2 / 5.0 for m in movers])
    boxes = footprints(movers)
    forward = np.array([m.forward for m in movers])
    offset = boxes.middle - boxes.middle[:, None]
    near = np.linalg.norm(offset, axis=2) < reach[:, None] + _LONG
    near &= np.einsum("nmi,ni->nm", offset, forward) > -_LONG
    near[[m.parked for m in movers]] = False
    np.fill_diagonal(near, False)
    i, j = np.nonzero(near)
    if not len(i):
        return gaps
    along = np.linspace(0.0, 1.0, _SAMPLES) * reach[:, None]
    points = np.stack(
        [m.path.at(m.path.place, m.p + m.chassis.nose + a) for m, a in zip(movers, along, strict=True)]
    )
    step = np.gradient(points, axis=1)
    step /= np.maximum(np.linalg.norm(step, axis=2, keepdims=True), 1e-6)
    side = np.array([0.5 * m.chassis.width for m in movers])[i, None] + _BESIDE
    hit = _touch(points[i], step[i], boxes[j], side)
    first = hit.argmax(axis=1)
    touched = hit[np.arange(len(i)), first]
    gaps[i[touched], j[touched]] = along[i, first][touched]
    return gaps


def _touch(points: FloatArray, step: FloatArray, boxes: Footprints, side: FloatArray) -> NDArray[np.bool_]:
    """(N, K) whether a vehicle of half width `side` (N, 1) at points (N, K, 2) of its way touches its box."""
    offset = points - boxes.middle[:, None]
    across, along = (
        np.abs(offset[..., 0] * axis[:, 0, None] + offset[..., 1] * axis[:, 1, None])
        for axis in (boxes.axes[:, 0], boxes.axes[:, 1])
    )
    right = boxes.axes[:, 0]
    turned = np.abs(step[..., 0] * right[:, 0, None] + step[..., 1] * right[:, 1, None]) > _TURNED
    # a vehicle across the way is as wide as it is long
    before = np.where(turned, side, _BEFORE)
    return np.asarray((across < boxes.half[:, :1] + side) & (along < boxes.half[:, 1:] + before))


def room_beside(mover: Mover, d: float, movers: list[Mover], ahead: float, behind: float) -> bool:
    """Whether the lane at `d` is free beside a vehicle: `ahead` metres, `behind` metres and two seconds."""
    s, _ = mover.road
    direction = 1.0 if np.cos(mover.heading - _road_heading(mover)) > 0.0 else -1.0
    for other in movers:
        if other is mover:
            continue
        there, across = other.road
        if abs(across - d) > 2.4:
            continue
        gap = direction * (there - s)
        front = gap - other.chassis.tail - mover.chassis.nose
        rear = -gap - mover.chassis.tail - other.chassis.nose
        if front < ahead and rear < behind + max(2.0 * other.v, 4.0 * (other.v - mover.v)):
            return False
    return True


def _road_heading(mover: Mover) -> float:
    """Direction of growing s where the vehicle's path is."""
    (s0, _), (s1, _) = mover.path.at(mover.path.road, np.array([mover.p, mover.p + 1.0]))
    along = float(mover.path.row(mover.path.heading, mover.p))
    return along if s1 > s0 else along + np.pi
