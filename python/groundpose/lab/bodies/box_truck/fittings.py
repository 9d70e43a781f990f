"""Fittings of a box truck: chassis, wheels, tank, guards, lamps, locking bars, mirrors, seats."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies import common
from groundpose.lab.bodies.box_truck.plan import Plan, wheel_centres
from groundpose.lab.bodies.common import bar, block, moved, padded
from groundpose.lab.bodies.geometry.mesh import Component, both_sides
from groundpose.lab.bodies.geometry.primitives import rounded_box
from groundpose.lab.bodies.outlines import Columns, Level
from groundpose.lab.bodies.parts import cabin
from groundpose.lab.bodies.parts.materials import MATERIAL
from groundpose.lab.bodies.shell import Shell, shell


def fittings(p: Plan, cab: Shell, rng: np.random.Generator) -> list[Component]:
    """All components except the shells of cab and box."""
    centres = wheel_centres(p)
    parts = [
        *common.wheel_set(centres, p.tyre_width, (p.front_rim, p.rear_rim), 0.6, "rim", twin=True),
        *common.axles(centres, 0.1),
        *_chassis(p),
        *_tank(p),
        *_rear_end(p),
        *both_sides([*_mirror(p, cab), *_wheel_guards(p), *_side_guards(p), *_doors(p, cab)]),
        *_cabin(p, cab, rng),
        *_wipers(cab),
        common.number_plate(cab.point(0, "plate")),
        common.badge(cab.point(0, "lamp_mid" if p.bonnet > 0.3 else "bonnet_1"), 1.0),
    ]
    if p.deflector:
        parts.append(_deflector(p))
    if p.cooler and not p.deflector:
        parts.append(_cooler(p))
    return parts


def mirror_box(p: Plan, cab: Shell) -> tuple[FloatArray, FloatArray]:
    """Centre and size of the right mirror's housing."""
    corner = cab.point(cab.columns.at_front_corner(3), "top_cut")
    size = np.array([0.22, 0.42, 0.12])
    reach = max(0.2, 0.5 * p.dimensions.width - corner[0] + 0.12)
    return moved(corner, reach, 0.3, 0.05), size


def tail_lamp(p: Plan) -> tuple[FloatArray, FloatArray]:
    """Centre and size of the right tail lamp."""
    size = np.array([0.36, 0.13, 0.06])
    middle = p.guard[1] + 0.09
    return np.array([0.5 * p.dimensions.width - 0.1 - 0.5 * size[0], -middle, -p.nose + 0.05]), size


def rear_plate(p: Plan) -> FloatArray:
    """Middle of the rear bar's face, where the rear plate is fixed."""
    return np.array([0.0, -0.5 * sum(p.guard), -p.nose + 0.02])


def _mirror(p: Plan, cab: Shell) -> list[Component]:
    centre, size = mirror_box(p, cab)
    corner = cab.columns.at_front_corner(3)
    roots = [moved(cab.point(corner, name), -0.04) for name in ("top", "belt_cut")]
    tips = [moved(centre, y=s * 0.5 * size[1]) for s in (-0.9, 0.9)]
    return common.side_mirror(centre, size, [list(arm) for arm in zip(roots, tips, strict=True)], thick=0.02)


def _wipers(cab: Shell) -> list[Component]:
    c, parts = cab.columns, []
    for low, high in ((0.2, 0.72), (-0.72, -0.2)):
        foot = cab.point(c.at_front(abs(low)), "screen", float(np.sign(low)))
        tip = cab.point(c.at_front(abs(high)), "belt_cut", float(np.sign(high)))
        parts.append(bar([moved(foot, 0, -0.01, 0.012), moved(tip, 0, -0.01, 0.012)], 0.009, "plastic", 4))
    return parts


