"""The outer surface of a car below the belt line: outline, profiles, wheel arches, upper and lower edge."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.car.shape import CarShape
from groundpose.lab.bodies.geometry.loft import Table, along
from groundpose.lab.bodies.geometry.wall import Wall


def arch_radius(shape: CarShape) -> float:
    """Radius of the openings over the wheels."""
    return shape.outer.wheel_radius + shape.arch_gap


def _outline(shape: CarShape) -> FloatArray:
    """Control points (K, 2) `[x, z]` of the outline seen from above, right half."""
    half, w, d = 0.5 * shape.outer.length, shape.half_width, shape.outer
    nose, tail = shape.nose_corner, shape.tail_corner
    return np.array(
        [
            [0.0, half],
            [0.50 * w, half - 0.1 * shape.nose_bow],
            [0.84 * w, half - shape.nose_bow],
            [0.985 * w, half - shape.nose_bow - 0.22 - nose],
            [w, d.front_axle],
            [w, 0.0],
            [w, d.rear_axle],
            [0.985 * w, -half + 0.24 + tail],
            [0.88 * w, -half + 0.06 + 0.3 * tail],
            [0.50 * w, -half],
            [0.0, -half],
        ]
    )


def make_wall(shape: CarShape) -> Wall:
    """The outer surface below the belt line."""
    d = shape.outer
    low, bonnet, belt, deck = d.clearance, shape.bonnet_height, shape.belt_height, shape.tail_height
    bumper = shape.bumper_height
    lean, back = shape.nose_lean, shape.tail_lean
    front = (
        [low, low + 0.06, 0.75 * bumper + 0.25 * low, bumper, bumper + 0.06, bonnet, bonnet + 0.3],
        [0.07, 0.025, 0.006, 0.0, 0.012, lean, lean + 0.2],
    )
    side = (
        [low, low + 0.05, 0.48, 0.62, belt - 0.06, belt, belt + 0.2],
        [
            shape.rocker,
            0.55 * shape.rocker,
            0.004,
            0.0,
            0.6 * shape.shoulder,
            shape.shoulder,
            shape.shoulder + 0.05,
        ],
    )
    rear = (
        [low + 0.05, low + 0.14, 0.45, 0.56, 0.63, deck, deck + 0.3],
        [0.09, 0.03, 0.0, 0.004, 0.03, back, back + 0.1],
    )
    top, radius = TopEdge(shape), top_radius(shape)

    def bulge(plan: FloatArray, h: FloatArray) -> FloatArray:
        z = plan[..., 1]
        depth = top(z) - h
        out = -shape.crease_step * np.clip((shape.crease - depth) / 0.028 + 0.5, 0.0, 1.0)
        for axle in (d.front_axle, d.rear_axle):
            away = np.hypot(z - axle, h - d.wheel_radius) - arch_radius(shape)
            out += shape.flare * np.exp(-((np.maximum(away, 0.0) / 0.09) ** 2)) * (away < 0.4)
        over = np.clip(radius - depth, 0.0, radius)
        return np.asarray(out - radius + np.sqrt(np.maximum(radius**2 - over**2, 0.0)))

    return Wall(_outline(shape), front, side, rear, bulge)


def top_radius(shape: CarShape) -> float:
    """Radius of the rounding at the wall's upper edge."""
    return 0.028 + 0.3 * shape.shoulder


class TopEdge:
    """Height of the wall's upper edge as a function of z."""

    def __init__(self, shape: CarShape) -> None:
        """Bonnet's edge, wing, belt line, boot."""
        half, edge = 0.5 * shape.outer.length, shape.bonnet_height
        belt, corner = shape.belt_height, shape.cowl_z - shape.screen_bow
        rear = belt + shape.belt_rise
        rise = belt - edge
        end = shape.deck_z + 0.10
        wing, nose = shape.outer.front_axle, half - shape.nose_bow - 0.06
        boot = min(end - 0.35, -half + 0.25) if shape.notchback else -half + 0.12
        z = np.array([-half, boot, end, 0.5 * (end + corner), corner, wing, half - 0.35, nose, half])
        tail = shape.tail_height - 0.02
        h = np.array(
            [
                *(tail, tail, max(rear, min(tail, rear + 0.02)), 0.5 * (belt + rear), belt),
                *(edge + 0.72 * rise, edge + 0.34 * rise, edge + 0.03, edge),
            ]
        )
        order = np.argsort(z)
        places = np.linspace(-half, half, 400)
        self._table = Table(-half, float(places[1] - places[0]), along(h[order], z[order], places))

    def __call__(self, z: object) -> FloatArray:
        """Heights at z."""
        return self._table(z)


def lower_edge(shape: CarShape, z: FloatArray) -> FloatArray:
    """Height of the wall's lower edge: the sill, over the wheels the arch."""
    d, half = shape.outer, 0.5 * shape.outer.length
    sill = along(
        np.array([d.clearance + 0.09, d.clearance, d.clearance, d.clearance + 0.015]),
        np.array([-half, d.rear_axle, d.front_axle, half]),
        z,
    )
    radius = arch_radius(shape)
    for axle in (d.front_axle, d.rear_axle):
        inside = np.abs(z - axle) <= radius
        sill = np.where(inside, d.wheel_radius + np.sqrt(np.maximum(radius**2 - (z - axle) ** 2, 0.0)), sill)
    return np.asarray(sill)
