"""Measures of one car, drawn for its style and correlated through its age and its size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from groundpose.lab.bodies.dimensions import Dimensions, draw_dimensions


class _Style(NamedTuple):
    """Means of a style; heights are fractions of the car's height, the rest metres or degrees."""

    bonnet: float  # height of the bonnet's front edge
    cowl: float  # height of the windscreen's lower edge
    belt: float  # height of the belt line at the windscreen
    deck: float  # height of the rear window's lower edge
    cab: float  # windscreen's lower edge behind the front axle, m
    rake_front: float  # windscreen from the horizontal, deg
    rake_rear: tuple[float, float]  # rear window, deg
    boot: tuple[float, float]  # length of the boot lid, m
    roof: float  # half width of the roof's edge as a fraction of the body's
    roof_fall: tuple[float, float]  # the roof's rear edge below its highest point, m
    two_door: float  # fraction with two side doors
    pillar: tuple[float, float]  # rear pillar at its lower and upper end, m


_STYLES: dict[str, _Style] = {
    "sedan": _Style(
        *(0.490, 0.660, 0.630, 0.712, 0.36, 30.0, (22, 33), (0.30, 0.70), 0.710, (0.05, 0.10), 0.0),
        (0.28, 0.20),
    ),
    "hatchback": _Style(
        *(0.485, 0.655, 0.625, 0.680, 0.24, 31.5, (38, 66), (0.0, 0.03), 0.735, (0.04, 0.12), 0.30),
        (0.26, 0.14),
    ),
    "estate": _Style(
        *(0.485, 0.655, 0.625, 0.680, 0.36, 30.5, (40, 66), (0.0, 0.03), 0.720, (0.03, 0.09), 0.0),
        (0.13, 0.09),
    ),
    "suv": _Style(
        *(0.525, 0.665, 0.640, 0.680, 0.36, 33.5, (40, 66), (0.0, 0.03), 0.745, (0.03, 0.10), 0.0),
        (0.13, 0.09),
    ),
    "coupe": _Style(
        *(0.500, 0.675, 0.650, 0.735, 0.46, 27.5, (17, 27), (0.25, 0.65), 0.680, (0.07, 0.13), 1.0),
        (0.28, 0.20),
    ),
    "city_car": _Style(
        *(0.500, 0.655, 0.625, 0.685, 0.12, 34.0, (50, 70), (0.0, 0.02), 0.740, (0.03, 0.10), 0.45),
        (0.24, 0.14),
    ),
    "kei_car": _Style(
        *(0.515, 0.615, 0.590, 0.630, 0.00, 40.0, (68, 80), (0.0, 0.01), 0.810, (0.01, 0.05), 0.0),
        (0.16, 0.10),
    ),
    "mpv": _Style(
        *(0.480, 0.625, 0.600, 0.640, 0.15, 34.0, (50, 70), (0.0, 0.02), 0.755, (0.03, 0.09), 0.0),
        (0.14, 0.09),
    ),
}


# Shortest roof along the middle, metres: with one row of doors and with two.
_SHORTEST_ROOF = 0.95, 1.05


@dataclass(frozen=True)
class CarShape:
    """One car. Metres, radians; heights above the ground, z along the object frame."""

    style: str
    outer: Dimensions
    bonnet_height: float
    cowl_height: float
    cowl_z: float  # windscreen's lower edge on the middle plane
    belt_height: float  # at the windscreen's corner
    belt_rise: float  # to the rear end of the side windows
    deck_height: float
    deck_z: float  # rear window's lower edge on the middle plane
    tail_height: float  # upper edge of the rear face
    roof_front_z: float
    roof_rear_z: float
    roof_fall: float
    roof_half_width: float
    screen_bow: float  # distance of the windscreen's corners behind its middle
    nose_bow: float
    nose_lean: float  # bonnet's edge behind the bumper
    nose_corner: float  # inset of the front corner
    tail_corner: float
    tail_lean: float
    shoulder: float  # inset of the side at the belt line
    rocker: float  # inset of the side at its lower edge
    flare: float  # of the wheel arches
    arch_gap: float  # between tyre and arch
    crease: float  # depth below the belt line of the line along the flanks
    crease_step: float  # inset of the flank above it
    two_door: bool
    rim_radius: float
    tyre_width: float

    @property
    def half_width(self) -> float:
        """Half of the width, metres."""
        return 0.5 * self.outer.width

    @property
    def age(self) -> float:
        """Age of the design: 0 is about 1990, 1 is today."""
        return self.outer.age

    @property
    def rear_pillar(self) -> tuple[float, float]:
        """Length of the rear pillar along the car at its lower and upper end, metres."""
        return _STYLES[self.style].pillar

    @property
    def bumper_height(self) -> float:
        """Height of the foremost line of the front above the ground, metres."""
        return 0.30 + 0.32 * self.bonnet_height

    @property
    def notchback(self) -> bool:
        """Whether a boot lid lies behind the rear window."""
        return _STYLES[self.style].boot[0] > 0.1


