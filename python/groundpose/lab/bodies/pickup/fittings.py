"""Fittings and interior of a pickup: wheels, bumper, mirrors, plates, seats, rack, cover."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies import common
from groundpose.lab.bodies.common import bar, block, moved, padded
from groundpose.lab.bodies.geometry.mesh import Component, both_sides
from groundpose.lab.bodies.parts import cabin
from groundpose.lab.bodies.pickup.plan import Plan, wheel_centres
from groundpose.lab.bodies.shell import Shell


def fittings(p: Plan, cab: Shell, bed: Shell, rng: np.random.Generator) -> list[Component]:
    """All components except the shells."""
    centres = wheel_centres(p)
    parts = [
        *common.wheel_set(centres, p.tyre_width, (p.rim, p.rim), 0.6, "chrome"),
        *common.axles(centres, 0.06),
        *both_sides([*_mirror(p, cab), *_handles(p), *_wheel_houses(p)]),
        common.number_plate(cab.point(0, "plate")),
        common.badge(cab.point(0, "lamp_mid"), 1.0),
        *_grille_bars(p, cab),
        *_rear_end(p),
        *_cabin(p, cab, rng),
        *_wipers(cab),
    ]
    if p.rack:
        parts.append(_rack(p))
    if p.cover:
        parts.append(_cover(p, bed))
    return parts


def mirror_box(p: Plan, cab: Shell) -> tuple[FloatArray, FloatArray]:
    """Centre and size of the right mirror's housing."""
    c = cab.columns
    base = cab.point(c.at_front_corner(c.corner) + 2, "belt_cut")
    size = np.array([0.22, 0.2, 0.12])
    return moved(base, 0.5 * size[0] + 0.04, -0.04, -0.04), size


def _mirror(p: Plan, cab: Shell) -> list[Component]:
    centre, size = mirror_box(p, cab)
    foot = moved(centre, -0.5 * size[0] - 0.08, 0.06)
    return common.side_mirror(centre, size, [[foot, centre]], "plastic" if p.plastic else "paint")


def _grille_bars(p: Plan, cab: Shell) -> list[Component]:
    """Bars across the grille."""
    c = cab.columns
    right = [cab.point(c.at_front(f), "lamp_mid") for f in (0.0, 0.14, 0.4, 0.6)]
    row = [point * [-1.0, 1.0, 1.0] for point in right[:0:-1]] + right
    height = p.lamp[1] - p.lamp[0]
    material = "chrome" if p.chrome else "paint"
    return [bar([moved(q, y=s * height, z=0.004) for q in row], 0.014, material) for s in (-0.25, 0.2)]


def _wipers(cab: Shell) -> list[Component]:
    c, parts = cab.columns, []
    for low, high in ((0.14, 0.6), (-0.6, -0.14)):
        foot = cab.point(c.at_front(abs(low)), "screen", float(np.sign(low)))
        tip = cab.point(c.at_front(abs(high)), "belt_cut", float(np.sign(high)))
        parts.append(bar([moved(foot, 0, -0.01, 0.01), moved(tip, 0, -0.008, 0.012)], 0.007, "plastic", 4))
    return parts


def _rear_end(p: Plan) -> list[Component]:
    """Step bumper with the plate, the tailgate's handle, the exhaust."""
    d, middle = p.dimensions, -p.dimensions.clearance - 0.2
    depth = p.bumper_rear + 0.1 - common.PLATE_RISE
    rear = -p.nose + common.PLATE_RISE
    tail = [np.array([0.55, middle + 0.1, -p.nose + 0.9]), np.array([0.6, middle + 0.1, -p.nose + 0.12])]
    return [
        padded(
            (0.93 * d.width, 0.17, depth),
            0.035,
            "chrome" if p.chrome else "plastic",
            (0.0, middle, rear + 0.5 * depth),
        ),
        common.number_plate(np.array([0.0, middle, rear])),
        padded((0.24, 0.07, 0.03), 0.01, "plastic", (0.0, -p.rail + 0.12, p.bed[1])),
        bar(tail, 0.03, "metal", 6),
        block(0.3, 0.03, 0.02, "taillamp", (0.0, -p.top - 0.02, p.cab_rear + p.roof_back + 0.02)),
    ]


def _handles(p: Plan) -> list[Component]:
    z = [p.pillar + 0.13] + ([p.cab_rear + 0.3] if p.style == "double_cab" else [])
    x = 0.48 * p.dimensions.width + 0.012
    material = "chrome" if p.chrome else "plastic" if p.plastic else "paint"
    parts = [padded((0.05, 0.035, 0.17), 0.012, material, (x, -p.belt + 0.13, at)) for at in z]
    if p.flares:  # a step below the doors
        front, rear = p.door - 0.05, p.dimensions.rear_axle + p.arch + 0.1
        at = (0.47 * p.dimensions.width, -p.dimensions.clearance - 0.05, 0.5 * (front + rear))
        parts.append(padded((0.16, 0.05, front - rear), 0.02, "plastic", at))
    return parts


def _wheel_houses(p: Plan) -> list[Component]:
    """The part of the right wheel well that reaches above the bed's floor, if any."""
    d, top = p.dimensions, p.dimensions.wheel_radius + p.arch + 0.015
    if top < p.bed_floor:
        return []
    wide = 0.5 * d.width - 0.06 - p.well + 0.02
    at = (p.well - 0.02 + 0.5 * wide, -0.5 * (top + p.bed_floor - 0.1), d.rear_axle)
    return [padded((wide, top - p.bed_floor + 0.1, 2 * p.arch), 0.05, "plastic", at)]


def _rack(p: Plan) -> Component:
    """A roll bar behind the cab."""
    x, z = 0.5 * p.dimensions.width - 0.16, p.bed[0] - 0.16
    high = -p.dimensions.height + 0.08
    path = np.array([[x, -p.rail + 0.02, z - 0.12], [x - 0.08, high + 0.06, z], [x - 0.16, high, z]])
    return bar(
        np.concatenate([path, path[::-1] * [-1.0, 1.0, 1.0]]), 0.035, "chrome" if p.chrome else "plastic", 8
    )


def _cover(p: Plan, bed: Shell) -> Component:
    """A flat cover over the bed, inside its rails."""
    front, rear = p.bed
    size = (p.dimensions.width - 0.14, 0.05, front - rear - 0.12)
    return padded(size, 0.02, "plastic", (0.0, -p.rail + 0.005, 0.5 * (front + rear)))


def _cabin(p: Plan, cab: Shell, rng: np.random.Generator) -> list[Component]:
    """Dashboard, driver's place and seats."""
    inside, cushion = 0.5 * p.dimensions.width * p.top_fraction, p.belt - 0.42
    screen = moved(cab.point(0, "screen"), z=-p.bow - 0.06)
    parts = [padded((1.8 * inside, 0.25, 0.42), 0.07, "interior", moved(screen, y=0.1, z=-0.2))]
    z = p.pillar + 0.14
    parts += common.driving_place(-0.5 * inside, cushion, z, screen, bool(rng.random() < 0.6))
    parts += [part.moved(0.5 * inside, -cushion, z) for part in cabin.seat(0.5, 0.6)]
    places = [[0.5 * inside, -cushion, z]]
    if p.style == "double_cab":
        rear = p.cab_rear + 0.28
        parts += [part.moved(0.0, -cushion, rear) for part in cabin.seat(1.7 * inside, 0.56, 3)]
        places += [[x * inside, -cushion, rear] for x in (-0.5, 0.5)]
    parts += cabin.passengers(np.array(places), min(0.88, p.top - cushion - 0.05), 0.2, rng)
    return parts
