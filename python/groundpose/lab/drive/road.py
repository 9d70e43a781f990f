"""Roads: a centre line that curves, slopes, crests and banks, its lanes, and the surface under the wheels.

The road coordinates of a point are `s`, metres along the centre line seen from above, and `d`, metres to the
right of it. All directions and positions returned are in the world frame (x right, y down, z forward).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from groundpose._checks import FloatArray

STEP = 0.5
"""Metres between the stations of a centre line."""

KERB_HEIGHT = 0.12

# Slopes across the road flatten out this far from the centre line, metres.
_REACH = 25.0
# The crown of a road is rounded over this half width, metres.
_CROWN_RADIUS = 2.0


@dataclass(frozen=True)
class Lane:
    """A lane: `d` of its middle, width, direction of travel (+1 with s, -1 against), typical speed (m/s)."""

    d: float
    width: float
    direction: int
    speed: float


@dataclass(frozen=True)
class Parking:
    """A row of parking places along a kerb: `d` of their middle, side (+1 right), pitch along s, `angle` of
    the places to the road (0 parallel, pi/2 perpendicular), depth across the road, fraction occupied."""

    d: float
    side: int
    pitch: float
    angle: float
    depth: float
    occupancy: float


@dataclass(frozen=True)
class Junction:
    """A street that crosses at right angles: `s` of its middle, half its width, its visible length."""

    s: float
    half_width: float
    reach: float
    zebra: bool


@dataclass(frozen=True)
class Lot:
    """A car park beside the road from s = `start` to `end`."""

    start: float
    end: float
    rows: tuple[Parking, ...]

    def meets(self, side: int, start: float, end: float) -> bool:
        """Whether it lies beside a section of the right (+1) or left (-1) edge."""
        return self.rows[0].side == side and start < self.end and end > self.start


@dataclass(frozen=True)
class Layout:
    """The cross-section. `left` and `right` are the distances of the road's two edges (kerbs, if `kerb`) from
    the centre line, `pavement` the width of the pavement beyond, `median` half the width of a grass strip in
    the middle, `shoulder` the width of the hard shoulder, `extent` where the modelled ground ends."""

    kind: str
    lanes: tuple[Lane, ...]
    parking: tuple[Parking, ...]
    left: float
    right: float
    kerb: bool
    pavement: float
    median: float
    shoulder: float
    extent: float

    def edge(self, side: int) -> float:
        """Distance of the right (+1) or left (-1) edge from the centre line."""
        return self.right if side > 0 else self.left


@dataclass(frozen=True, eq=False)
class Road:
    """A road from s = `start` on; all arrays have one value per station, `STEP` apart.

    Args:
        centre: (S, 2) x and z of the centre line.
        heading: its direction, positive to the right; its forward is (sin, cos) in x, z.
        curvature: of the centre line, 1/m, positive to the right.
        height: of the centre line, upwards.
        bank: slope across, rise to the right.
        crown: fall to both sides from the middle.
    """

    layout: Layout
    start: float
    centre: FloatArray
    heading: FloatArray
    curvature: FloatArray
    height: FloatArray
    bank: FloatArray
    crown: FloatArray
    junction: Junction | None = None
    lots: tuple[Lot, ...] = ()

    def __post_init__(self) -> None:
        """Join the columns in one table, so that one look-up interpolates them all."""
        rates = [np.gradient(a, STEP) for a in (self.height, self.bank, self.crown)]
        columns = [*self.centre.T, self.heading, self.curvature, self.height, self.bank, self.crown, *rates]
        object.__setattr__(self, "_table", np.stack(columns, axis=1))

    @property
    def end(self) -> float:
        """The last s."""
        return self.start + STEP * (len(self.heading) - 1)

    def world(self, s: ArrayLike, d: ArrayLike, lift: ArrayLike = 0.0) -> FloatArray:
        """(N, 3) points at (s, d), `lift` metres above the smooth surface (which has no kerbs)."""
        s, d, lift = np.broadcast_arrays(*np.atleast_1d(s, d, lift))
        at = self._at(s)
        up = _profile(at, d)[0] + lift
        sin, cos = np.sin(at[2]), np.cos(at[2])
        return np.stack([at[0] + d * cos, -up, at[1] - d * sin], axis=1)

    def locate(self, x: ArrayLike, z: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Road coordinates `s, d`, (N,) each, of points seen from above."""
        x, z = (np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (x, z))
        # the nearest station, then Newton steps until the foot of the perpendicular is at s
        coarse = self.centre[::8]
        far = (x[:, None] - coarse[:, 0]) ** 2 + (z[:, None] - coarse[:, 1]) ** 2
        s = self.start + 8 * STEP * far.argmin(axis=1)
        for _ in range(4):
            at = self._at(s)
            sin, cos = np.sin(at[2]), np.cos(at[2])
            dx, dz = x - at[0], z - at[1]
            d = dx * cos - dz * sin
            s = np.clip(s + (dx * sin + dz * cos) / np.maximum(1.0 - at[3] * d, 0.2), self.start, self.end)
        return s, d

    def lift(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """Height of the pavement above the smooth surface at (s, d), metres."""
        if not self.layout.kerb:
            return np.zeros(np.shape(d))
        beyond = (d > self.layout.right) | (d < -self.layout.left)
        if self.junction is not None:
            beyond &= np.abs(s - self.junction.s) > self.junction.half_width
        return np.where(beyond, KERB_HEIGHT, 0.0)

    def surface(self, x: ArrayLike, z: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """World y (N,) of the ground at points seen from above, pavements included, and the smooth surface's
        unit normal (N, 3), which points up (y < 0)."""
        s, d = self.locate(x, z)
        at = self._at(s)
        up, along, across = _profile(at, d)
        return -(up + self.lift(s, d)), _normal(at, d, along, across)

    def frame(self, s: ArrayLike, d: ArrayLike) -> FloatArray:
        """Rotations (N, 3, 3) world_from_road at (s, d): columns right, down (into the ground), forward."""
        s, d = np.broadcast_arrays(*np.atleast_1d(s, d))
        at = self._at(s)
        _, along, across = _profile(at, d)
        down = -_normal(at, d, along, across)
        level = np.stack([np.sin(at[2]), np.zeros(len(s)), np.cos(at[2])], axis=1)
        forward = level - np.sum(level * down, axis=1, keepdims=True) * down
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        return np.stack([np.cross(down, forward), down, forward], axis=2)

    def heading_at(self, s: ArrayLike) -> FloatArray:
        """Direction (N,) of the centre line, radians to the right of world z."""
        return np.asarray(self._at(np.atleast_1d(s))[2])

    def _at(self, s: FloatArray) -> FloatArray:
        """Columns (C, N) of the table at s."""
        table: FloatArray = self._table  # type: ignore[attr-defined]
        place = np.clip((np.asarray(s, float) - self.start) / STEP, 0.0, len(table) - 1.0 - 1e-9)
        index = place.astype(np.intp)
        fraction = (place - index)[:, None]
        return np.asarray((table[index] * (1.0 - fraction) + table[index + 1] * fraction).T)


def _profile(at: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Height of the smooth surface and its slopes along s (at the centre line's scale) and across."""
    height, bank, crown, height_rate, bank_rate, crown_rate = at[4:]
    e = _REACH * np.tanh(d / _REACH)
    hump = np.sqrt(e**2 + _CROWN_RADIUS**2) - _CROWN_RADIUS
    hump_rate = e / (hump + _CROWN_RADIUS)
    up = height + bank * e - crown * hump
    along = height_rate + bank_rate * e - crown_rate * hump
    across = (1.0 - (e / _REACH) ** 2) * (bank - crown * hump_rate)
    return up, along, across


def _normal(at: FloatArray, d: FloatArray, along: FloatArray, across: FloatArray) -> FloatArray:
    """(N, 3), up: an arc at distance d from the centre line is shorter or longer by 1 - curvature d."""
    along = along / np.maximum(1.0 - at[3] * d, 0.2)
    sin, cos = np.sin(at[2]), np.cos(at[2])
    slope_x, slope_z = along * sin + across * cos, along * cos - across * sin
    normal = np.stack([-slope_x, -np.ones(len(d)), -slope_z], axis=1)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def centre_line(start: float, curvature: Sequence[float] | FloatArray) -> tuple[FloatArray, FloatArray]:
    """Centre (S, 2) and heading (S,) from the curvature; at s = 0 it passes the origin along z."""
    kappa = np.asarray(curvature, float)
    heading = _integral(kappa)
    origin = round(-start / STEP)
    heading -= heading[origin]
    centre = np.stack([_integral(np.sin(heading)), _integral(np.cos(heading))], axis=1)
    return centre - centre[origin], heading


def _integral(rate: FloatArray) -> FloatArray:
    """Trapezoidal integral from the first station."""
    return np.concatenate([[0.0], np.cumsum(0.5 * STEP * (rate[1:] + rate[:-1]))])
