"""Traffic that flows: vehicles enter a window of road around the camera, drive, turn, park and leave."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.road import Junction, Lane, Parking, Road
from groundpose.lab.drive.road_kinds import ROAD_KINDS, wave
from groundpose.lab.drive.traffic import Classes, rounded
from groundpose.lab.drive.video import sight
from groundpose.lab.drive.video.crossroads import Crossroads, to_line
from groundpose.lab.drive.video.mover import Chassis, Driver, Mover
from groundpose.lab.drive.video.path import Path, shifted

AHEAD, BEHIND = 215.0, 58.0
"""Lengths of road ahead of and behind the camera where there is traffic, metres."""

_GONE = 15.0  # beyond these a vehicle is taken away, metres
_TURN_RIGHT, _TURN_LEFT = 0.25, 0.2  # of the vehicles of the outermost and innermost lane before a junction
_PULL_IN = 0.12  # of the vehicles of a lane beside a row of parking places along the road
_PULL_OUT, _LEAVE = 1 / 70, 45.0  # vehicles per metre that leave a parking place, within so many seconds
_CROSSING = 1 / 14  # vehicles per second and direction of the crossing street
_LEAST_LANE = 0.3  # metres kept free in a lane beside a vehicle
_RADIUS_RIGHT, _RADIUS_LEFT = 6.5, 8.0
_WAY_IN, _ALONG_KERB = 14.0, 6.0  # lengths of the way into a parking place and along the kerb, metres
_CHANGE_SECONDS, _CHANGE_AGAIN, _LEAST_CHANGE = 4.0, 10.0, 25.0
_LONGEST_TURNING, _LONGEST_PARKING = 8.0, 6.5  # vehicles that turn and park, metres
_HURRY = 1.5  # m/s that a driver wants to be faster to change lanes


@dataclass(eq=False)
class Flow:
    """A lane, and how far behind the next one the next vehicle comes."""

    lane: Lane
    headway: float
    gap: float
    clear: float = 0.0


class Street:
    """The moving vehicles of a drive, around `centre`, the camera's s."""

    def __init__(self, rng: np.random.Generator, road: Road, classes: Classes, standing: bool) -> None:
        """An empty street."""
        self.rng, self.road, self.classes = rng, road, classes
        self.movers: list[Mover] = []
        self.crossroads, self.time, self.tracks = Crossroads(), 0.0, 0
        self.ego: Mover | None = None
        self.centre = 0.0
        kind = ROAD_KINDS[road.layout.kind]
        factor = 0.5 if standing else 1.0  # denser before a mast, as in `traffic`
        self.flows = [
            Flow(lane, factor * rng.uniform(0.4, 1.4), factor * rng.uniform(*kind.gap))
            for lane in road.layout.lanes
        ]

    def number(self) -> int:
        """The next track's."""
        self.tracks += 1
        return self.tracks - 1

    # ---- who comes

    def fill(self) -> None:
        """Vehicles on all lanes at the beginning."""
        for flow in self.flows:
            lane, place = flow.lane, self._rear
            while (place := place + self._clear(flow, lane.speed)) < self._front:
                chassis = self._chassis(lane.width - _LEAST_LANE)
                if chassis is None or self._in_junction(place):
                    continue
                self._enter(flow, chassis, place, 0.9 * lane.speed)

        for row in self.road.layout.parking:
            if row.angle == 0.0 and any(lane.direction == row.side for lane in self.road.layout.lanes):
                for _ in range(int(self.rng.poisson(_PULL_OUT * (self._front - self._rear)))):
                    self._wait_to_leave(row, float(self.rng.uniform(self._rear + 20.0, self._front - 30.0)))

    def place_ego(self, lane: Lane, chassis: Chassis, speed: float) -> None:
        """The camera's car, in the middle of its lane at s = 0, with the speed of that lane."""
        path = self._lane_path(lane, 0.0, chassis.width)
        self.ego = Mover(
            self.number(), chassis, Driver(speed, 1.2, 2.0, 1.6, 2.0), path, 0.0, 0.9 * speed, lane
        )
        self.movers.insert(0, self.ego)

    @property
    def _rear(self) -> float:
        return max(self.centre - BEHIND, self.road.start + 1.0)

    @property
    def _front(self) -> float:
        return min(self.centre + AHEAD, self.road.end - 1.0)

    def _clear(self, flow: Flow, speed: float) -> float:
        return 6.5 + flow.headway * speed + float(self.rng.exponential(flow.gap))

    def _chassis(self, widest: float, longest: float = math.inf) -> Chassis | None:
        name, seed, *_ = self.classes.draw(longest, widest)
        return Chassis.of(name, seed, self.rng) if name else None

    def _in_junction(self, s: float) -> bool:
        junction = self.road.junction
        return junction is not None and abs(s - junction.s) < junction.half_width + 12.0

    def _enter(self, flow: Flow, chassis: Chassis, s: float, speed: float) -> None:
        """A vehicle in a lane at s, unless it would stand in another."""
        lane = flow.lane
        path = self._way_of(lane, s, chassis)
        mover = Mover(-1, chassis, Driver.draw(self.rng, lane.speed), path, 0.0, speed, lane)
        room = [abs(other.road[0] - s) for other in self.movers if self._same_lane(other, lane)]
        if min(room, default=math.inf) < 0.5 * (chassis.tail + chassis.nose) + 8.0:
            return
        mover.track = self.number()
        self.movers.append(mover)

    @staticmethod
    def _same_lane(mover: Mover, lane: Lane) -> bool:
        return abs(mover.road[1] - lane.d) < 0.75 * lane.width

    def _way_of(self, lane: Lane, s: float, chassis: Chassis) -> Path:
        """Straight on, into the crossing street, or into a parking place."""
        junction, rng = self.road.junction, self.rng
        length = chassis.tail + chassis.nose
        ahead = math.inf if junction is None else lane.direction * (junction.s - s)
        if junction is not None and 30.0 < ahead < math.inf and length < _LONGEST_TURNING:
            for way, chance in self._turns(lane):
                if rng.random() < chance:
                    return self._turn_off(junction, lane, s, way)
        row = self._row_beside(lane)
        if row is not None and length < _LONGEST_PARKING and rng.random() < _PULL_IN:
            place = s + lane.direction * rng.uniform(40.0, 160.0)
            if (
                not self._in_junction(place)
                and self._inside(place)
                and not 0.0 < ahead < abs(place - s) + 30.0
            ):
                return self._pull_in(lane, s, place, row, chassis.width)
        return self._lane_path(lane, s, chassis.width)

    def _inside(self, s: float) -> bool:
        return self.road.start + 30.0 < s < self.road.end - 30.0

    def _turns(self, lane: Lane) -> Iterator[tuple[int, float]]:
        """Directions across (+1: right of the road) into which vehicles of a lane turn, and how many do."""
        same = [abs(other.d) for other in self.road.layout.lanes if other.direction == lane.direction]
        if abs(lane.d) == max(same):
            yield lane.direction, _TURN_RIGHT
        if abs(lane.d) == min(same):
            yield -lane.direction, _TURN_LEFT

    def _cross_lane(self, junction: Junction, way: int) -> float:
        return junction.s - way * 0.5 * junction.half_width

    def _reach(self, side: int) -> float:
        """How far the crossing street is seen."""
        return min(self.road.layout.edge(side) + 36.0, self.road.layout.extent - 2.0)

    def _turn_off(self, junction: Junction, lane: Lane, s: float, way: int) -> Path:
        corner = np.array([self._cross_lane(junction, way), lane.d])
        radius = _RADIUS_RIGHT if way == lane.direction else _RADIUS_LEFT
        end = np.array([corner[0], way * self._reach(way)])
        return Path.along(self.road, rounded(np.array([s, lane.d]), corner, end, radius), "turning")

    def _lane_path(self, lane: Lane, s: float, width: float) -> Path:
        end = self.road.end - 1.0 if lane.direction > 0 else self.road.start + 1.0
        places = np.arange(s, end, 0.5 * lane.direction)
        slack = max(0.5 * (lane.width - width) - 0.5 * _LEAST_LANE, 0.0)
        wander = self.rng.normal(0.0, 0.15) + 0.08 * wave(self.rng, places, (60.0, 150.0))
        return Path.along(self.road, np.stack([places, lane.d + np.clip(wander, -slack, slack)], axis=1))

    def _row_beside(self, lane: Lane) -> Parking | None:
        """The parking places along the road beside a lane."""
        outermost = max(abs(o.d) for o in self.road.layout.lanes if o.direction == lane.direction)
        rows = [r for r in self.road.layout.parking if r.angle == 0.0 and r.side == lane.direction]
        return rows[0] if rows and abs(lane.d) == outermost else None

    def _kerb(self, row: Parking, width: float) -> float:
        return row.side * (self.road.layout.edge(row.side) - 0.3 - 0.5 * width)

    def _pull_in(self, lane: Lane, s: float, place: float, row: Parking, width: float) -> Path:
        begin = place - lane.direction * (_WAY_IN + _ALONG_KERB)
        way = shifted((begin, lane.d), self._kerb(row, width), _WAY_IN, place)
        return Path.along(self.road, np.concatenate([[[s, lane.d]], way]), stops=True)

    def _wait_to_leave(self, row: Parking, s: float) -> None:
        """A vehicle that is parked at s and will drive into the lane beside when there is a gap."""
        chassis = self._chassis(2.3, _LONGEST_PARKING)
        if chassis is None or self._in_junction(s):
            return
        lanes = [lane for lane in self.road.layout.lanes if lane.direction == row.side]
        lane = max(lanes, key=lambda o: abs(o.d))
        end = self.road.end - 1.0 if lane.direction > 0 else self.road.start + 1.0
        path = Path.along(self.road, shifted((s, self._kerb(row, chassis.width)), lane.d, 14.0, end))
        leaves = self.time + float(self.rng.uniform(0.0, _LEAVE))
        driver = Driver.draw(self.rng, lane.speed)
        self.movers.append(Mover(self.number(), chassis, driver, path, 0.0, 0.0, lane, leaves=leaves))

    # ---- what happens

    def step(self, h: float) -> None:
        """Everybody decides, then all move for h seconds."""
        movers = self.movers
        ahead = sight.leaders(movers)
        if self.road.junction is not None:
            self.crossroads.update(movers, ahead, self.time)
        for mover, leader in zip(movers, ahead, strict=True):
            if self._may_leave(mover):
                mover.leaves = None
            line = to_line(mover)
            if line is not None and (leader is None or line < leader[0]):
                leader = (max(line, 0.0), 0.0)
            mover.decide(leader, h)
            if leader is not None and mover is not self.ego:
                self._overtake(mover, leader)
        for mover in movers:
            mover.advance(h)
        self.time += h
        if self.ego is not None:
            self.centre = self.ego.road[0]
        self.movers = [m for m in movers if m is self.ego or self._stays(m)]
        self._arrivals(h)

    def _may_leave(self, mover: Mover) -> bool:
        if mover.leaves is None or mover.lane is None or self.time < mover.leaves:
            return False
        return sight.room_beside(mover, mover.lane.d, self.movers, 7.0, 9.0)

    def _stays(self, mover: Mover) -> bool:
        s, _ = mover.road
        near = self._rear - _GONE < s < self._front + _GONE
        return near and (mover.path.stops or mover.p < mover.path.length - 1.0)

    def _arrivals(self, h: float) -> None:
        ego = 0.0 if self.ego is None else self.ego.v
        for flow in self.flows:
            lane = flow.lane
            relative = lane.direction * lane.speed - ego
            if abs(relative) > 0.3:
                self._arrive(flow, self._rear if relative > 0.0 else self._front)
        junction = self.road.junction
        if junction is not None and self._rear < junction.s < self._front:
            for way in (-1, 1):
                if self.rng.random() < _CROSSING * h:
                    self._cross(junction, way)

    def _arrive(self, flow: Flow, edge: float) -> None:
        lane = flow.lane
        near = [m for m in self.movers if self._same_lane(m, lane)]
        room = min((abs(m.road[0] - edge) for m in near), default=math.inf)
        if flow.clear == 0.0:
            flow.clear = self._clear(flow, lane.speed)
        if room < flow.clear:
            return
        flow.clear = 0.0
        chassis = self._chassis(lane.width - _LEAST_LANE)
        if chassis is not None and not self._in_junction(edge):
            self._enter(flow, chassis, edge, min(lane.speed, math.sqrt(2.0 * max(room - 8.0, 1.0))))

    def _cross(self, junction: Junction, way: int) -> None:
        """A vehicle of the crossing street that goes straight on or turns into the road."""
        chassis = self._chassis(junction.half_width - 0.4, _LONGEST_TURNING)
        if chassis is None:
            return
        s, begin = self._cross_lane(junction, way), -way * self._reach(-way)
        path = self._way_across(junction, way, np.array([s, begin]))
        mover = Mover(-1, chassis, Driver.draw(self.rng, 8.0), path, 0.0, 4.0)
        if any(np.hypot(*(m.origin - mover.origin)) < 14.0 for m in self.movers):
            return
        mover.track = self.number()
        self.movers.append(mover)

    def _way_across(self, junction: Junction, way: int, begin: FloatArray) -> Path:
        choice = self.rng.random()
        if choice < 0.4:
            end = np.array([begin[0], way * self._reach(way)])
            return Path.along(self.road, np.stack([begin, end]), "crossing")
        right = choice < 0.7
        # travelling to the right of the road, its right-hand side is towards smaller s
        direction = -way if right else way
        lanes = sorted(
            (lane for lane in self.road.layout.lanes if lane.direction == direction), key=lambda o: abs(o.d)
        )
        lane = lanes[-1 if right else 0]
        corner = np.array([begin[0], lane.d])
        end = np.array([self.road.end - 1.0 if direction > 0 else self.road.start + 1.0, lane.d])
        return Path.along(
            self.road, rounded(begin, corner, end, _RADIUS_RIGHT if right else _RADIUS_LEFT), "turning"
        )

    def _overtake(self, mover: Mover, leader: tuple[float, float]) -> None:
        """Change lanes where the leader is slow and the lane beside has room."""
        lane, (gap, speed) = mover.lane, leader
        hurries = mover.driver.speed > speed + _HURRY and gap < 25.0 + mover.v
        if (
            lane is None
            or not hurries
            or mover.leaves is not None
            or mover.path.kind != "moving"
            or mover.path.stops
        ):
            return
        if self.time - mover.changed < _CHANGE_AGAIN or mover.v < 4.0 or abs(mover.road[1] - lane.d) > 0.6:
            return
        length = max(_LEAST_CHANGE, _CHANGE_SECONDS * mover.v)
        s, d = mover.road
        if self._near_junction(lane, s, length + 40.0) or not self._inside(s + lane.direction * length):
            return
        for other in self.road.layout.lanes:
            beside = other.direction == lane.direction and 0.1 < abs(other.d - lane.d) < 1.5 * lane.width
            wide = mover.chassis.width < other.width - _LEAST_LANE
            if beside and wide and sight.room_beside(mover, other.d, self.movers, 12.0 + 0.7 * mover.v, 10.0):
                end = self.road.end - 1.0 if lane.direction > 0 else self.road.start + 1.0
                mover.path = Path.along(self.road, shifted((s, d), other.d, length, end))
                mover.p, mover.lane, mover.changed, mover.granted = 0.0, other, self.time, False
                return

    def _near_junction(self, lane: Lane, s: float, within: float) -> bool:
        junction = self.road.junction
        return junction is not None and -20.0 < lane.direction * (junction.s - s) < within
