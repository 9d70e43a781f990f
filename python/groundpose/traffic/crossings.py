"""Who crosses a line: when, where, which way and how fast."""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from groundpose._checks import FloatArray, input_error, number, type_error
from groundpose.tracking import Tracks
from groundpose.traffic.shapes import Lane, Line

MARGIN = 0.5
"""Metres on both sides of a line."""
_FRAME, _TIME, _PLACE, _HEADING, _SPEED, _SPEED_SIGMA, _LENGTH = 0, 1, slice(2, 4), 4, 5, 6, 7
_SPREAD = slice(8, 12)
"""Columns of what is kept of a vehicle's rows."""


@dataclass(frozen=True)
class Crossing:
    """The middle of a vehicle's bottom face has crossed a line."""

    line: str
    """Name of the line, or of the lane across whose middle it is."""
    lane: str
    """Name of the lane in which it was; "": in none."""
    direction: str
    """Which way: one of `Line.directions`."""
    id: int
    """Number of the vehicle, as in `Tracks`."""
    name: str
    """Its class."""
    frame: int
    """Number of the first frame after it."""
    time: float
    """Seconds, between the frames around it."""
    time_sigma: float
    """Seconds, its standard deviation, of the place's and the speed."""
    place: tuple[float, float]
    """Metres right and forward of the camera."""
    heading: float
    """Radians, of the vehicle, from forward to the right."""
    speed: float
    """m/s, without a sign."""
    speed_sigma: float
    """m/s."""
    length: float
    """Metres, of the vehicle."""
    headway: float = math.nan
    """Seconds since the crossing before on the same line and lane in the same direction; NaN: it is the
    first."""
    spacing: float = math.nan
    """Metres to the vehicle of that crossing, from middle to middle, if that went on as fast."""


