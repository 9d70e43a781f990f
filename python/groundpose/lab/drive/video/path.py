"""The curves that front axles follow: lanes, turns, changes of lanes, ways into parking places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.road import Road

STEP = 0.5
"""Metres between the stations of a path."""

# Drivers take curves at this lateral acceleration and brake before them by this deceleration, m/s^2.
_LATERAL, _BRAKE = 2.0, 1.4
_FINE = 0.1  # metres between points of a path before it is divided evenly
_BESIDE = 1.5  # metres beside the crossing street that belong to the junction


@dataclass(frozen=True, eq=False)
class Path:
    """A curve seen from above, one row per station: `place` (M, 2) world x, z; `road` (M, 2) s, d; `heading`
    (M,) without jumps; `limit` (M,) m/s for curves and for the end, if the vehicle stops there.

    `kind`: "moving", "turning" or "crossing". `junction`: lengths at which it enters and leaves the junction.
    """

    place: FloatArray
    road: FloatArray
    heading: FloatArray
    limit: FloatArray
    kind: str
    stops: bool
    junction: tuple[float, float] | None

    @classmethod
    def along(cls, road: Road, points: FloatArray, kind: str = "moving", stops: bool = False) -> Path:
        """Through points (K, 2) s, d."""
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        fine = np.linspace(0.0, lengths[-1], max(2, round(lengths[-1] / _FINE)))
        sd = np.stack([np.interp(fine, lengths, points[:, k]) for k in range(2)], axis=1)
        place = road.world(*sd.T)[:, [0, 2]]
        walked = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(place, axis=0).T))])
        even = np.arange(0.0, walked[-1], STEP)
        place, sd = (
            np.stack([np.interp(even, walked, a[:, k]) for k in range(2)], axis=1) for a in (place, sd)
        )
        x, z = np.gradient(place, axis=0).T
        heading = np.unwrap(np.arctan2(x, z))
        return cls(place, sd, heading, _limit(heading, stops), kind, stops, _crossed(road, sd))

    @property
    def length(self) -> float:
        """Metres."""
        return STEP * (len(self.place) - 1)

    def at(self, table: FloatArray, p: FloatArray) -> FloatArray:
        """Rows of one of the tables at lengths p; beyond the ends it goes straight on."""
        station = p / STEP
        index = np.clip(station.astype(np.intp), 0, len(table) - 2)
        fraction = station - index
        if table.ndim > 1:
            fraction = fraction[..., None]
        return np.asarray(table[index] * (1.0 - fraction) + table[index + 1] * fraction)

    def row(self, table: FloatArray, p: float) -> Any:
        """The same for one length, faster."""
        station = p / STEP
        index = min(max(int(station), 0), len(table) - 2)
        fraction = station - index
        return table[index] * (1.0 - fraction) + table[index + 1] * fraction

    def allowed(self, p: float) -> float:
        """Speed at length p, m/s."""
        return float(self.limit[min(max(int(p / STEP), 0), len(self.limit) - 1)])


def _limit(heading: FloatArray, stops: bool) -> FloatArray:
    curvature = np.abs(np.gradient(heading)) / STEP
    squared = _LATERAL / np.maximum(curvature, 1e-4)
    if stops:
        squared[-1] = 0.0
    # to be slow enough farther on, the speed here is bounded by the braking on the way
    gained = 2.0 * _BRAKE * STEP * np.arange(len(heading))
    return np.asarray(np.sqrt(np.minimum.accumulate((squared + gained)[::-1])[::-1] - gained))


def _crossed(road: Road, sd: FloatArray) -> tuple[float, float] | None:
    if road.junction is None:
        return None
    inside = np.abs(sd[:, 0] - road.junction.s) < road.junction.half_width + _BESIDE
    inside &= (sd[:, 1] < road.layout.right) & (sd[:, 1] > -road.layout.left)
    rows = np.flatnonzero(inside)
    return (STEP * float(rows[0]), STEP * float(rows[-1])) if len(rows) else None


def shifted(start: tuple[float, float], d: float, length: float, end: float) -> FloatArray:
    """Points (K, 2) of a way along the road from (s, d) to another d in `length` metres, then to s = `end`.

    Slope and curvature across begin and end with zero.
    """
    direction = 1.0 if end > start[0] else -1.0
    u = np.linspace(0.0, 1.0, 30)
    across = start[1] + (d - start[1]) * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    change = np.stack([start[0] + direction * length * u, across], axis=1)
    if direction * (end - change[-1, 0]) < STEP:
        return change
    return np.concatenate([change, [[end, d]]])
