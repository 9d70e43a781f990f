"""Vans, minibuses, city buses and coaches: one shell of levels, glazed and fitted by style."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.body import Body
from groundpose.lab.bodies.common import moved, plate_middle
from groundpose.lab.bodies.dimensions import random_stream
from groundpose.lab.bodies.finish import finished, mirrored_keypoints
from groundpose.lab.bodies.outlines import Arch, Columns
from groundpose.lab.bodies.parts.wheels import hub_x
from groundpose.lab.bodies.shell import Shell, shell, side_columns
from groundpose.lab.bodies.van_bus.fittings import fittings, mirror_box
from groundpose.lab.bodies.van_bus.plan import Plan, levels, plan, wheel_centres

CLASS = "van_bus"


def build(style: str, seed: int) -> Body:
    """The body of this style and seed."""
    rng = random_stream(CLASS, style, seed)
    p = plan(style, rng)
    hull = _hull(p)
    parts = [hull.component(), *fittings(p, hull, rng)]
    return finished(CLASS, style, seed, parts, *_measures(p, hull), wheel_centres(p))


def keypoints(style: str, seed: int) -> tuple[FloatArray, FloatArray]:
    """Keypoints (26, 3) and 3D box (2, 3) of `build(style, seed)`, without its mesh."""
    p = plan(style, random_stream(CLASS, style, seed))
    return _measures(p, _hull(p))


def _hull(p: Plan) -> Shell:
    """The shell with its glass, lamps and doors."""
    d = p.dimensions
    arches = tuple(Arch(z, p.arch, d.wheel_radius) for z in (d.front_axle, d.rear_axle))
    side = [arch.columns() for arch in arches]
    for window in p.windows:
        side.append(np.array([window.front, window.front - 0.06, window.rear + 0.06, window.rear]))
    for seam in p.seams:
        side.append(np.array([seam + 0.007, seam - 0.007]))
    rows = levels(p)
    columns = Columns(
        front=np.array([0.0, 0.14, 0.16, 0.4, 0.66, 0.82, 1.0]),
        side=side_columns(rows[0], side),
        rear=np.array([0.0, 0.1, 0.5, 0.8, 0.94, 1.0]),
        front_stretch=p.front_stretch,
        rear_stretch=d.rear_axle - p.arch - 0.02,
    )
    hull = shell(rows, columns, arches, "belt" if p.bus else "bonnet_1", p.well, p.crown)
    _paint(p, hull)
    return hull


def _paint(p: Plan, hull: Shell) -> None:
    c = hull.columns
    whole = (0, c.count - 1)
    screen = c.at_front_corner(p.screen_step)
    if p.two_tone:
        hull.paint("paint_second", whole, p.two_tone)
    if p.plastic_bumpers:
        hull.paint("plastic", (0, c.at_front_corner(3)), ("skirt", "bumper"))
        hull.paint("plastic", (c.at_rear_corner(3), whole[1]), ("skirt", "bumper"))
    if p.band:  # black between the side windows
        hull.paint("plastic", (c.at_side(p.windows[0].front), c.at_side(p.windows[-1].rear)), ("belt", "top"))
    for window in p.windows:
        span = (c.at_side(window.front), c.at_side(window.rear))
        hull.paint("glass", span, window.levels, "" if window.sharp else "fFrR", window.sides)
    _paint_front(p, hull, screen)
    _paint_rear(p, hull)
    for seam in p.seams:
        column = c.at_side(seam + 0.007)
        hull.paint("seam", (column, column + 1), ("sill", p.seam_top))


def _paint_front(p: Plan, hull: Shell, screen: int) -> None:
    c = hull.columns
    if p.display:
        hull.paint("plastic", (0, screen), ("top", "eave_low"))
        hull.paint("display", (0, c.at_front(0.66)), ("display_low", "display_high"))
    if p.mask:  # black around the screen
        hull.paint("plastic", (0, screen), (p.mask, "screen"))
    hull.paint("glass", (0, screen), ("screen", "top"), "R" if not p.bus else "")
    grille = c.at_front(p.grille)
    hull.paint("grille", (0, grille), ("bumper", "lamp_high") if p.tall_grille else ("lamp_low", "lamp_high"))
    lamp = (c.at_front(p.lamp_inner), c.at_front_corner(p.lamp_step))
    hull.paint("headlamp", lamp, ("lamp_low", p.lamp_top), "r")
    hull.paint("indicator", (lamp[1] - 1, lamp[1]), ("lamp_mid", "lamp_high"))
    hull.paint("seam", (0, c.at_front_corner(3)), ("bumper", "bumper_gap"))
    if not p.bus:
        hull.paint("seam", (0, lamp[0]), ("lamp_high", "lid"))
        hull.paint("grille", (0, c.at_front(0.66)), ("sill", "plate"))


def _paint_rear(p: Plan, hull: Shell) -> None:
    c = hull.columns
    last = c.count - 1
    hull.paint("glass", (c.at_rear(p.rear_glass), last), ("belt", p.rear_glass_top), "fF")
    if p.split_rear:
        hull.paint("paint", (c.at_rear(0.1), last), ("belt", "top"))
    hull.paint("seam", (c.at_rear_corner(3), last), ("bumper", "bumper_gap"))
    if p.engine_grille:
        hull.paint("grille", (c.at_rear(0.5), last), ("lamp_mid", "lamp_high"))
    lamp = (c.at_rear_corner(p.tail_step), c.at_rear(p.tail_inner))
    hull.paint("taillamp", lamp, p.tail)
    above = hull.level(p.tail[0])
    hull.paint("reversing_lamp", (lamp[0] + 1, lamp[1]), (above, above + 1))


def _measures(p: Plan, hull: Shell) -> tuple[FloatArray, FloatArray]:
    """Keypoints and 3D box."""
    c, d = hull.columns, p.dimensions
    first = p.windows[0]
    mirror, size = mirror_box(p, hull)
    right = {
        "headlamp": hull.point(c.at_front_corner(p.lamp_step), "lamp_mid"),
        "taillamp": hull.point(c.at_rear_corner(p.tail_step), p.tail_middle),
        "mirror": moved(mirror, 0.5 * size[0]),
        "windscreen_top": hull.point(c.at_front_corner(p.screen_step), "top"),
        "windscreen_bottom": hull.point(c.at_front_corner(p.screen_step), "screen"),
        "front_bumper": hull.point(c.at_front_corner(2), "skirt"),
        "rear_bumper": hull.point(c.at_rear_corner(2), "skirt"),
        "rear_window_bottom": hull.point(c.at_rear(p.rear_glass), "belt"),
        "roof_rear": hull.point(c.at_rear_corner(2), "eave"),
        "side_window_top": hull.point(c.at_side(first.rear), first.levels[1]),
    }
    centres = wheel_centres(p)
    hubs = [hub_x(p.tyre_width, rim) for rim in (p.front_rim, p.rear_rim)]
    right["front_wheel"], right["rear_wheel"] = (
        moved(centres[row, :3], hub) for row, hub in zip((0, 2), hubs, strict=True)
    )
    middle = {
        "front_plate": plate_middle(hull.point(0, "plate"), 1.0),
        "rear_plate": plate_middle(hull.point(c.count - 1, p.rear_plate), -1.0),
    }
    box = np.array([[-d.width, -2 * d.height, -d.length], [d.width, 0.0, d.length]]) * 0.5
    return mirrored_keypoints(CLASS, right, middle), box