def _doors(p: Plan, cab: Shell) -> list[Component]:
    """Handle and steps of the right door."""
    x, d = p.cab_half, p.dimensions
    parts = [padded((0.05, 0.05, 0.18), 0.012, "plastic", (x + 0.005, -p.screen + 0.12, p.cab_rear + 0.36))]
    if p.bonnet < 0.3:
        where = (x - 0.03, -d.clearance - 0.05, d.front_axle + p.arch + 0.14)
        parts.append(block(0.1, 0.06, 0.22, "plastic", where))
    return parts


def _chassis(p: Plan) -> list[Component]:
    """Rails, cross members under the box, engine."""
    d, tail = p.dimensions, -p.nose + 0.12
    front, sub = p.cab_rear + 0.5, p.box_low - p.chassis
    parts = both_sides(
        [block(0.08, 0.24, front - tail, "metal", (0.42, 0.12 - p.chassis, 0.5 * (front + tail)))]
    )
    for z in np.arange(p.box_rear + 0.25, p.box_front - 0.1, 0.8).tolist():
        parts.append(block(d.width - 0.12, sub, 0.08, "metal", (0.0, -p.chassis - 0.5 * sub, z)))
    middle = -0.5 * (p.chassis + d.clearance)
    return [*parts, block(1.0, p.chassis - d.clearance, 1.2, "underbody", (0.0, middle, d.front_axle))]


def _tank(p: Plan) -> list[Component]:
    """Tank on one side, battery case on the other."""
    side, behind, middle = 0.5 * p.dimensions.width - 0.42, p.cab_rear - 0.25, -p.chassis + 0.32
    tank = rounded_box(0.55, 0.48, 0.9, 0.12, MATERIAL["metal"], 3)
    return [
        tank.moved(p.tank_side * side, middle, behind - 0.45),
        padded((0.5, 0.4, 0.6), 0.03, "plastic", (-p.tank_side * side, middle, behind - 0.3)),
    ]


def _wheel_guards(p: Plan) -> list[Component]:
    """Mud flap and mudguard of the right rear wheels."""
    d, radius = p.dimensions, p.dimensions.wheel_radius
    x = float(wheel_centres(p)[2, 0]) - 0.5 * p.tyre_width
    flap = block(2.1 * p.tyre_width, 0.55, 0.015, "rubber", (x, -0.55, d.rear_axle - radius - 0.14))
    if p.box_low < 2 * radius + 0.09:
        return [flap]
    return [
        flap,
        block(2.2 * p.tyre_width, 0.02, 2.1 * radius, "plastic", (x, -2 * radius - 0.05, d.rear_axle)),
    ]


def _side_guards(p: Plan) -> list[Component]:
    d = p.dimensions
    front, rear = p.cab_rear - 1.35, d.rear_axle + d.wheel_radius + 0.15
    lamps = np.linspace(p.box_front - 0.3, p.box_rear + 0.6, 4)
    parts = [
        block(0.03, 0.05, 0.11, "indicator", (0.5 * d.width, -p.box_low - 0.045, float(z))) for z in lamps
    ]
    if not p.guards or front - rear < 0.5:
        return parts
    x, middle, length = 0.5 * d.width - 0.07, 0.5 * (front + rear), front - rear
    tall, posts = p.box_low - 0.45, (front - 0.15 * length, rear + 0.15 * length)
    parts += [block(0.03, 0.12, length, "metal", (x, -h, middle)) for h in (0.5, 0.78)]
    return parts + [block(0.05, tall, 0.05, "metal", (x - 0.04, -0.45 - 0.5 * tall, z)) for z in posts]


