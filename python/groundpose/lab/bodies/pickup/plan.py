"""Layout of a pickup, drawn once per body and read by shells, paint, keypoints and fittings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.dimensions import Dimensions, draw_dimensions
from groundpose.lab.bodies.outlines import Level
from groundpose.lab.bodies.parts.wheels import CAR_RIMS, STEEL_RIMS, Rim

CLASS = "pickup"


@dataclass(frozen=True)
class Plan:
    """Lengths in metres, heights above the ground."""

    style: str
    dimensions: Dimensions
    cowl: float  # z of the foot of the windscreen
    roof_front: float  # z of its upper edge
    cab_rear: float  # z of the cab's rear wall
    roof_back: float  # forward offset of the top of the cab's rear wall
    lamp: tuple[float, float]
    bonnet: float
    belt: float
    top: float
    top_fraction: float
    corner: tuple[float, float]
    bow: float
    bumper_rear: float  # depth of the step bumper
    bed_floor: float
    rail: float  # height of the bed's side wall
    arch: float
    tail: tuple[float, float]
    plastic: bool
    chrome: bool
    rack: bool
    cover: bool
    flares: bool
    lamp_foot: str  # level
    tyre_width: float
    rim: Rim

    @property
    def nose(self) -> float:
        """z of the front end."""
        return 0.5 * self.dimensions.length

    @property
    def well(self) -> float:
        """Half width between the inner walls of the wheel wells."""
        return 0.5 * self.dimensions.width - 1.3 * self.tyre_width

    @property
    def bed(self) -> tuple[float, float]:
        """z of the front and rear end of the cargo bed."""
        return self.cab_rear - 0.025, -self.nose + self.bumper_rear

    @property
    def pillar(self) -> float:
        """z of the B pillar."""
        return self.cab_rear + (0.16 if self.style == "single_cab" else 1.0)

    @property
    def door(self) -> float:
        """z of the front edge of the front door."""
        return self.dimensions.front_axle - self.arch - 0.07


def plan(style: str, rng: np.random.Generator) -> Plan:
    """All choices of one body."""
    d, u = draw_dimensions(CLASS, style, rng), rng.uniform
    nose, double = 0.5 * d.length, style == "double_cab"
    cowl = nose - u(1.08, 1.28)
    belt, top = 0.62 * d.height + u(-0.02, 0.03), d.height - u(0.13, 0.17)
    lamp, size = u(0.76, 0.84) * belt - 0.06, u(0.15, 0.22)
    bed = (u(0.275, 0.31) if double else u(0.405, 0.45)) * d.length
    rims = CAR_RIMS if rng.random() < 0.6 else STEEL_RIMS
    return Plan(
        style,
        d,
        cowl=cowl,
        roof_front=cowl - u(1.0, 1.25) * (top - belt),
        cab_rear=-nose + bed,
        roof_back=u(0.04, 0.14),
        lamp=(lamp, lamp + size),
        bonnet=belt - u(0.03, 0.08),
        belt=belt,
        top=top,
        top_fraction=u(0.80, 0.88),
        corner=(u(0.2, 0.28), u(0.18, 0.26)),
        bow=u(0.07, 0.12),
        bumper_rear=u(0.06, 0.14),
        bed_floor=u(0.68, 0.78) + d.clearance - 0.25,
        rail=max(belt + u(-0.03, 0.06), 2 * d.wheel_radius + 0.14),
        arch=d.wheel_radius + u(0.06, 0.09),
        tail=(belt - u(0.34, 0.42), belt - u(0.03, 0.1)),
        plastic=bool(rng.random() < 0.4),
        chrome=bool(rng.random() < 0.4),
        rack=bool(rng.random() < 0.3),
        cover=bool(rng.random() < 0.15),
        flares=bool(rng.random() < 0.35),
        lamp_foot="lamp_low" if rng.random() < 0.7 else "lamp_mid",
        tyre_width=float(u(0.225, 0.265)),
        rim=rims[int(rng.integers(len(rims)))],
    )


def wheel_centres(p: Plan) -> FloatArray:
    """(4, 4) centre and radius: front right, front left, rear right, rear left."""
    d = p.dimensions
    x = 0.5 * d.width - 0.5 * p.tyre_width - 0.02
    return np.array(
        [[s * x, -d.wheel_radius, z, d.wheel_radius] for z in (d.front_axle, d.rear_axle) for s in (1, -1)]
    )


def cab_levels(p: Plan) -> list[Level]:
    """Outlines of the cab with bonnet, from the bottom up."""
    d, nose, half = p.dimensions, p.nose, 0.5 * p.dimensions.width
    low, high = p.lamp
    rise, run = p.bonnet - high, nose - 0.1 - p.cowl
    middle = 0.5 * (d.clearance + 0.15 + low - 0.05)
    rows: list[tuple[str, float, float, float]] = [
        # name, height, fraction of the half width, front
        ("skirt", d.clearance + 0.06, 0.95, nose - 0.10),
        ("sill", d.clearance + 0.15, 0.985, nose - 0.03),
        ("fog", middle - 0.03, 0.99, nose - 0.014),
        ("plate", middle, 0.99, nose - 0.012),
        ("bumper", low - 0.05, 0.99, nose),
        ("bumper_gap", low - 0.042, 0.99, nose - 0.005),
        ("lamp_low", low, 0.985, nose - 0.03),
        ("lamp_mid", 0.5 * (low + high), 0.985, nose - 0.04),
        ("lamp_high", high, 0.985, nose - 0.06),
        ("lid", high + 0.008, 0.985, nose - 0.066),
        ("bonnet_1", high + 0.45 * rise, 0.98, nose - 0.10 - 0.10 * run),
        ("bonnet_2", high + 0.75 * rise, 0.975, nose - 0.10 - 0.5 * run),
        ("screen", p.bonnet, 0.97, p.cowl),
    ]
    slope = (p.cowl - p.roof_front) / (p.top - p.bonnet)
    eave = d.height - 0.03 - p.top
    for name, h in (("belt", p.belt), ("belt_cut", p.belt + 0.05), ("top_cut", p.top - 0.05), ("top", p.top)):
        fraction = (h - p.belt) / (p.top - p.belt)
        rows.append(
            (name, h, 0.96 - (0.96 - p.top_fraction) * fraction**1.15, p.cowl - slope * (h - p.bonnet))
        )
    rows += [
        ("eave", p.top + 0.62 * eave, p.top_fraction - 0.045, p.roof_front - 0.14),
        ("roof", p.top + eave, p.top_fraction - 0.17, p.roof_front - 0.34),
    ]
    rear = np.interp([r[1] for r in rows], [p.belt, p.top, d.height], [0.0, p.roof_back, p.roof_back + 0.12])
    return [
        Level(
            name,
            h,
            half * fraction,
            front,
            p.cab_rear + float(back),
            p.corner,
            (0.09, 0.09),
            p.bow,
            0.015,
            nose=0.96,
        )
        for (name, h, fraction, front), back in zip(rows, rear, strict=True)
    ]


def bed_levels(p: Plan) -> list[Level]:
    """Outlines of the cargo bed: up the outside, over the rail, down the inside."""
    d, half = p.dimensions, 0.495 * p.dimensions.width
    front, rear = p.bed
    low, high = p.tail
    rows = (
        ("skirt", d.clearance + 0.18, -0.03),
        ("sill", d.clearance + 0.26, -0.005),
        ("tail_low", low, 0.0),
        ("tail_mid", 0.5 * (low + high), 0.0),
        ("tail_high", high, -0.002),
        ("rail", p.rail, -0.015),
        ("rail_in", p.rail, -0.075),
        ("floor", p.bed_floor, -0.085),
    )
    walls = {"rail_in": 0.055, "floor": 0.06}
    return [
        Level(
            name,
            h,
            half + out,
            front - walls.get(name, 0.0),
            rear + walls.get(name, 0.0),
            (0.03, 0.03),
            (0.06, 0.05),
            0.004,
            0.004,
        )
        for name, h, out in rows
    ]