class CrossingCounter:
    """Crossings of lines, and of the middle of lanes, in order of time.

    A crossing needs both sides: a vehicle is first at least `margin` on one side of the line and then at
    least as far on the other. One that stands on the line, or was first seen there, has not crossed it; one
    that drives back has crossed it twice.

    >>> counter = gp.CrossingCounter([gp.Line("gate", [-6.0, 20.0], [6.0, 20.0])])
    >>> crossings = counter.of(tracks)
    >>> [(c.time, c.id, c.speed) for c in crossings]

    Args:
        lines: to be crossed.
        lanes: which tell where lines are crossed, and are counted across their sections.
        margin: metres.

    Raises:
        InputError: no line and no lane, a name twice, a margin that is not positive. TypeError: something
            else.
    """

    def __init__(
        self, lines: Sequence[Line] = (), lanes: Sequence[Lane] = (), margin: float = MARGIN
    ) -> None:
        """One that has seen nothing."""
        for argument, given, kind in (("lines", lines, Line), ("lanes", lanes, Lane)):
            for item in given:
                if not isinstance(item, kind):
                    raise type_error(argument, f"a {kind.__name__}", item)
        names = [*(line.name for line in lines), *(lane.name for lane in lanes)]
        if not names:
            raise input_error("lines", "a line or a lane", "none")
        for name in names:
            if names.count(name) > 1:
                raise input_error("lines", "names that are all different", f"{name!r} twice")
        if not 0.0 < number("margin", margin) < math.inf:
            raise input_error("margin", "metres above 0", margin)
        self.lines: tuple[Line, ...] = (*lines, *(lane.section for lane in lanes))
        self.lanes, self.margin = tuple(lanes), margin
        self.settled = -1.0
        """Number of the frame up to which all crossings have been released."""
        self.counts: Counter[tuple[str, str, str]] = Counter()
        """Crossings of a line, in a lane, in a direction, those that have not been released too."""
        self._followed: dict[int, _Followed] = {}
        self._waiting: list[tuple[float, int, int, Crossing]] = []
        self._leaders: dict[tuple[str, str, str], Crossing] = {}

    def of(self, tracks: Tracks) -> list[Crossing]:
        """All crossings of all rows of the vehicles, and of those that were added before."""
        return self.add(tracks, 0) + self.finish()

    def add(self, tracks: Tracks, complete: int) -> list[Crossing]:
        """More rows, those of each vehicle in order of time.

        Args:
            tracks: rows that were not added before, as `Tracker.take` hands them out.
            complete: number of the frame before which no row is to come any more, `Tracker.open_frame`.

        Returns:
            Crossings that no other can precede any more.
        """
        if not isinstance(tracks, Tracks):
            raise type_error("tracks", "Tracks", tracks)
        rows = np.column_stack(
            [
                *(tracks.frame, tracks.time, tracks.place, tracks.heading, tracks.speed),
                *(tracks.speed_sigma, tracks.size[:, 0], tracks.place_covariance.reshape(-1, 4)),
            ]
        )
        for vehicle in np.unique(tracks.id).tolist():
            mine = tracks.id == vehicle
            self._follow(vehicle, str(tracks.name[mine][-1]), rows[mine])
        # One that is still there has a row in every frame.
        self._followed = {v: kept for v, kept in self._followed.items() if kept.last >= complete - 1}
        begun = min((kept.begun for kept in self._followed.values()), default=complete)
        self.settled = min(begun, complete - 1)
        return self._released(self.settled)

    def finish(self) -> list[Crossing]:
        """No more rows come: the crossings that are left."""
        self._followed.clear()
        self.settled = math.inf
        return self._released(math.inf)

    def _follow(self, vehicle: int, name: str, rows: FloatArray) -> None:
        before = self._followed.get(vehicle)
        kept, begun = [], math.inf
        for k, line in enumerate(self.lines):
            path = rows if before is None else np.concatenate([before.paths[k], rows])
            along, across = line.along_and_across(path[:, _PLACE])
            side = np.where(np.abs(across) >= self.margin, np.sign(across), 0.0)
            sure = np.flatnonzero(side)
            for f in np.flatnonzero(np.diff(side[sure])).tolist():
                i, j = int(sure[f]), int(sure[f + 1])
                at = i + _changes(across[i : j + 1] * side[i])[-1]
                share = float(across[at] / (across[at] - across[at + 1]))
                if 0.0 <= along[at] + share * (along[at + 1] - along[at]) <= line.length:
                    self._note(k, vehicle, name, path[at : at + 2], share, bool(side[j] > 0.0))
            last = int(sure[-1]) if len(sure) else len(path) - 1
            changes = [last + at for at in _changes(across[last:] * side[last])[-1:]]
            kept.append(path[sorted({last, len(path) - 1, *changes, *(at + 1 for at in changes)})])
            begun = min([begun, *(float(path[at, _FRAME]) for at in changes)])
        self._followed[vehicle] = _Followed(kept, int(rows[-1, _FRAME]), begun)

    def _note(
        self, k: int, vehicle: int, name: str, around: FloatArray, share: float, rightwards: bool
    ) -> None:
        """A crossing between two rows, `share` of the way from the first to the second."""
        line = self.lines[k]
        row = (1.0 - share) * around[0] + share * around[1]
        nearer = around[round(share)]
        start, end = line.along_and_across(around[:, _PLACE])[1]
        pace = abs(float((end - start) / (around[1, _TIME] - around[0, _TIME])))
        direction = (line.end - line.start) / line.length
        normal = np.array([direction[1], -direction[0]])
        spread = float(normal @ row[_SPREAD].reshape(2, 2) @ normal)
        place = row[_PLACE]
        crossing = Crossing(
            line=line.name,
            lane=self._lane_of(k, place),
            direction=line.directions[0 if rightwards else 1],
            id=vehicle,
            name=name,
            frame=int(around[1, _FRAME]),
            time=float(row[_TIME]),
            time_sigma=math.sqrt(spread) / pace,
            place=(float(place[0]), float(place[1])),
            heading=float(nearer[_HEADING]),  # which may turn over from pi to -pi
            speed=abs(float(row[_SPEED])),
            speed_sigma=float(row[_SPEED_SIGMA]),
            length=float(nearer[_LENGTH]),
        )
        self.counts[crossing.line, crossing.lane, crossing.direction] += 1
        heapq.heappush(self._waiting, (crossing.time, vehicle, k, crossing))

    def _lane_of(self, k: int, place: FloatArray) -> str:
        drawn = len(self.lines) - len(self.lanes)
        if k >= drawn:
            return self.lanes[k - drawn].name
        return next((lane.name for lane in self.lanes if lane.contains(place[None])[0]), "")

    def _released(self, frame: float) -> list[Crossing]:
        """Those up to a frame; with what the ones before them say."""
        released = []
        while self._waiting and self._waiting[0][-1].frame <= frame:
            crossing = heapq.heappop(self._waiting)[-1]
            place = crossing.line, crossing.lane, crossing.direction
            leader = self._leaders.get(place)
            if leader is not None:
                headway = crossing.time - leader.time
                crossing = replace(crossing, headway=headway, spacing=headway * leader.speed)
            self._leaders[place] = crossing
            released.append(crossing)
        return released


@dataclass(frozen=True, eq=False)
class _Followed:
    """What is kept of a vehicle.

    Attributes:
        paths: of each line, the last row surely on one side, the two around the last place on the line after
            it, the last row.
        last: number of its last frame.
        begun: number of the frame after which it may have begun to cross a line; infinite: none.
    """

    paths: list[FloatArray]
    last: int
    begun: float


def _changes(across: FloatArray) -> list[int]:
    """Rows after which a path that begins above 0 goes below it."""
    return np.flatnonzero((across[:-1] > 0.0) & (across[1:] <= 0.0)).tolist()  # type: ignore[no-any-return]
