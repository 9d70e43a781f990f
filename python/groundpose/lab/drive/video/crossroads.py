"""Who may enter the junction: lights say whose turn it is; nobody enters while paths that meet are taken."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.video.mover import Mover
from groundpose.lab.drive.video.path import STEP

# Seconds of the lights: green for the road, then for its vehicles that still wait to turn left, then the same
# for the crossing street.
_ROAD, _CLEAR, _STREET = 22.0, 4.0, 10.0
# Room beside vehicles: their rear wheels cut corners.
_ROOM, _ROOM_TURNING = 0.3, 1.6
_SAME_ENTRY = 1.0  # paths that begin this near to each other follow one another, metres
_BEFORE_LINE = 0.8  # of the front end before the junction where a vehicle waits, metres


@dataclass
class Crossroads:
    """Lights and reservations of the junction."""

    holders: list[Mover] = field(default_factory=list)
    waiting: list[Mover] = field(default_factory=list)

    def update(self, movers: list[Mover], gaps: list[tuple[float, float] | None], time: float) -> None:
        """Release who has left, note who arrives, and let enter who can.

        Args:
            movers: all vehicles.
            gaps: gap and speed of the leader of each.
            time: now, seconds.
        """
        present = set(map(id, movers))
        self.holders = [m for m in self.holders if id(m) in present and not _has_left(m)]
        self.waiting = [m for m in self.waiting if id(m) in present and m.path.junction is not None]
        for mover, gap in zip(movers, gaps, strict=True):
            if self._arrives(mover, math.inf if gap is None else gap[0]):
                self.waiting.append(mover)
        blocked: list[Mover] = []
        for mover in sorted(self.waiting, key=lambda m: m.path.kind == "turning"):  # they let others go first
            if not _green(mover, time) or any(_meet(mover, other) for other in self.holders):
                blocked.append(mover)
            else:
                mover.granted = True
                self.holders.append(mover)
        self.waiting = blocked

    def _arrives(self, mover: Mover, gap: float) -> bool:
        line = to_line(mover)
        if line is None or mover.granted or mover in self.waiting:
            return False
        return line < mover.v**2 / 3.0 + 12.0 and gap > line


def to_line(mover: Mover) -> float | None:
    """Distance of the front end to the line before the junction; None when it has passed or never comes."""
    if mover.path.junction is None or mover.granted:
        return None
    ahead = mover.path.junction[0] - mover.p - mover.chassis.nose - _BEFORE_LINE
    return ahead if ahead > -4.0 else None


def _green(mover: Mover, time: float) -> bool:
    """Whether a vehicle may enter now."""
    assert mover.path.junction is not None
    entry = mover.path.junction[0]
    (s0, d0), (s1, d1) = mover.path.at(mover.path.road, np.array([entry - 1.0, entry]))
    now = time % (_ROAD + _STREET + 2.0 * _CLEAR)
    if abs(d1 - d0) > abs(s1 - s0):
        now -= _ROAD + _CLEAR
        green = _STREET
    else:
        green = _ROAD
    return 0.0 <= now < green + (_CLEAR if mover.path.kind == "turning" else 0.0)


def _has_left(mover: Mover) -> bool:
    return mover.path.junction is None or mover.p - mover.chassis.tail > mover.path.junction[1]


def _section(mover: Mover) -> FloatArray:
    assert mover.path.junction is not None
    first, last = (int(p / STEP) for p in mover.path.junction)
    return mover.path.place[first : last + 2]


def _meet(a: Mover, b: Mover) -> bool:
    """Whether two vehicles could touch in the junction."""
    one, other = _section(a), _section(b)
    if np.hypot(*(one[0] - other[0])) < _SAME_ENTRY:
        return False
    room = 0.5 * (a.chassis.width + b.chassis.width)
    room += max(_ROOM_TURNING if m.path.kind == "turning" else _ROOM for m in (a, b))
    apart = np.linalg.norm(one[:, None] - other[None], axis=2)
    return bool(apart.min() < room)
