"""A vehicle in motion: its body, its driver and its state."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.body_cache import measures
from groundpose.lab.drive.road import Lane
from groundpose.lab.drive.video.path import Path

BRAKED = 1.0
"""Deceleration from which the brake lamps are on, m/s^2."""
HARDEST = 7.5
"""Largest deceleration, m/s^2."""
_LOOK = 0.6  # seconds before a curve at which a driver begins to adapt the speed
_STILL = 0.05  # m/s
_TURNING = 6.0  # metres before and after the junction that belong to a turn


@dataclass(frozen=True, eq=False)
class Chassis:
    """What moves: class, body and look; from its origin, metres: `box` (2, 2) `[[x, z] min, max]`, z of the
    `front` and `rear` axles."""

    class_name: str
    seed: int
    look_seed: int
    lamps: float
    box: FloatArray
    front: float
    rear: float

    @classmethod
    def of(cls, class_name: str, seed: int, rng: np.random.Generator) -> Chassis:
        """That of a body, with a random look."""
        body = measures(class_name, seed)
        axles = body.wheels[:, 2]
        middle = 0.5 * (axles.min() + axles.max())
        front, rear = float(axles[axles > middle].mean()), float(axles[axles < middle].mean())
        look, lamps = int(rng.integers(2**31)), float(rng.random())
        return cls(class_name, seed, look, lamps, body.bbox_3d[:, [0, 2]], front, rear)

    @property
    def base(self) -> float:
        """Wheelbase."""
        return self.front - self.rear

    @property
    def nose(self) -> float:
        """Of the front end before the front axle."""
        return float(self.box[1, 1]) - self.front

    @property
    def tail(self) -> float:
        """Of the rear end behind the front axle."""
        return self.front - float(self.box[0, 1])

    @property
    def width(self) -> float:
        """Metres."""
        return float(self.box[1, 0] - self.box[0, 0])


@dataclass(frozen=True)
class Driver:
    """Constants of the intelligent driver model (Treiber et al., Physical Review E 62, 2000): wanted speed,
    time gap, least gap, acceleration, comfortable deceleration; SI units."""

    speed: float
    headway: float
    gap: float
    acceleration: float
    comfort: float

    @classmethod
    def draw(cls, rng: np.random.Generator, speed: float) -> Driver:
        """A driver in a lane where `speed` is usual."""
        return cls(
            speed * float(np.clip(rng.normal(1.0, 0.1), 0.7, 1.3)),
            float(rng.uniform(0.8, 1.8)),
            float(rng.uniform(1.2, 2.5)),
            float(rng.uniform(1.0, 2.2)),
            float(rng.uniform(1.5, 2.5)),
        )

    def free(self, v: float) -> float:
        """Acceleration without anybody ahead."""
        return self.acceleration * (1.0 - (v / self.speed) ** 4)

    def behind(self, v: float, gap: float, leader: float) -> float:
        """Acceleration `gap` metres behind a leader of that speed."""
        wanted = v * self.headway + v * (v - leader) / (2.0 * math.sqrt(self.acceleration * self.comfort))
        wanted = self.gap + max(wanted, 0.0)
        return self.acceleration * (1.0 - (v / self.speed) ** 4 - (wanted / max(gap, 0.05)) ** 2)


@dataclass(eq=False)
class Mover:
    """A vehicle that follows a path: its front axle is at length `p` of it, and the rear axle `rear` (2,) is
    drawn along, so that the rear wheels never slide sideways. `v`: speed of the front axle."""

    track: int
    chassis: Chassis
    driver: Driver
    path: Path
    p: float
    v: float
    lane: Lane | None = None
    rear: FloatArray = field(default_factory=lambda: np.zeros(2))
    heading: float = 0.0
    a: float = 0.0
    granted: bool = False
    leaves: float | None = None
    """When it leaves its parking place, seconds; None: it is on its way."""
    changed: float = -math.inf
    """Time of the last change of lanes, seconds."""
    road: tuple[float, float] = (0.0, 0.0)
    """s, d of the front axle."""

    def __post_init__(self) -> None:
        """Stand straight on the path."""
        self.heading = float(self.path.row(self.path.heading, self.p))
        self.rear = self.front - self.chassis.base * self.forward
        self._locate()

    def _locate(self) -> None:
        s, d = self.path.row(self.path.road, self.p).tolist()
        self.road = (s, d)

    @property
    def front(self) -> FloatArray:
        """(2,) x, z of the front axle."""
        return np.asarray(self.path.row(self.path.place, self.p))

    @property
    def forward(self) -> FloatArray:
        """(2,) x, z."""
        return np.array([math.sin(self.heading), math.cos(self.heading)])

    @property
    def origin(self) -> FloatArray:
        """(2,) x, z of the body's origin."""
        return self.rear - self.chassis.rear * self.forward

    @property
    def steering(self) -> float:
        """Angle of the front wheels, radians, positive to the right."""
        return math.remainder(float(self.path.row(self.path.heading, self.p)) - self.heading, 2.0 * math.pi)

    @property
    def parked(self) -> bool:
        """Whether it waits in a parking place or has stopped for good."""
        return self.leaves is not None or (
            self.path.stops and self.v < _STILL and self.p > self.path.length - 1.0
        )

    @property
    def state(self) -> str:
        """As in `Vehicle`."""
        if self.parked:
            return "parked"
        turning = self.path.kind == "turning" and self.path.junction is not None
        first, last = self.path.junction if turning and self.path.junction else (-math.inf, math.inf)
        return self.path.kind if first - _TURNING < self.p < last + _TURNING else "moving"

    def decide(self, leader: tuple[float, float] | None, h: float) -> None:
        """Choose the acceleration for h seconds; `leader`: gap and speed of what is ahead, None: nothing."""
        if self.parked:
            self.a = self.v = 0.0
            return
        wanted = self.driver.free(self.v) if leader is None else self.driver.behind(self.v, *leader)
        allowed = self.path.allowed(self.p + self.v * _LOOK)
        wanted = min(wanted, (allowed - self.v) / _LOOK)
        self.a = max(min(wanted, self.driver.acceleration), -HARDEST, -self.v / h)

    def advance(self, h: float, steps: int = 4) -> None:
        """Move for h seconds."""
        for _ in range(steps):
            self.p += max(self.v * h / steps + 0.5 * self.a * (h / steps) ** 2, 0.0)
            self.v = max(self.v + self.a * h / steps, 0.0)
            x, z = (self.front - self.rear).tolist()
            self.heading = math.atan2(x, z)
            self.rear = self.front - self.chassis.base * self.forward
        self._locate()
