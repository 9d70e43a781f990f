"""Box trucks: a shell for the cab, one for the box, and the chassis with its fittings."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.body import Body
from groundpose.lab.bodies.box_truck.fittings import fittings, mirror_box, rear_plate, tail_lamp
from groundpose.lab.bodies.box_truck.plan import CLASS, Plan, box_levels, cab_levels, plan, wheel_centres
from groundpose.lab.bodies.common import moved, plate_middle
from groundpose.lab.bodies.dimensions import random_stream
from groundpose.lab.bodies.finish import finished, mirrored_keypoints
from groundpose.lab.bodies.outlines import Arch, Columns
from groundpose.lab.bodies.parts.wheels import hub_x
from groundpose.lab.bodies.shell import Shell, ends, shell, side_columns


def build(style: str, seed: int) -> Body:
    """The body of this style and seed."""
    rng = random_stream(CLASS, style, seed)
    p = plan(style, rng)
    cab, box = _cab(p), _box(p)
    parts = [cab.component(), box.component(), *fittings(p, cab, rng)]
    return finished(CLASS, style, seed, parts, *_measures(p, cab, box), wheel_centres(p))


def keypoints(style: str, seed: int) -> tuple[FloatArray, FloatArray]:
    """Keypoints (30, 3) and 3D box (2, 3) of `build(style, seed)`, without its mesh."""
    p = plan(style, random_stream(CLASS, style, seed))
    return _measures(p, _cab(p), _box(p))


def _window(p: Plan) -> tuple[float, float]:
    """z of both ends of the side window."""
    front = ends(cab_levels(p)[0])[0]
    return front - 0.10 * (front - p.door + 0.3), p.cab_rear + 0.3


def _cab(p: Plan) -> Shell:
    d, rows = p.dimensions, cab_levels(p)
    arch = Arch(d.front_axle, p.arch, d.wheel_radius)
    window, seams = _window(p), (p.door, p.cab_rear + 0.2)
    cuts = [window[0] - 0.06, window[1] + 0.06]
    side = side_columns(rows[0], [arch.columns(), [*window, *cuts], *[[s + 0.007, s - 0.007] for s in seams]])
    columns = Columns(
        front=np.array([0.0, 0.2, 0.55, 0.72, 0.86, 1.0]),
        side=side,
        rear=np.array([0.0, 0.5, 1.0]),
        front_stretch=min(p.door, p.nose - 0.7),
        rear_stretch=p.cab_rear + 0.15,
    )
    cab = shell(rows, columns, (arch,), "screen", p.well, 0.04)
    c = cab.columns
    corner = c.at_front_corner
    cab.paint("plastic" if p.plastic else "paint", (0, corner(3)), ("skirt", "bumper"))
    cab.paint("grille", (0, c.at_front(0.55)), ("lamp_low", "bonnet_2" if p.bonnet < 0.3 else "lamp_high"))
    cab.paint("headlamp", (c.at_front(0.72), corner(2)), ("lamp_low", "lamp_high"), "r")
    cab.paint("indicator", (corner(1), corner(2)), ("lamp_mid", "lamp_high"))
    if p.bonnet < 0.3:  # a dark panel below the screen
        cab.paint("plastic", (0, corner(2)), ("bonnet_2", "screen"))
    cab.paint("seam", (0, corner(3)), ("bumper", "bumper_gap"))
    cab.paint("seam", (0, corner(2)), ("lamp_high", "lid"))
    cab.paint("glass", (0, corner(2)), ("screen", "top"))
    cab.paint("glass", (c.at_side(window[0]), c.at_side(window[1])), ("belt", "top"), "rRF")
    for seam in seams:
        column = c.at_side(seam + 0.007)
        cab.paint("seam", (column, column + 1), ("plate", "belt"))
    return cab


def _box(p: Plan) -> Shell:
    rows = box_levels(p)
    front, rear = ends(rows[0])
    margin = 0.12 * (front - rear)
    side = side_columns(rows[0], [np.linspace(front, rear, 5), [front - margin, rear + margin]])
    columns = Columns(
        front=np.array([0.0, 1.0]),
        side=side,
        rear=np.array([0.0, 0.95, 0.96, 1.0]),
        front_stretch=front,
        rear_stretch=rear,
        corner=2,
    )
    box = shell(rows, columns, crown=0.0, crease_deg=30.0)
    c = box.columns
    whole = (0, c.count - 1)
    box.paint("paint_second", whole, ("low", "roof"))
    box.paint("paint_second", whole, (box.level("roof"), box.points.shape[1] - 1))
    if p.stripe:
        box.paint("paint", (c.at_side(front - margin), c.at_side(rear + margin)), ("ad_low", "ad_high"))
    box.paint("metal", whole, ("low", "low_rail"))
    box.paint("metal", whole, ("high_rail", "high"))
    box.paint("metal", (c.at_front_corner(0), c.at_front_corner(2)), ("low", "high"))
    box.paint("metal", (c.at_rear_corner(2), c.at_rear_corner(0)), ("low", "high"))
    box.paint("seam", (c.at_rear(0.96), c.at_rear(0.95)), ("low_rail", "high_rail"))
    return box


def _measures(p: Plan, cab: Shell, box: Shell) -> tuple[FloatArray, FloatArray]:
    """Keypoints and 3D box."""
    c, b, d = cab.columns, box.columns, p.dimensions
    corner = c.at_front_corner
    mirror, size = mirror_box(p, cab)
    lamp, lamp_size = tail_lamp(p)
    right = {
        "headlamp": cab.point(corner(2), "lamp_mid"),
        "taillamp": moved(lamp, 0.5 * lamp_size[0]),
        "mirror": moved(mirror, 0.5 * size[0]),
        "windscreen_top": cab.point(corner(2), "top"),
        "windscreen_bottom": cab.point(corner(2), "screen"),
        "front_bumper": cab.point(corner(2), "skirt"),
        "cab_window": cab.point(c.at_side(_window(p)[1]), "belt"),
        "guard_rear": np.array([0.5 * d.width - 0.06, -p.guard[0], -p.nose + 0.02]),
    }
    for name, level in (("top", "high"), ("bottom", "low")):
        right[f"box_front_{name}"] = box.point(b.at_front_corner(1), level)
        right[f"box_rear_{name}"] = box.point(b.at_rear_corner(1), level)
    for name, row, rim in (("front_wheel", 0, p.front_rim), ("rear_wheel", 2, p.rear_rim)):
        right[name] = moved(wheel_centres(p)[row, :3], hub_x(p.tyre_width, rim))
    middle = {
        "front_plate": plate_middle(cab.point(0, "plate"), 1.0),
        "rear_plate": plate_middle(rear_plate(p), -1.0),
    }
    bounds = np.array([[-d.width, -2 * d.height, -d.length], [d.width, 0.0, d.length]]) * 0.5
    return mirrored_keypoints(CLASS, right, middle), bounds
