"""What traffic did: rows of every frame, without the vehicles that would have touched another."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.drive.footprints import Footprints, candidates, touching
from groundpose.lab.drive.video.mover import BRAKED, Chassis, Mover
from groundpose.lab.drive.video.sight import footprints

_MARGIN = 0.05
"""Room kept free around vehicles, metres."""


@dataclass(frozen=True, eq=False)
class Moment:
    """The moving vehicles of a frame, row by row: track, x, z, heading in the world, speed along the heading,
    acceleration, yaw rate (positive to the right), steering angle, state, brake lamps. SI units."""

    track: NDArray[np.int64]
    place: FloatArray
    heading: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    yaw_rate: FloatArray
    steering: FloatArray
    state: tuple[str, ...]
    braking: NDArray[np.bool_]

    @classmethod
    def of(cls, movers: list[Mover]) -> Moment:
        """Of vehicles as they are now."""
        steering = np.array([m.steering for m in movers])
        front, base = np.array([m.v for m in movers]), np.array([m.chassis.base for m in movers])
        a = np.array([m.a for m in movers])
        states = tuple(m.state for m in movers)
        stands = (front < 0.1) & (np.array(states) != "parked") if movers else np.zeros(0, bool)
        return cls(
            track=np.array([m.track for m in movers], np.int64),
            place=np.array([m.origin for m in movers]).reshape(-1, 2),
            heading=np.array([m.heading for m in movers]),
            speed=front * np.cos(steering),
            acceleration=a * np.cos(steering),
            yaw_rate=front * np.sin(steering) / base,
            steering=steering,
            state=states,
            braking=(a < -BRAKED) | stands,
        )

    def without(self, tracks: set[int]) -> Moment:
        """Without some vehicles."""
        kept = np.array([track not in tracks for track in self.track.tolist()], bool)
        rows = np.flatnonzero(kept)
        values = {name: getattr(self, name)[kept] for name in self.__dataclass_fields__ if name != "state"}
        return Moment(**values, state=tuple(self.state[i] for i in rows))


@dataclass(eq=False)
class Recording:
    """Frames, and the pairs that touched; `parked`: boxes of those that stand for the whole video."""

    parked: Footprints | None
    moments: list[Moment] = field(default_factory=list)
    chassis: dict[int, Chassis] = field(default_factory=dict)
    touched: set[tuple[int, int]] = field(default_factory=set)

    def watch(self, movers: list[Mover], parked: NDArray[np.int64]) -> None:
        """Note who touches whom; `parked` (P,): tracks of the parked vehicles."""
        for mover in movers:
            self.chassis.setdefault(mover.track, mover.chassis)
        if not movers:
            return
        tracks = np.array([m.track for m in movers])
        boxes = footprints(movers, _MARGIN)
        self._note(boxes, tracks, boxes, tracks)
        if self.parked is not None:
            self._note(boxes, tracks, self.parked, parked)

    def _note(
        self, a: Footprints, tracks: NDArray[np.int64], b: Footprints, others: NDArray[np.int64]
    ) -> None:
        i, j = candidates(a, b)
        different = tracks[i] != others[j]
        i, j = i[different], j[different]
        meets = touching(a[i], b[j])
        self.touched.update(zip(tracks[i[meets]].tolist(), others[j[meets]].tolist(), strict=True))

    def removed(self, keep: int | None, parked: set[int]) -> set[int]:
        """Tracks without which nobody touches anybody: parked ones first, then those that touch most."""
        pairs = {(min(pair), max(pair)) for pair in self.touched}
        gone: set[int] = set()
        while pairs:
            counts = Counter(track for pair in pairs for track in pair if track != keep)
            worst = max(counts, key=lambda t: (t in parked, counts[t], t))
            gone.add(worst)
            pairs = {pair for pair in pairs if worst not in pair}
        return gone
