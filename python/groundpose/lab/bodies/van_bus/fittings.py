"""Fittings and interior of a van or bus: wheels, mirrors, plates, wipers, seats, roof units."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies import common
from groundpose.lab.bodies.common import bar, block, moved, padded
from groundpose.lab.bodies.geometry.mesh import Component, both_sides
from groundpose.lab.bodies.parts import cabin
from groundpose.lab.bodies.shell import Shell
from groundpose.lab.bodies.van_bus.plan import Plan, wheel_centres

# Radius of the edges of rub strips, metres.
_STRIP_EDGE = 0.015
# How far the mirrors of a bus may stand before its front, metres.
_MIRROR_BEYOND = 0.029


def fittings(p: Plan, hull: Shell, rng: np.random.Generator) -> list[Component]:
    """All components except the shell."""
    centres = wheel_centres(p)
    last = hull.columns.count - 1
    parts = [
        *common.wheel_set(centres, p.tyre_width, (p.front_rim, p.rear_rim), 0.62, "rim", p.twin),
        *common.axles(centres, 0.09),
        *both_sides(mirror(p, hull)),
        common.number_plate(hull.point(0, "plate")),
        common.number_plate(hull.point(last, p.rear_plate)),
        common.badge(hull.point(0, "lamp_mid"), 1.0),
        block(0.4, 0.03, 0.03, "taillamp", hull.point(last, "top" if p.split_rear or p.bus else "eave_low")),
        *_wipers(p, hull),
        *_cabin(p, hull, rng),
        *both_sides(_side(p, hull)),
    ]
    if p.hull_height < p.dimensions.height:
        parts += _roof_units(p, rng)
    if p.split_rear:  # the gap between the rear doors
        names = ("bumper_gap", "lamp_high", "belt", "top", "eave_low")
        parts.append(bar([moved(hull.point(last, name), z=0.003) for name in names], 0.007, "seam", 4))
    if not p.bus and rng.random() < 0.3:
        parts += _roof_rack(p)
    return parts


def mirror_box(p: Plan, hull: Shell) -> tuple[FloatArray, FloatArray]:
    """Centre and size of the right mirror's housing."""
    if not p.bus:
        base = hull.point(hull.columns.at_side(p.windows[0].front), "belt_cut")
        size = np.array([0.2, 0.3 if p.dimensions.height > 2.2 else 0.22, 0.11])
        return moved(base, 0.5 * size[0] + 0.03, -0.06, -0.03), size
    corner = hull.point(hull.columns.at_front_corner(2), "top")
    size = np.array([0.22, 0.46, 0.14])
    centre = moved(corner, 0.3, 0.35, 0.12)
    centre[2] = min(centre[2], 0.5 * (p.dimensions.length - size[2]) + _MIRROR_BEYOND)
    return centre, size


def mirror(p: Plan, hull: Shell) -> list[Component]:
    """The right mirror with its arm and glass."""
    centre, size = mirror_box(p, hull)
    if not p.bus:
        root = moved(hull.point(hull.columns.at_side(p.windows[0].front), "belt"), -0.04)
        return common.side_mirror(centre, size, [[root, centre]])
    root = moved(hull.point(hull.columns.at_front_corner(2), "eave_low"), -0.05, 0.0, -0.02)
    elbow = np.array([centre[0], root[1] + 0.05, centre[2] + 0.02])
    return common.side_mirror(
        centre, size, [[root, moved(0.5 * (root + elbow), 0, -0.03, 0.03), elbow, centre]], thick=0.028
    )


def _wipers(p: Plan, hull: Shell) -> list[Component]:
    c, parts = hull.columns, []
    for low, high in ((0.05, 0.55), (-0.6, -0.05)):
        foot = hull.point(c.at_front(abs(low)), "screen", float(np.sign(low)))
        tip = hull.point(c.at_front(abs(high)), "belt" if p.bus else "belt_cut", float(np.sign(high)))
        parts.append(bar([moved(foot, 0, -0.01, 0.015), moved(tip, 0, -0.01, 0.015)], 0.008, "plastic", 4))
    return parts


