"""Traffic of a drive: rows of parked vehicles, streams on the lanes, vehicles that cross and turn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error, number
from groundpose.lab.drive import mast
from groundpose.lab.drive.body_cache import length_and_width
from groundpose.lab.drive.ego import CAMERA_TO_FRONT, FRAME_INTERVAL, Ego
from groundpose.lab.drive.road import Junction, Lane, Lot, Parking, Road
from groundpose.lab.drive.road_kinds import ROAD_KINDS, wave
from groundpose.lab.drive.splits import random_body
from groundpose.vehicles import CLASSES

AHEAD, BEHIND = 150.0, 14.0
"""Lengths of road ahead of and behind a moving camera with traffic, metres."""

# A vehicle appears within a random distance: least, and the scale of a gamma distribution of shape 1.4.
_SIGHT, _SIGHT_FROM_MAST = (18.0, 18.0), (35.0, 35.0)

# Vehicles of a lane are seen from afar, square-on and small: scale in metres of the distribution of `sight`.
_LANE_REACH = 45.0

_BRAKED = 1.0  # deceleration of a vehicle whose brake lamps are on, m/s^2; less needs no brake

DEFAULT_SHARES = {"car": 0.60, "van_bus": 0.15, "pickup": 0.11, "box_truck": 0.14}
"""Relative frequency of each class of vehicle."""


# Distances between moving vehicles before a camera on a mast, relative to those around a car.
_DENSER = 0.5


@dataclass(frozen=True, eq=False)
class Actor:
    """A vehicle over a drive: `s`, `d` and `angle` to the road (positive to the right), one value per frame.
    `sight` is the distance in metres beyond which it does not appear."""

    class_name: str
    seed: int
    look_seed: int
    s: FloatArray
    d: FloatArray
    angle: FloatArray
    state: tuple[str, ...]
    braking: NDArray[np.bool_]
    lamps: float
    sight: float


def reach(ego: Ego) -> tuple[float, float]:
    """Lengths of road ahead of and behind the camera with traffic, metres."""
    return (mast.AHEAD, mast.BEHIND) if ego.standing else (AHEAD, BEHIND)


@dataclass(frozen=True)
class Classes:
    """Draws vehicles of a split with the frequencies of the classes."""

    rng: np.random.Generator
    split: str
    shares: Mapping[str, float]

    def draw(self, longest: float = math.inf, widest: float = math.inf) -> tuple[str, int, float, float]:
        """Class, seed, length and width of a vehicle that is at most this long and wide."""
        names, weights = list(self.shares), np.array(list(self.shares.values()))
        class_name = names[int(self.rng.choice(len(names), p=weights / weights.sum()))]
        for _ in range(8):
            seed = random_body(self.rng, class_name, self.split)
            length, width = length_and_width(class_name, seed)
            if length <= longest and width <= widest:
                return class_name, seed, length, width
        return "", 0, 0.0, 0.0


def traffic(
    rng: np.random.Generator, road: Road, ego: Ego, split: str, shares: Mapping[str, float]
) -> tuple[Actor, ...]:
    """All vehicles of a drive in order of priority: where two would overlap, the later one is omitted."""
    maker = _Maker(rng, road, ego, Classes(rng, split, shares))
    parked = maker.parked()
    cross = list(maker.junction(road.junction)) if road.junction is not None else []
    lanes = sorted(road.layout.lanes, key=lambda lane: abs(lane.d - ego.d[0]))
    own = None if ego.standing else lanes[0]
    moving = [actor for lane in lanes for actor in maker.stream(lane, own=lane is own)]
    return (*parked, *cross, *moving)


def parked(
    rng: np.random.Generator, road: Road, ego: Ego, split: str, shares: Mapping[str, float]
) -> list[Actor]:
    """The parked vehicles of a drive alone."""
    return _Maker(rng, road, ego, Classes(rng, split, shares)).parked()


@dataclass(frozen=True)
class _Maker:
    rng: np.random.Generator
    road: Road
    ego: Ego
    classes: Classes

    def _actor(
        self,
        chosen: tuple[str, int, float, float],
        s: FloatArray | float,
        d: FloatArray | float,
        angle: FloatArray | float,
        state: str | tuple[str, ...],
        braking: NDArray[np.bool_] | bool = False,
        sight_scale: float = 0.0,
    ) -> Actor:
        """`sight_scale`: least scale in metres of the distribution of `sight`."""
        frames = len(self.ego.s)
        least, scale = _SIGHT_FROM_MAST if self.ego.standing else _SIGHT
        s, d, angle = (np.array(np.broadcast_to(x, frames), float) for x in (s, d, angle))
        return Actor(
            class_name=chosen[0],
            seed=chosen[1],
            look_seed=int(self.rng.integers(2**31)),
            s=s,
            d=d,
            angle=angle,
            state=(state,) * frames if isinstance(state, str) else state,
            braking=np.array(np.broadcast_to(braking, frames), bool),
            lamps=float(self.rng.random()),
            sight=float(least + self.rng.gamma(1.4, max(scale, sight_scale))),
        )

    def parked(self) -> list[Actor]:
        """Vehicles along the road and in car parks."""
        along = [actor for row in self.road.layout.parking for actor in self.row(row)]
        lots = [actor for lot in self.road.lots for row in lot.rows for actor in self.row(row, lot)]
        return along + lots

    def row(self, row: Parking, lot: Lot | None = None) -> Iterator[Actor]:
        """Vehicles parked in a row, of a car park or along the road: parallel to the kerb, or with the front
        or the rear to it."""
        rng, edge = self.rng, self.road.layout.edge(row.side)
        ahead, behind = reach(self.ego)
        start, end = float(self.ego.s[0]) - behind, float(self.ego.s[-1]) + ahead
        if lot is not None:
            start, end = max(start, lot.start), min(end, lot.end - row.pitch)
        place = start - rng.uniform(0.0, row.pitch)
        while place < end:
            place += row.pitch
            if rng.random() >= row.occupancy or self._near_junction(place, 7.0):
                continue
            if row.angle == 0.0:
                # a long vehicle takes two places
                chosen = self.classes.draw(longest=2.0 * row.pitch - 0.8, widest=2.6)
                places = 1 if chosen[2] < row.pitch - 0.5 else 2
                middle = place + 0.5 * row.pitch * (places - 1)
                slack = 0.3 * max(places * row.pitch - chosen[2] - 0.5, 0.0)
                d = row.side * (edge - 0.2 - 0.5 * chosen[3] - rng.gamma(2.0, 0.06))
                angle = rng.normal(0.0, math.radians(1.2)) + (
                    0.0 if (row.side > 0) ^ (rng.random() < 0.08) else math.pi
                )
                place += row.pitch * (places - 1)
            else:
                chosen = self.classes.draw(longest=row.depth + 0.6, widest=2.15)
                nose_in = rng.random() < 0.65
                middle, slack, d = place, 0.12, row.d + rng.normal(0.0, 0.15)
                angle = row.side * (row.angle if nose_in else row.angle - math.pi)
                angle += rng.normal(0.0, math.radians(2.0))
            if chosen[0]:
                yield self._actor(chosen, middle + rng.uniform(-slack, slack), d, angle, "parked")

    def _near_junction(self, s: float, margin: float) -> bool:
        junction = self.road.junction
        return junction is not None and abs(s - junction.s) < junction.half_width + margin

    def stream(self, lane: Lane, own: bool) -> Iterator[Actor]:
        """Vehicles that follow each other in a lane; those in the camera's lane move as the camera does."""
        rng, ego = self.rng, self.ego
        frames = len(ego.s)
        t = FRAME_INTERVAL * np.arange(frames, dtype=np.float64)
        if own:
            moved, braking, speed = ego.s - ego.s[0], ego.acceleration < -_BRAKED, float(ego.speed.mean())
        else:
            v = np.clip(lane.speed * (1.0 + 0.25 * wave(rng, t, (8.0, 30.0))), 0.0, None)
            moved = lane.direction * np.concatenate([[0.0], np.cumsum(v[:-1]) * FRAME_INTERVAL])
            braking, speed = np.gradient(v, FRAME_INTERVAL) < -_BRAKED, float(v.mean())
        ahead, behind = reach(ego)
        start = float((ego.s - moved).min()) - behind
        end = float((ego.s - moved).max()) + ahead
        if own:
            start = float(ego.s[0]) + CAMERA_TO_FRONT
        headway, gap = rng.uniform(0.4, 1.4), rng.uniform(*ROAD_KINDS[self.road.layout.kind].gap)
        if ego.standing:
            headway, gap = _DENSER * headway, _DENSER * gap
        place = start
        while True:
            chosen = self.classes.draw(widest=lane.width - 0.15)
            clear = 1.8 + headway * speed + rng.exponential(gap)
            place += clear + 0.5 * chosen[2]
            if place > end:
                return
            if chosen[0]:
                d = lane.d + rng.normal(0.0, 0.18) + 0.1 * wave(rng, t, (5.0, 12.0))
                angle = rng.normal(0.0, math.radians(0.4), frames) + (0.0 if lane.direction > 0 else math.pi)
                yield self._actor(chosen, place + moved, d, angle, "moving", braking, _LANE_REACH)
            place += 0.5 * chosen[2]

    def junction(self, junction: Junction) -> Iterator[Actor]:
        """Vehicles that wait in the crossing street, cross and turn."""
        for direction in (-1, 1):
            yield from self._waiting(junction, direction)
        for _ in range(int(self.rng.integers(1, 5))):
            path = self._crossing_path(junction, int(self.rng.choice([-1, 1])))
            yield self._along(path, "crossing", self.rng.uniform(3.0, 10.0))
        for _ in range(int(self.rng.integers(1, 5))):
            yield self._along(self._turning_path(junction), "turning", self.rng.uniform(3.0, 6.0))

    def _cross_lane(self, junction: Junction, direction: int) -> float:
        """s of the crossing street's lane that leads to larger (+1) or smaller d."""
        return junction.s - direction * 0.5 * junction.half_width

    def _waiting(self, junction: Junction, direction: int) -> Iterator[Actor]:
        rng, s = self.rng, self._cross_lane(junction, direction)
        place = self.road.layout.edge(-direction) + rng.uniform(0.8, 2.5)
        for _ in range(int(rng.integers(0, 3))):
            chosen = self.classes.draw(widest=junction.half_width - 0.3)
            place += 0.5 * chosen[2]
            if place + 0.5 * chosen[2] > junction.reach:
                return
            if chosen[0]:
                yield self._actor(
                    chosen, s + rng.normal(0.0, 0.1), -direction * place, direction * math.pi / 2, "crossing"
                )
            place += 0.5 * chosen[2] + rng.uniform(1.5, 4.0)

    def _crossing_path(self, junction: Junction, direction: int) -> FloatArray:
        s = self._cross_lane(junction, direction)
        return np.array([[s, -direction * junction.reach], [s, direction * junction.reach]])

    def _turning_path(self, junction: Junction) -> FloatArray:
        """From a lane of the road into the crossing street, or the other way round: a rounded corner."""
        rng = self.rng
        lane = self.road.layout.lanes[int(rng.integers(len(self.road.layout.lanes)))]
        way = int(rng.choice([-1, 1]))
        s = self._cross_lane(junction, way)
        corner = np.array([s, lane.d])
        along, across = np.array([lane.direction, 0.0]), np.array([0.0, way])
        if rng.random() < 0.6:
            before, after = corner - 40.0 * along, corner + (junction.reach - 4.0) * across
        else:
            before, after = corner - (junction.reach - 4.0) * across, corner + 40.0 * along
        return rounded(before, corner, after, rng.uniform(4.5, 8.0))

    def _along(self, path: FloatArray, state: str, speed: float) -> Actor:
        """A vehicle that reaches the middle of its path in a random frame of the drive."""
        chosen = self.classes.draw(widest=2.6)
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        t = np.arange(len(self.ego.s)) * FRAME_INTERVAL
        progress = np.clip(
            0.5 * lengths[-1] + speed * (t - self.rng.uniform(0.0, t[-1])), 0.01, lengths[-1] - 0.01
        )
        s, d = (np.interp(progress, lengths, path[:, i]) for i in range(2))
        ahead = [
            np.interp(progress + 0.6, lengths, path[:, i]) - np.interp(progress - 0.6, lengths, path[:, i])
            for i in range(2)
        ]
        return self._actor(chosen, s, d, np.arctan2(ahead[1], ahead[0]), state)


def rounded(before: FloatArray, corner: FloatArray, after: FloatArray, radius: float) -> FloatArray:
    """Points of a path around a right-angled corner."""
    into, out = (
        (corner - before) / np.linalg.norm(corner - before),
        (after - corner) / np.linalg.norm(after - corner),
    )
    centre = corner - radius * into + radius * out
    angles = np.linspace(0.0, 0.5 * np.pi, 12)[:, None]
    arc = centre - radius * np.cos(angles) * out + radius * np.sin(angles) * into
    return np.concatenate([before[None], arc, after[None]])


def check_shares(shares: Mapping[str, float]) -> None:
    """Raises InputError for an unknown class, a negative fraction, or no fraction above zero."""
    for class_name, fraction in shares.items():
        if class_name not in CLASSES:
            raise input_error("class fractions", f"classes {', '.join(CLASSES)}", repr(class_name))
        if not (math.isfinite(number("class fractions", fraction)) and fraction >= 0.0):
            raise input_error("class fractions", f"a number from 0 for {class_name}", fraction)
    if not sum(shares.values()) > 0.0:
        raise input_error("class fractions", "at least one above zero", dict(shares))
