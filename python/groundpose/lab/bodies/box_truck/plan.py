"""Layout of a box truck, drawn once per body and read by shells, paint, keypoints and fittings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.dimensions import Dimensions, draw_dimensions
from groundpose.lab.bodies.outlines import Level
from groundpose.lab.bodies.parts.wheels import Rim

CLASS = "box_truck"


@dataclass(frozen=True)
class Plan:
    """Lengths in metres, heights above the ground."""

    style: str
    dimensions: Dimensions
    bonnet: float  # length of the bonnet; near 0 for a cab over the engine
    cab_rear: float
    cab_half: float  # half width of the cab
    cab_height: float
    screen: float
    top: float
    lean: float  # how far the top of the windscreen lies behind its foot
    corner: tuple[float, float]
    bow: float
    lamp: tuple[float, float]
    arch: float
    box_front: float
    box_low: float
    chassis: float  # height of the upper edge of the rails
    guard: tuple[float, float]  # heights of the rear bar
    deflector: bool
    stripe: tuple[float, float] | None  # heights of an advertisement on the box
    plastic: bool
    roller: bool  # a shutter instead of doors
    cooler: bool  # a cooling unit on the front of the box
    lift: bool  # a tail lift, folded up
    guards: bool
    tank_side: float
    tyre_width: float
    front_rim: Rim
    rear_rim: Rim

    @property
    def nose(self) -> float:
        """z of the front end."""
        return 0.5 * self.dimensions.length

    @property
    def box_rear(self) -> float:
        """z of the doors; hinges and bars stand out to the full length."""
        return -self.nose + 0.035

    @property
    def well(self) -> float:
        """Half width between the inner walls of the wheel wells."""
        return self.cab_half - 1.5 * self.tyre_width

    @property
    def door(self) -> float:
        """z of the front edge of the door."""
        return self.dimensions.front_axle + (self.arch + 0.05 if self.bonnet < 0.3 else -self.arch - 0.05)


def plan(style: str, rng: np.random.Generator) -> Plan:
    """All choices of one body."""
    d, u = draw_dimensions(CLASS, style, rng), rng.uniform
    nose, gap = 0.5 * d.length, style == "cab_gap"
    bonneted = not gap and rng.random() < 0.45
    heavy = min(max((d.length - 5.6) / 5.0, 0.0), 1.0)
    arch = d.wheel_radius + u(0.06, 0.09)
    overhang = nose - d.front_axle
    cab_rear = nose - (overhang + arch + u(1.0, 1.2) if bonneted else overhang + arch + u(0.06, 0.4))
    cab_half = 0.5 * d.width - (u(0.02, 0.14) if gap else u(0.02, 0.1))
    screen = u(1.1, 1.2) if bonneted else 1.22 + 0.36 * heavy + u(-0.06, 0.06)
    cab_height = min(screen + u(1.05, 1.2) + (0.15 * heavy if gap else 0.0), d.height - 0.12)
    lamp = u(0.68, 0.76) if bonneted else d.clearance + u(0.22, 0.34)
    chassis = d.wheel_radius * 2 + u(-0.06, 0.04)
    low = u(0.0, 0.08) + d.clearance
    return Plan(
        style,
        d,
        bonnet=u(0.55, 0.8) if bonneted else u(0.03, 0.08),
        cab_rear=cab_rear,
        cab_half=cab_half,
        cab_height=cab_height,
        screen=screen,
        top=cab_height - u(0.2, 0.26),
        lean=u(0.5, 0.62) if bonneted else u(0.10, 0.26),
        corner=(u(0.18, 0.34), u(0.16, 0.3)),
        bow=u(0.05, 0.12),
        lamp=(lamp, lamp + u(0.16, 0.24)),
        arch=arch,
        box_front=cab_rear - (u(0.12, 0.45) if gap else 0.02),
        box_low=chassis + u(0.04, 0.12),
        chassis=chassis,
        guard=(low, low + u(0.1, 0.16)),
        deflector=bool(gap and d.height > cab_height + 0.35 and rng.random() < 0.4),
        stripe=(float(u(0.25, 0.4)), float(u(0.6, 0.8))) if rng.random() < 0.5 else None,
        plastic=bool(rng.random() < 0.5),
        roller=bool(rng.random() < 0.25),
        cooler=bool(gap and d.height > cab_height + 0.55 and rng.random() < 0.25),
        lift=bool(rng.random() < 0.3),
        guards=bool(rng.random() < 0.75),
        tank_side=1.0 if rng.random() < 0.5 else -1.0,
        tyre_width=0.2 + 0.08 * heavy,
        front_rim=Rim(10, 0.66, 0.6, hole_in=0.62, hole_out=0.78, dish=-0.02),
        rear_rim=Rim(10, 0.62, 0.56, hole_in=0.64, hole_out=0.8, dish=0.11),
    )


def wheel_centres(p: Plan) -> FloatArray:
    """(4, 4) centre and radius of the outer wheels: front right, front left, rear right, rear left."""
    d = p.dimensions
    front, rear = p.cab_half - 0.5 * p.tyre_width - 0.03, 0.5 * d.width - 0.5 * p.tyre_width - 0.05
    return np.array(
        [
            [side * x, -d.wheel_radius, z, d.wheel_radius]
            for x, z in ((front, d.front_axle), (rear, d.rear_axle))
            for side in (1, -1)
        ]
    )


def cab_levels(p: Plan) -> list[Level]:
    """Outlines of the cab from the bottom up."""
    d, nose = p.dimensions, p.nose
    low, high = p.lamp
    foot, rise = nose - 0.02 - p.bonnet, p.screen - high
    rows: list[tuple[str, float, float, float]] = [
        ("skirt", d.clearance, 0.97, nose - 0.04),
        ("plate", 0.5 * (d.clearance + low - 0.04), 0.99, nose - 0.012),
        ("bumper", low - 0.04, 1.0, nose),
        ("bumper_gap", low - 0.032, 1.0, nose - 0.004),
        ("lamp_low", low, 1.0, nose - 0.01),
        ("lamp_mid", 0.5 * (low + high), 1.0, nose - 0.015),
        ("lamp_high", high, 1.0, nose - 0.02),
        ("lid", high + 0.008, 1.0, nose - 0.022),
        ("bonnet_1", high + 0.35 * rise, 1.0, nose - 0.02 - 0.25 * p.bonnet),
        ("bonnet_2", high + 0.7 * rise, 1.0, nose - 0.02 - 0.6 * p.bonnet),
        ("screen", p.screen, 1.0, foot),
    ]
    glass = p.top - p.screen
    for name, h in (
        ("belt", p.screen + 0.05),
        ("belt_cut", p.screen + 0.11),
        ("top_cut", p.top - 0.06),
        ("top", p.top),
    ):
        fraction = (h - p.screen) / glass
        rows.append(
            (name, h, 1.0 - 0.05 * fraction, foot - p.lean * fraction ** (1.0 if p.bonnet > 0.3 else 1.4))
        )
    edge, end = p.cab_height - 0.04 - p.top, foot - p.lean
    rows += [
        ("eave_low", p.top + 0.35 * edge, 0.945, end - 0.05),
        ("eave", p.top + 0.8 * edge, 0.915, end - 0.12),
        ("roof", p.top + edge, 0.84, end - 0.24),
    ]
    return [
        Level(
            name,
            h,
            p.cab_half * fraction,
            front,
            p.cab_rear + _tuck(h, p),
            p.corner,
            (0.06, 0.06),
            p.bow,
            0.01,
        )
        for name, h, fraction, front in rows
    ]


def _tuck(height: float, p: Plan) -> float:
    """The cab's roof is rounded at the rear too."""
    return max(0.0, 0.5 * (height - p.top))


def box_levels(p: Plan) -> list[Level]:
    """Outlines of the box from the bottom up."""
    d = p.dimensions
    low, high = p.box_low, d.height
    heights = [("low", low), ("low_rail", low + 0.09)]
    if p.stripe:
        heights += [
            ("ad_low", low + p.stripe[0] * (high - low)),
            ("ad_high", low + p.stripe[1] * (high - low)),
        ]
    heights += [("high_rail", high - 0.1), ("high", high - 0.02)]
    rows = [(name, h, 0.0) for name, h in heights] + [("roof", high, 0.03)]
    return [
        Level(
            name,
            h,
            0.5 * d.width - inset,
            p.box_front - inset,
            p.box_rear + inset,
            (0.03, 0.03),
            (0.03, 0.03),
            0.004,
            0.004,
        )
        for name, h, inset in rows
    ]