def _side(p: Plan, hull: Shell) -> list[Component]:
    """Handles, rub strips, side lamps and the rail of the sliding door."""
    d, c = p.dimensions, hull.columns
    front, rear = d.front_axle - p.arch - 0.08, d.rear_axle + p.arch + 0.08
    x = float(hull.point(c.at_side(0.5 * (front + rear)), "lamp_mid")[0])
    if p.bus:
        places = np.linspace(d.front_axle + p.arch + 0.25, -0.5 * d.length + 0.4, 7)
        lamps = [z for z in places if min(abs(z - d.front_axle), abs(z - d.rear_axle)) > p.arch + 0.1]
        return [block(0.03, 0.05, 0.11, "indicator", (x, -p.heights["bumper"], float(z))) for z in lamps]
    parts = [
        block(0.05, 0.04, 0.17, "plastic", (x + 0.005, -p.heights["belt"] + 0.14, seam + 0.14))
        for seam in p.seams[1:]
    ]
    low, high = p.heights["plate"], p.heights["lamp_mid"]
    behind_wheel = rear - 2 * p.arch - 0.16 + 0.5 * d.length - 0.12
    if p.strip:
        parts.append(
            padded(
                (0.04, 0.10, front - rear),
                _STRIP_EDGE,
                "plastic",
                (x, -0.5 * (low + high), 0.5 * (front + rear)),
            )
        )
    if p.strip and behind_wheel > 2 * _STRIP_EDGE:
        parts.append(
            padded(
                (0.04, 0.10, behind_wheel),
                _STRIP_EDGE,
                "plastic",
                (x - 0.003, -0.5 * (low + high), 0.5 * (rear - 2 * p.arch - 0.16 - 0.5 * d.length + 0.12)),
            )
        )
    rail = (p.seams[2] - 0.03, -0.5 * d.length + 0.25)
    parts.append(
        block(0.02, 0.03, rail[0] - rail[1], "seam", (x - 0.006, -p.heights["belt"] + 0.07, 0.5 * sum(rail)))
    )
    return parts


def _roof_units(p: Plan, rng: np.random.Generator) -> list[Component]:
    """Cooling and other roof units of a bus up to the full height."""
    d = p.dimensions
    rise = d.height - p.hull_height + 0.05
    places = rng.uniform([0.05, -0.35], [0.3, -0.15]) * d.length
    parts = []
    for place in places.tolist():
        length = rng.uniform(1.6, 3.0)
        z = max(place, 0.5 * (length - d.length) + 0.05)  # on the roof of a short bus too
        parts.append(padded((0.66 * d.width, rise, length), 0.07, "paint", (0.0, -d.height + 0.5 * rise, z)))
    return parts


def _roof_rack(p: Plan) -> list[Component]:
    """Bars across the roof within the full height of the box."""
    d = p.dimensions
    half = 0.5 * d.width * p.top_fraction - p.eave - 0.03
    edge = -p.hull_height + p.crown
    places = np.linspace(p.front_stretch - 1.0, -0.5 * d.length + 0.5, 3)
    return [
        bar(
            [
                np.array([s * half, edge + (0.02 if abs(s) == 1 else -p.crown + 0.012), z])
                for s in (-1, -0.7, 0.7, 1)
            ],
            0.012,
            "metal",
            4,
        )
        for z in places.tolist()
    ]


def _cabin(p: Plan, hull: Shell, rng: np.random.Generator) -> list[Component]:
    """Floor, dashboard, driver's place and seats."""
    d, h = p.dimensions, p.heights
    floor = {"coach": h["belt"] - 0.65, "city_bus": h["lamp_mid"]}.get(p.style, 0.6)
    inside = 0.5 * d.width * p.top_fraction - 0.1
    parts = [block(2 * inside, 0.04, d.length - 1.6, "interior", (0.0, -floor, -0.35))]
    screen = moved(hull.point(0, "screen"), z=-p.bow - 0.1)
    parts.append(padded((1.8 * inside, 0.3, 0.42), 0.07, "interior", moved(screen, y=0.12, z=-0.2)))
    where = screen[2] - (0.95 if p.bus else 1.15)
    parts += common.driving_place(
        -0.5 * inside, h["screen"] - 0.12 if p.bus else floor + 0.3, where, screen, bool(rng.random() < 0.6)
    )
    places, width = ((-0.56, 0.56), 0.92) if p.bus else ((-0.5, 0.5), 0.9)
    for z in p.seats:
        for place in places:
            x = place * inside
            parts.append(block(width, 0.45, 0.45, "seat", (x, -floor - 0.225, z)))
            parts.append(block(width, 0.66, 0.12, "seat", (x, -floor - 0.76, z - 0.24)))
    sitting = [[place * inside + 0.2, -floor - 0.45, z - 0.2] for z in p.seats for place in places]
    parts += cabin.passengers(np.reshape(sitting, (-1, 3)), 0.85, 0.22, rng)
    if not p.seats:  # a wall behind the seats of a panel van
        parts.append(block(2 * inside, 1.0, 0.03, "interior", (0.0, -floor - 0.5, p.windows[0].rear - 0.05)))
    return parts
