"""Details on a car's surface (handles, mouldings, mirrors, wipers, rails) and the visible interior."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.car.cabin import Cabin, b_pillar_z, last_window_z
from groundpose.lab.bodies.car.look import Fittings
from groundpose.lab.bodies.car.seams import rear_door_z
from groundpose.lab.bodies.car.shape import CarShape
from groundpose.lab.bodies.car.shell import Shell
from groundpose.lab.bodies.car.wall import arch_radius
from groundpose.lab.bodies.geometry.mesh import Component, both_sides
from groundpose.lab.bodies.geometry.slab import ribbon, slab
from groundpose.lab.bodies.parts import cabin as inside
from groundpose.lab.bodies.parts import trim
from groundpose.lab.bodies.parts.materials import MATERIAL


def outside(shape: CarShape, shell: Shell, cabin: Cabin, fittings: Fittings) -> list[Component]:
    """Handles, mouldings, sills, wipers, rails, antenna, exhausts; the mirrors are `mirrors`."""
    wall, d = shell.wall, shape.outer
    parts = []
    doors = [b_pillar_z(shape) + 0.13]
    if not shape.two_door:
        doors.append(rear_door_z(shape) + 0.14)
    for z in doors:
        u, h = wall.u_at_z(z), float(shell.top_at(z)[1]) - 0.13
        parts.append(trim.handle(fittings.handle_paint).moved(*wall.points(u, h).tolist()))
    gap = arch_radius(shape) + 0.05
    along = wall.u_at_z(np.linspace(d.front_axle - gap, d.rear_axle + gap, 8))
    if fittings.moulding:
        parts.append(slab(wall, along, 0.47, 0.53, MATERIAL[fittings.moulding], 0.012, rows=2, bevel=0.01))
    if fittings.sill:
        parts.append(
            slab(wall, along, d.clearance + 0.012, d.clearance + 0.13, MATERIAL["plastic"], 0.006, rows=3)
        )
    if fittings.rails:
        line = 0.5 * (cabin.points[:, cabin.glass_rows[1] + 3] + cabin.points[:, cabin.glass_rows[1] + 4])
        side = (line[:, 2] < shape.roof_front_z - 0.15) & (line[:, 2] > shape.roof_rear_z + 0.12)
        side &= line[:, 0] > 0.8 * line[:, 0].max()
        rail = line[side]
        parts += trim.roof_rail(rail[np.linspace(0, len(rail) - 1, 6).astype(int)], fittings.rails)
    parts = both_sides(parts)
    parts += _wipers(cabin, not shape.notchback)
    if fittings.antenna:
        back = 0.82 if fittings.antenna == "fin" or shape.age > 0.5 else 0.12
        parts.append(trim.antenna(_roof_point(cabin, back), fittings.antenna == "fin"))
    places = ((), (0.55,), (0.55, -0.55))[fittings.exhausts]
    for place in places:
        point = np.array([place * shape.half_width, -d.clearance - 0.05, -0.5 * d.length + 0.07])
        parts.append(trim.exhaust(point))
    lamp = _roof_point(cabin, 0.985)
    if not shape.notchback:  # the third brake lamp, under the roof's rear edge
        bar = np.array([[-0.14, 0.012, -0.03], [0.14, 0.012, -0.03]]) + lamp
        parts.append(ribbon(bar, np.array([[0.0, -0.3, -0.95]] * 2), 0.03, MATERIAL["taillamp"], 0.012))
    return parts


def _roof_point(cabin: Cabin, fraction: float) -> FloatArray:
    """A point on the middle line of the roof, from its front to its rear."""
    line = cabin.points[:, -1]
    at = np.interp(fraction, [0.0, 1.0], [line[0, 2], line[-1, 2]])
    return np.array([0.0, np.interp(-at, -line[:, 2], line[:, 1]), at])


def _wipers(cabin: Cabin, rear: bool) -> list[Component]:
    """Two blades at rest on the windscreen, one on the rear window."""
    pane = cabin.pane("screen")
    low = pane[:, 0] * 0.94 + pane[:, 1] * 0.06
    line = np.concatenate([low[:0:-1] * [-1.0, 1.0, 1.0], low])
    parts = []
    for start, end in ((1, 5), (4, 8)):
        blade = line[start : end + 1] + np.linspace(0.02, 0.09, end - start + 1)[:, None] * np.array(
            [0.0, -0.6, -0.8]
        )
        parts.append(
            ribbon(blade, np.tile([0.0, -0.8, 0.6], (len(blade), 1)), 0.02, MATERIAL["rubber"], 0.015)
        )
    if rear:
        pane = cabin.pane("rear_window")
        blade = (0.86 * pane[:, 0] + 0.14 * pane[:, 1])[1:]
        parts.append(
            ribbon(blade, np.tile([0.0, -0.4, -0.9], (len(blade), 1)), 0.02, MATERIAL["rubber"], 0.02, 0.0)
        )
    return parts


def mirrors(shape: CarShape, cabin: Cabin, fittings: Fittings) -> list[Component]:
    """Both side mirrors; the right housing is the first component."""
    width, height, depth = fittings.mirror
    foot = cabin.corner("front_door", end=False, top=False) + np.array([-0.03, -0.02, -0.10])
    parts = trim.mirror(width, height, depth, fittings.mirror_paint, arm=0.06)
    return both_sides([part.moved(*foot.tolist()) for part in parts])


def interior(shape: CarShape, fittings: Fittings, rng: np.random.Generator) -> list[Component]:
    """Seats, dashboard, steering wheel, driver, passengers."""
    room, belt = shape.half_width - 0.16, shape.belt_height
    cushion = belt - 0.42 if shape.style != "suv" else belt - 0.40
    front_z = b_pillar_z(shape) + (0.02 if not shape.two_door else 0.20)
    rear_z = max(shape.outer.rear_axle + 0.16, last_window_z(shape)[0] - 0.05)
    side = -1.0 if not fittings.right_hand_drive else 1.0
    back = min(0.60, shape.outer.height - cushion - 0.36)
    seat = inside.seat(0.50, back)
    parts = [part.moved(x, -cushion, front_z) for x in (-0.5 * room, 0.5 * room) for part in seat]
    between_wells = 2.0 * (shape.half_width - shape.tyre_width - 0.16)
    bench = inside.seat(min(1.75 * room, between_wells), back - 0.04, fittings.headrests)
    parts += [part.moved(0.0, -cushion, rear_z) for part in bench]
    dash_z = shape.cowl_z - shape.screen_bow - 0.02
    parts.append(inside.dashboard(1.9 * room).moved(0.0, -belt - 0.01, dash_z))
    wheel = np.array([side * 0.5 * room, -belt - 0.02, dash_z - 0.52])
    parts += [part.moved(*wheel.tolist()) for part in inside.steering_wheel()]
    if fittings.driver:
        tall = min(0.88, shape.outer.height - cushion - 0.10)
        front = np.array([[-side * 0.5 * room, -cushion, front_z]])
        behind = np.array([[x, -cushion, rear_z] for x in (-0.5 * room, 0.5 * room)])
        parts += inside.passengers(front, tall, 0.35, rng)
        parts += inside.passengers(behind, tall - 0.06, 0.15, rng)
        parts += [part.moved(side * 0.5 * room, -cushion, front_z + 0.06) for part in inside.driver(tall)]
    return parts
