"""Pickups: a shell for bonnet and cab, one for the open cargo bed, and their fittings."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.body import Body
from groundpose.lab.bodies.common import moved, plate_middle
from groundpose.lab.bodies.dimensions import random_stream
from groundpose.lab.bodies.finish import finished, mirrored_keypoints
from groundpose.lab.bodies.outlines import Arch, Columns
from groundpose.lab.bodies.parts.wheels import hub_x
from groundpose.lab.bodies.pickup.fittings import fittings, mirror_box
from groundpose.lab.bodies.pickup.plan import CLASS, Plan, bed_levels, cab_levels, plan, wheel_centres
from groundpose.lab.bodies.shell import Shell, ends, shell, side_columns


def build(style: str, seed: int) -> Body:
    """The body of this style and seed."""
    rng = random_stream(CLASS, style, seed)
    p = plan(style, rng)
    cab, bed = _cab(p), _bed(p)
    parts = [cab.component(), bed.component(), *fittings(p, cab, bed, rng)]
    return finished(CLASS, style, seed, parts, *_measures(p, cab, bed), wheel_centres(p))


def keypoints(style: str, seed: int) -> tuple[FloatArray, FloatArray]:
    """Keypoints (26, 3) and 3D box (2, 3) of `build(style, seed)`, without its mesh."""
    p = plan(style, random_stream(CLASS, style, seed))
    return _measures(p, _cab(p), _bed(p))


def _cab(p: Plan) -> Shell:
    d, rows = p.dimensions, cab_levels(p)
    arch = Arch(d.front_axle, p.arch, d.wheel_radius)
    front, rear = ends(rows[0])
    window = front - 0.12 * (front - p.door)
    edges = [window, p.pillar, p.pillar + 0.05]
    seams = [p.door, p.pillar - 0.035]
    if p.style == "double_cab":
        edges += [p.pillar - 0.07, p.pillar - 0.12, p.cab_rear + 0.2, p.cab_rear + 0.15]
        seams.append(p.cab_rear + 0.11)
    side = side_columns(rows[0], [arch.columns(10), edges, *[[s + 0.006, s - 0.006] for s in seams]])
    columns = Columns(
        front=np.array([0.0, 0.14, 0.4, 0.6, 0.68, 0.85, 1.0]),
        side=side,
        rear=np.array([0.0, 0.5, 0.86, 0.93, 1.0]),
        front_stretch=p.door - 0.02,
        rear_stretch=p.cab_rear + 0.12,
    )
    cab = shell(rows, columns, (arch,), "bonnet_1", p.well, 0.03)
    c = cab.columns
    corner = c.at_front_corner
    if p.plastic:
        cab.paint("plastic", (0, c.at_side(rear)), ("skirt", "sill"))
    cab.paint(
        "chrome" if p.chrome else "plastic" if p.plastic else "paint", (0, corner(3)), ("sill", "bumper")
    )
    cab.paint("glass", (0, corner(2)), ("screen", "top"), "R")
    cab.paint("grille", (0, c.at_front(0.6)), ("bumper", "lamp_high"))
    cab.paint("headlamp", (c.at_front(0.68), corner(3)), (p.lamp_foot, "lamp_high"), "r")
    cab.paint("seam", (0, corner(3)), ("lamp_high", "lid"))
    cab.paint("seam", (0, corner(3)), ("bumper", "bumper_gap"))
    cab.paint("grille", (0, c.at_front(0.6)), ("skirt", "sill"))
    cab.paint("headlamp", (c.at_front(0.68), c.at_front(0.85)), ("sill", "fog"))
    cab.paint("indicator", (corner(2), corner(3)), ("lamp_low", "lamp_mid"))
    cab.paint("glass", (c.at_side(window), c.at_side(p.pillar)), ("belt", "top"), "rR")
    if p.style == "double_cab":
        cab.paint(
            "glass", (c.at_side(p.pillar - 0.07), c.at_side(p.cab_rear + 0.15)), ("belt", "top"), "fFrR"
        )
    cab.paint("glass", (c.at_rear(0.93), c.count - 1), ("belt", "top"), "fF")
    if p.flares:
        span = d.front_axle + p.arch, d.front_axle - p.arch
        cab.paint("plastic", (c.at_side(span[0]), c.at_side(span[1])), ("skirt", "sill"))
    for seam in seams:
        column = c.at_side(seam + 0.006)
        cab.paint("seam", (column, column + 1), ("sill", "belt"))
    return cab


def _bed(p: Plan) -> Shell:
    d, rows = p.dimensions, bed_levels(p)
    arch = Arch(d.rear_axle, p.arch, d.wheel_radius)
    front, rear = ends(rows[0])
    side = side_columns(rows[0], [arch.columns(10), np.linspace(front, rear, 4)])
    columns = Columns(
        front=np.array([0.0, 0.5, 1.0]),
        side=side,
        rear=np.array([0.0, 0.3, 0.86, 0.955, 0.97, 1.0]),
        front_stretch=front,
        rear_stretch=rear,
        corner=2,
    )
    bed = shell(rows, columns, (arch,), "rail", p.well, 0.0)
    c = bed.columns
    last = bed.points.shape[1] - 1
    bed.paint("plastic", (0, c.count - 1), (bed.level("rail"), last))
    if p.plastic:
        bed.paint("plastic", (0, c.count - 1), ("skirt", "sill"))
    if p.flares:
        span = d.rear_axle + p.arch, d.rear_axle - p.arch
        bed.paint("plastic", (c.at_side(span[0]), c.at_side(span[1])), ("skirt", "sill"))
    bed.paint("seam", (c.at_rear(0.97), c.at_rear(0.955)), ("sill", "rail"))
    bed.paint("taillamp", (c.at_rear_corner(2), c.at_rear(0.97)), ("tail_low", "tail_high"))
    bed.paint("reversing_lamp", (c.at_rear_corner(1), c.at_rear(0.97)), ("tail_low", "tail_mid"))
    return bed


def _measures(p: Plan, cab: Shell, bed: Shell) -> tuple[FloatArray, FloatArray]:
    """Keypoints and 3D box."""
    c, b, d = cab.columns, bed.columns, p.dimensions
    corner = c.at_front_corner
    mirror, size = mirror_box(p, cab)
    right = {
        "headlamp": cab.point(corner(3), "lamp_mid"),
        "taillamp": bed.point(b.at_rear_corner(2), "tail_mid"),
        "mirror": moved(mirror, 0.5 * size[0]),
        "windscreen_top": cab.point(corner(2), "top"),
        "windscreen_bottom": cab.point(corner(2), "screen"),
        "front_bumper": cab.point(corner(2), "skirt"),
        "cab_roof_rear": cab.point(c.at_rear_corner(2), "eave"),
        "bed_front": bed.point(b.at_front_corner(1), "rail"),
        "bed_rear_top": bed.point(b.at_rear_corner(1), "rail"),
        "bed_rear_bottom": bed.point(b.at_rear_corner(1), "skirt"),
    }
    hub = hub_x(p.tyre_width, p.rim)
    right["front_wheel"], right["rear_wheel"] = (moved(wheel_centres(p)[row, :3], hub) for row in (0, 2))
    middle = {
        "front_plate": plate_middle(cab.point(0, "plate"), 1.0),
        "tailgate": bed.point(b.count - 1, "rail"),
    }
    box = np.array([[-d.width, -2 * d.height, -d.length], [d.width, 0.0, d.length]]) * 0.5
    return mirrored_keypoints(CLASS, right, middle), box
