"""Traffic of lines and lanes in intervals of time."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from groundpose._checks import input_error, number
from groundpose.traffic.crossings import Crossing, CrossingCounter

_HOUR = 3600.0
_TOUCHED = 0.02
"""Part of a line in a lane that it only touches, at most."""
_Place = tuple[str, str, str]


@dataclass(frozen=True)
class Flow:
    """The crossings of a line, in one lane and direction, in an interval of time."""

    begin: float
    """Seconds."""
    end: float
    """Seconds."""
    line: str
    """Name of the line, or of the lane across whose middle it is."""
    lane: str
    """Name of the lane; "": in none."""
    direction: str
    """One of `Line.directions`."""
    counts: dict[str, int]
    """Vehicles by class."""
    mean_speed: float
    """m/s, the mean of the vehicles' speeds; NaN: there are none, as below."""
    mean_speed_sigma: float
    """m/s, standard deviation of the mean, of the errors of the speeds."""
    speed_deviation: float
    """m/s, standard deviation among the vehicles; NaN: of fewer than two."""
    mean_headway: float
    """Seconds."""
    least_headway: float
    """Seconds."""
    mean_spacing: float
    """Metres."""

    @property
    def count(self) -> int:
        """Vehicles."""
        return sum(self.counts.values())

    @property
    def flow(self) -> float:
        """Vehicles an hour; NaN: no time passed."""
        passed = self.end - self.begin
        return _HOUR * self.count / passed if passed > 0.0 else math.nan


class TrafficSummary:
    """Traffic in intervals, one after the other; each has a `Flow` for every line, lane on it and direction,
    also where nobody came.

    >>> counter = gp.CrossingCounter(lines, lanes)
    >>> summary = gp.TrafficSummary(counter, every=300.0)
    >>> flows = summary.of(counter.of(tracks), tracks.time)

    Args:
        counter: whose crossings they are.
        every: seconds of an interval, which begins at a multiple of it; None: all in one.

    Raises:
        InputError: seconds that are not above 0. TypeError: something else.
    """

    def __init__(self, counter: CrossingCounter, every: float | None = None) -> None:
        """One that has seen nothing."""
        if every is not None and not 0.0 < number("every", every) < math.inf:
            raise input_error("every", "seconds above 0", every)
        self.every = math.inf if every is None else every
        self._places = tuple(_places(counter))
        self._watched: deque[tuple[float, float]] = deque()
        self._sums: dict[float, dict[_Place, _Sum]] = {}
        self._first = math.nan

    def of(self, crossings: Iterable[Crossing], times: Iterable[float]) -> list[Flow]:
        """All intervals. `crossings` in order of time; `times` in seconds of frames in which all was seen, at
        least the first and the last."""
        for time in sorted(set(times)):
            self.watch(time)
        self.add(crossings)
        return self.take(math.inf)

    def watch(self, time: float) -> None:
        """A frame, in order of time: intervals without one have no rows."""
        if math.isnan(self._first):
            self._first = time
        begin = self._begin(time)
        if self._watched and self._watched[-1][0] == begin:
            self._watched.pop()
        self._watched.append((begin, time))

    def add(self, crossings: Iterable[Crossing]) -> None:
        """More crossings."""
        for crossing in crossings:
            sums = self._sums.setdefault(self._begin(crossing.time), {})
            place = crossing.line, crossing.lane, crossing.direction
            sums.setdefault(place, _Sum()).add(crossing)

    def take(self, until: float) -> list[Flow]:
        """Intervals that end at or before `until` (seconds), before which no more crossings come."""
        flows: list[Flow] = []
        while self._watched and (math.isinf(until) or self._watched[0][0] + self.every <= until):
            begin, last = self._watched.popleft()
            is_last = math.isinf(until) and not self._watched
            times = max(begin, self._first), last if is_last else begin + self.every
            sums = self._sums.pop(begin, {})
            places = dict.fromkeys((*self._places, *sums))
            flows += [sums.get(place, _Sum()).flow(*times, place) for place in places]
        return flows

    def _begin(self, time: float) -> float:
        return -math.inf if math.isinf(self.every) else self.every * math.floor(time / self.every)


class _Sum:
    """Crossings of one place in an interval."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.speeds, self.squares, self.variances = _Mean(), _Mean(), _Mean()
        self.headways, self.spacings = _Mean(), _Mean()

    def add(self, crossing: Crossing) -> None:
        self.counts[crossing.name] += 1
        self.speeds.add(crossing.speed)
        self.squares.add(crossing.speed**2)
        self.variances.add(crossing.speed_sigma**2)
        if not math.isnan(crossing.headway):
            self.headways.add(crossing.headway)
            self.spacings.add(crossing.spacing)

    def flow(self, begin: float, end: float, place: _Place) -> Flow:
        n, mean = self.speeds.count, self.speeds.value
        spread = max(self.squares.value - mean**2, 0.0) * n / (n - 1) if n > 1 else math.nan
        return Flow(
            *(begin, end, *place, dict(self.counts)),
            mean_speed=mean,
            mean_speed_sigma=math.sqrt(self.variances.value / n) if n else math.nan,
            speed_deviation=math.sqrt(spread),
            mean_headway=self.headways.value,
            least_headway=self.headways.least,
            mean_spacing=self.spacings.value,
        )


class _Mean:
    """A running mean; NaN of nothing."""

    def __init__(self) -> None:
        self.count, self._total, self._least = 0, 0.0, math.inf

    def add(self, value: float) -> None:
        self.count, self._total, self._least = self.count + 1, self._total + value, min(self._least, value)

    @property
    def value(self) -> float:
        return self._total / self.count if self.count else math.nan

    @property
    def least(self) -> float:
        return self._least if self.count else math.nan


def _places(counter: CrossingCounter) -> Iterator[_Place]:
    """Each line with the lanes that it leads through, each direction."""
    drawn = len(counter.lines) - len(counter.lanes)
    for k, line in enumerate(counter.lines):
        points = line.start + np.linspace(0.0, 1.0, 201)[:, None] * (line.end - line.start)
        through = [lane.name for lane in counter.lanes if lane.contains(points).mean() > _TOUCHED]
        for lane in [counter.lanes[k - drawn].name] if k >= drawn else through or [""]:
            yield from ((line.name, lane, direction) for direction in line.directions)
