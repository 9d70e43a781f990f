"""Look of a car: lamps, grille, bumpers and fittings, drawn to suit its style and age."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose.lab.bodies.car.shape import CarShape


@dataclass(frozen=True)
class Face:
    """Choices for the front and rear of one car."""

    lamp_inner: float  # fraction of the half width
    lamp_reach: float  # length of the headlamp along the side, m
    lamp_height: float
    lamp_taper: float  # height of its inner end as a fraction of that of the outer end
    lamp_round: bool
    amber: bool  # separate indicator beside the lens
    grille: int  # row of _GRILLES
    grille_height: float
    chrome: bool
    fog: bool
    bumper_paint: str
    bumper: float  # depth of a separate bumper, m; 0: part of the body
    tail_inner: float
    tail_reach: float
    tail_height: float
    tail_pillars: bool  # tail lamps continue beside the rear window
    tail_pattern: int
    tail_band: str  # material of a strip between the tail lamps, "" for none
    plate_high: bool  # rear plate on the boot or tailgate, not in the bumper
    plate_width: float


def draw_face(shape: CarShape, rng: np.random.Generator) -> Face:
    """Choices that fit the car's age and style."""
    u, new, old = rng.uniform, shape.age > 0.55, shape.age < 0.40
    tall = not shape.notchback
    us_plate = u() < 0.2
    return Face(
        lamp_inner=u(0.50, 0.64),
        lamp_reach=u(0.10, 0.20) + (0.22 * u() if new else 0.0),
        lamp_height=u(0.13, 0.19) - 0.03 * new - 0.03 * (shape.age > 0.75),
        lamp_taper=u(0.45, 0.85) if not old else u(0.85, 1.0),
        lamp_round=bool(u() < (0.12 if not new else 0.05)),
        amber=bool(u() < (0.75 if old else 0.2)),
        grille=int(rng.integers(4)),
        grille_height=u(0.08, 0.14) + 0.14 * shape.age**2 * u(),
        chrome=bool(u() < 0.5),
        fog=bool(u() < 0.55),
        bumper_paint=_bumper_paint(shape, old, u()),
        bumper=u(0.02, 0.045) if old else 0.0,
        tail_inner=u(0.70, 0.80) if tall else u(0.42, 0.68),
        tail_reach=u(0.07, 0.15) + 0.12 * new * u(),
        tail_height=u(0.24, 0.36) if tall else u(0.13, 0.20),
        tail_pillars=bool(tall and u() < 0.15),
        tail_pattern=int(rng.integers(3)),
        tail_band=("", "taillamp", "plastic", "chrome")[int(rng.choice(4, p=(0.62, 0.12, 0.16, 0.10)))],
        plate_high=bool(u() < 0.6),
        plate_width=0.31 if us_plate else 0.52,
    )


def _bumper_paint(shape: CarShape, old: bool, chance: float) -> str:
    """Unpainted bumpers on old cars, black or grey lower edges on some others."""
    black, grey = (0.5, 0.65) if old else (0.35, 0.45) if shape.style == "suv" else (0.06, 0.10)
    return "plastic" if chance < black else "paint_second" if chance < grey else "paint"


@dataclass(frozen=True)
class Fittings:
    """Choices of fittings."""

    mirror: tuple[float, float, float]
    mirror_paint: str
    handle_paint: str
    moulding: str  # material of the strip along the doors, "" for none
    sill: bool  # black sill
    rails: str  # material of roof rails, "" for none
    antenna: str  # "rod", "fin", ""
    exhausts: int
    driver: bool
    right_hand_drive: bool
    headrests: int


def draw_fittings(shape: CarShape, rng: np.random.Generator) -> Fittings:
    """Choices that fit the car's age and style."""
    u, old = rng.uniform, shape.age < 0.4
    long_roof = shape.style in ("estate", "suv", "mpv")
    rails = ("", "chrome", "plastic")[int(rng.choice(3, p=(0.3, 0.4, 0.3)))] if long_roof else ""
    return Fittings(
        mirror=(u(0.17, 0.22), u(0.12, 0.165) + 0.02 * (shape.style == "suv"), u(0.08, 0.13)),
        mirror_paint="plastic" if u() < (0.6 if old else 0.15) else "paint",
        handle_paint=("paint", "plastic", "chrome")[
            int(rng.choice(3, p=(0.3, 0.6, 0.1) if old else (0.75, 0.1, 0.15)))
        ],
        moulding=("", "plastic", "paint")[int(rng.choice(3, p=(0.2, 0.5, 0.3) if old else (0.8, 0.1, 0.1)))],
        sill=bool(u() < (0.7 if shape.style == "suv" else 0.25)),
        rails=rails,
        antenna=("", "rod", "fin")[
            int(rng.choice(3, p=(0.4, 0.5, 0.1) if shape.age < 0.6 else (0.3, 0.2, 0.5)))
        ],
        exhausts=int(rng.choice(3, p=(0.35, 0.5, 0.15))),
        driver=bool(u() < 0.5),
        right_hand_drive=bool(u() < 0.2),
        headrests=int(rng.integers(2, 4)),
    )
