"""How the camera of a drive is mounted: height, tilt, field of view, sensor, on a vehicle or on a mast."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from groundpose._checks import input_error, integer, number
from groundpose.types import Camera

Range = tuple[float, float]
Size = tuple[int, int]

SENSORS: tuple[Size, ...] = (
    (640, 480), (1024, 768), (1242, 375), (1280, 720), (1280, 960), (1600, 900), (1914, 1080),
    (1920, 1080), (1920, 1208), (2048, 1536),
)  # fmt: skip
"""Widths and heights of usual sensors and of public data sets, pixels."""

MAST = 3.0
"""Cameras from this height on stand still where a rig does not say, metres."""


@dataclass(frozen=True)
class Mount:
    """The camera of one drive.

    Args:
        camera: the camera.
        height: metres above the road under it; None: drawn with the car.
        pitch, roll: nominal tilt, radians, as in `View`; the true one differs by a small error and motion.
        standing: on a mast, not on a vehicle.
    """

    camera: Camera
    height: float | None
    pitch: float
    roll: float
    standing: bool

    @property
    def fov(self) -> float:
        """Horizontal field of view, radians."""
        assert self.camera.image_size is not None
        return 2.0 * math.atan(0.5 * self.camera.image_size[0] / self.camera.fx)

    @property
    def tilted(self) -> bool:
        """Whether the nominal tilt is not zero."""
        return self.pitch != 0.0 or self.roll != 0.0


@dataclass(frozen=True)
class Rig:
    """Ranges `(low, high)` from which the mount of a drive is drawn.

    Args:
        height: metres; None: as the car's, 1.2 to 1.8.
        pitch_deg: negative looks down. roll_deg: about the optical axis.
        fov_deg: horizontal field of view.
        image_sizes: width, height, to choose from.
        standing: whether the camera stands still; None: from `MAST` metres on.
        aim: distance in metres at which the optical axis meets the ground; the pitch follows from it and
            from the height, cut at `pitch_deg`. None: the pitch is uniform.
    """

    height: Range | None = None
    pitch_deg: Range = (0.0, 0.0)
    roll_deg: Range = (0.0, 0.0)
    fov_deg: Range = (50.8, 50.8)
    image_sizes: tuple[Size, ...] = ((1914, 1080),)
    standing: bool | None = False
    aim: Range | None = None

    def draw(self, rng: np.random.Generator) -> Mount:
        """The mount of a drive."""
        height = None if self.height is None else float(rng.uniform(*self.height))
        pitch_deg = float(rng.uniform(*self.pitch_deg))
        if self.aim is not None and height is not None:
            away = math.exp(rng.uniform(*np.log(self.aim)))
            pitch_deg = float(np.clip(-math.degrees(math.atan2(height, away)), *self.pitch_deg))
        roll_deg, fov_deg = float(rng.uniform(*self.roll_deg)), float(rng.uniform(*self.fov_deg))
        size = self.image_sizes[int(rng.integers(len(self.image_sizes)))]
        standing = self.standing
        if standing is None:
            standing = height is not None and height >= MAST
        return Mount(
            Camera.from_fov(*size, math.radians(fov_deg)),
            height,
            math.radians(pitch_deg),
            math.radians(roll_deg),
            standing,
        )


Rigs = tuple[tuple[float, Rig], ...]
"""Rigs and their relative frequencies."""

_CAR = Rig()
CAMERA = _CAR.draw(np.random.default_rng(0)).camera
"""The camera of the rig "car"."""

_ASSISTANCE = Rig((1.0, 2.0), (-4.0, 5.0), (-2.0, 2.0), (30.0, 100.0), SENSORS)
_TRUCK = Rig((2.2, 3.2), (-15.0, 2.0), (-3.0, 3.0), (40.0, 120.0), SENSORS)
_ROAD_SIDE = Rig((3.0, 12.0), (-45.0, -5.0), (-5.0, 5.0), (20.0, 100.0), SENSORS, True, (8.0, 80.0))

RIGS: dict[str, Rigs] = {
    "car": ((1.0, _CAR),),
    "assistance": ((1.0, _ASSISTANCE),),
    "truck": ((1.0, _TRUCK),),
    "mast": ((1.0, _ROAD_SIDE),),
    "mixed": ((0.2, _CAR), (0.5, _ASSISTANCE), (0.15, _TRUCK), (0.15, _ROAD_SIDE)),
}
"""Rigs by name. "car": the camera of one car, level but for its motion. "mixed": all kinds, for training."""

DEFAULT_RIG = "car"

# Least and largest value of a range.
_LIMITS = {
    "height": (0.3, 30.0),
    "pitch_deg": (-60.0, 30.0),
    "roll_deg": (-30.0, 30.0),
    "fov_deg": (5.0, 150.0),
}
_LEAST_SIZE, _LARGEST_SIZE = 64, 8192


def rigs(
    name: str,
    height: Range | None = None,
    pitch_deg: Range | None = None,
    roll_deg: Range | None = None,
    fov_deg: Range | None = None,
    image_size: Size | None = None,
) -> Rigs:
    """The rigs of a name with other ranges; None keeps the rig's own.

    With another height the rig "car" stands still from `MAST` metres on. With another pitch the optical axis
    is no longer aimed at the road.

    Raises:
        InputError: an unknown name, a range that is reversed or beyond what a camera can be.
    """
    if name not in RIGS:
        raise input_error("rig", f"one of {', '.join(RIGS)}", repr(name))
    ranges = {"height": height, "pitch_deg": pitch_deg, "roll_deg": roll_deg, "fov_deg": fov_deg}
    changes: dict[str, Any] = {k: _checked(k, r) for k, r in ranges.items() if r is not None}
    if height is not None and name == DEFAULT_RIG:
        changes["standing"] = None
    if pitch_deg is not None:
        changes["aim"] = None
    if image_size is not None:
        changes["image_sizes"] = (_checked_size(image_size),)
    return tuple((weight, replace(rig, **changes)) for weight, rig in RIGS[name])


def draw_mount(rng: np.random.Generator, among: Rigs) -> Mount:
    """The mount of a drive from one of the rigs."""
    weights = np.array([weight for weight, _ in among])
    return among[int(rng.choice(len(among), p=weights / weights.sum()))][1].draw(rng)


def _checked(name: str, given: Range) -> Range:
    low, high = (number(name, value) for value in given)
    least, most = _LIMITS[name]
    if not least <= low <= high <= most:
        raise input_error(
            name, f"a range within {least:g}..{most:g}, the smaller value first", f"{low:g}..{high:g}"
        )
    return low, high


def _checked_size(given: Size) -> Size:
    width, height = (integer("image_size", value) for value in given)
    if not _LEAST_SIZE <= min(width, height) <= max(width, height) <= _LARGEST_SIZE:
        expected = f"sides from {_LEAST_SIZE} to {_LARGEST_SIZE} pixels"
        raise input_error("image_size", expected, f"{width}x{height}")
    return width, height