def _rear_end(p: Plan) -> list[Component]:
    """Bar with plate and lamps; doors with hinges and locking bars, or a shutter; a tail lift."""
    d, (low, high), rear = p.dimensions, p.guard, p.box_rear
    top, bottom = -d.height, -p.box_low
    centre, size = tail_lamp(p)
    drop = p.box_low - low
    right = [
        block(0.08, drop, 0.06, "metal", (0.45, bottom + 0.5 * drop, -p.nose + 0.12)),
        padded(size, 0.015, "taillamp", centre),
        padded((0.07, 0.1, 0.03), 0.01, "reversing_lamp", moved(centre, -0.12, 0.0, -0.02)),
    ]
    parts = [
        block(d.width - 0.12, high - low, 0.1, "metal", (0.0, -0.5 * (low + high), -p.nose + 0.07)),
        common.number_plate(rear_plate(p)),
    ]
    if p.roller:
        rows = np.arange(bottom - 0.3, top + 0.2, -0.22)
        parts += [block(0.94 * d.width, 0.012, 0.012, "seam", (0.0, float(y), rear - 0.002)) for y in rows]
    else:
        posts = [
            [[x, bottom - 0.03, rear - 0.02], [x, top + 0.05, rear - 0.02]]
            for x in (0.14 * d.width, 0.32 * d.width)
        ]
        right += [bar(np.array(post), 0.014, "metal") for post in posts]
        parts.append(block(0.016, bottom - top - 0.2, 0.01, "seam", (0.0, 0.5 * (bottom + top), rear)))
        heights = bottom + np.array([0.12, 0.37, 0.63, 0.88]) * (top - bottom)
        right += [
            block(0.12, 0.05, 0.03, "metal", (0.5 * d.width - 0.09, float(y), rear - 0.005)) for y in heights
        ]
    if p.lift:
        parts.append(
            block(
                0.97 * d.width,
                0.42 * (bottom - top),
                0.03,
                "metal",
                (0.0, bottom - 0.17 * (bottom - top), rear - 0.017),
            )
        )
    return parts + both_sides(right)


def _cooler(p: Plan) -> Component:
    """A cooling unit on the front of the box, above the cab."""
    d = p.dimensions
    low, high = p.cab_height + 0.08, d.height - 0.1
    size = (0.75 * d.width, min(high - low, 0.75), 0.42)
    return padded(size, 0.06, "paint_second", (0.0, -high + 0.5 * size[1], p.box_front + 0.19))


def _deflector(p: Plan) -> Component:
    """The fairing between the cab's roof and the box's upper edge."""
    d, low = p.dimensions, p.cab_height - 0.06
    high, rear = d.height - 0.06, p.cab_rear + 0.06
    front = p.nose - p.bonnet - p.lean - 0.55
    rows = []
    for fraction in (0.0, 0.35, 0.7, 0.92, 1.0):
        z = front + (rear + 0.3 - front) * fraction**1.4
        half = p.cab_half * (0.86 - 0.06 * fraction)
        rows.append(
            Level(
                f"{fraction}", low + fraction * (high - low), half, z, rear, (0.25, 0.2), (0.03, 0.03), 0.06
            )
        )
    side = np.linspace(front - 0.26, rear + 0.03, 4)
    columns = Columns(np.array([0.0, 0.5, 1.0]), side, np.array([0.0, 1.0]), float(side[0]), float(side[-1]))
    fairing = shell(rows, columns, crown=0.02)
    return fairing.component()


def _cabin(p: Plan, cab: Shell, rng: np.random.Generator) -> list[Component]:
    """Dashboard, driver's place and a second seat."""
    cushion, x = p.screen - 0.3, 0.52 * p.cab_half
    screen = moved(cab.point(0, "screen"), z=-p.bow - 0.06)
    z = max(float(screen[2]) - 1.0, p.cab_rear + 0.28)
    return [
        padded((1.75 * p.cab_half, 0.3, 0.38), 0.07, "interior", moved(screen, y=0.12, z=-0.18)),
        *common.driving_place(-x, cushion, z, screen, bool(rng.random() < 0.6)),
        *[part.moved(x, -cushion, z) for part in cabin.seat(0.5, 0.6)],
        *cabin.passengers(np.array([[x, -cushion, z]]), 0.88, 0.25, rng),
    ]