def draw_shape(style: str, rng: np.random.Generator) -> CarShape:
    """A car of this style."""
    row = _STYLES[style]
    n, u = rng.normal, rng.uniform
    outer = draw_dimensions("car", style, rng)
    age, newer = outer.age, outer.age - 0.5
    length, height = outer.length, outer.height
    cowl = height * (row.cowl + 0.015 * newer + n(0.0, 0.010))
    belt = height * (row.belt + 0.030 * newer + n(0.0, 0.012))
    deck = max(height * (row.deck + 0.030 * newer + n(0.0, 0.010)), belt + 0.03)
    bonnet = height * (row.bonnet + 0.035 * newer + n(0.0, 0.012))
    cowl_z = outer.front_axle - row.cab - 0.05 * newer - n(0.0, 0.08)
    boot = u(*row.boot) * (1.1 - 0.25 * age)
    tail_lean = u(0.04, 0.10)
    deck_z = -0.5 * length + tail_lean + 0.05 + boot
    fall = u(*row.roof_fall)
    front_run = (height - 0.055 - cowl) / np.tan(np.deg2rad(row.rake_front - 5.0 * newer + n(0.0, 1.2)))
    roof_front_z = cowl_z - float(front_run)
    rear_run = (height - fall - deck) / np.tan(np.deg2rad(u(*row.rake_rear)))
    two_door = bool(u() < row.two_door)
    roof_rear_z = min(deck_z + float(rear_run), roof_front_z - _SHORTEST_ROOF[not two_door])
    return CarShape(
        style=style,
        outer=outer,
        bonnet_height=bonnet,
        cowl_height=cowl,
        cowl_z=cowl_z,
        belt_height=min(belt, cowl - 0.005),
        belt_rise=min(u(0.01, 0.05) + 0.05 * age * u(), deck - belt),
        deck_height=deck,
        deck_z=max(min(deck_z, roof_rear_z - 0.35), 0.22 - 0.5 * length) if boot > 0.1 else deck_z,
        tail_height=deck - (u(0.0, 0.06) if boot > 0.1 else 0.0),
        roof_front_z=roof_front_z,
        roof_rear_z=roof_rear_z,
        roof_fall=fall,
        roof_half_width=0.5 * outer.width * (row.roof - 0.035 * newer + n(0.0, 0.010)),
        screen_bow=u(0.14, 0.24),
        nose_bow=u(0.03, 0.07) + 0.06 * age * u(),
        nose_lean=u(0.05, 0.11) + 0.06 * age,
        nose_corner=u(0.10, 0.20) + 0.12 * age,
        tail_corner=u(0.06, 0.14) + 0.05 * age,
        tail_lean=tail_lean,
        shoulder=u(0.018, 0.045),
        rocker=u(0.04, 0.08),
        flare=u(0.004, 0.012) + 0.012 * age * u() + (0.008 if style == "suv" else 0.0),
        arch_gap=u(0.035, 0.060) + (0.015 if style == "suv" else 0.0),
        crease=u(0.10, 0.20),
        crease_step=(0.004 + 0.012 * age) * u(0.2, 1.0),
        two_door=two_door,
        rim_radius=outer.wheel_radius * (0.60 + 0.12 * age + n(0.0, 0.015)),
        tyre_width=float(np.clip(0.175 + 0.055 * age + n(0.0, 0.008), 0.155, 0.265)),
    )
