"""Interior visible through the windows: seats, dashboard, steering wheel, driver."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.mesh import Component
from groundpose.lab.bodies.geometry.primitives import ellipsoid, pipe, rounded_box
from groundpose.lab.bodies.parts.materials import MATERIAL

# Angle of the backrest to the vertical, radians.
_LEAN = 0.30


def seat(width: float = 0.50, back: float = 0.60, headrests: int = 1) -> list[Component]:
    """A seat or bench for travel along +z; its origin is where cushion and backrest meet (y down)."""
    paint = MATERIAL["seat"]
    cushion = rounded_box(width, 0.16, 0.50, 0.06, paint, 1).moved(0.0, 0.06, 0.22)
    rest = rounded_box(0.96 * width, back, 0.15, 0.07, paint, 1).moved(0.0, -0.5 * back, 0.0)
    parts = [cushion, _leant(rest)]
    for place in np.linspace(-0.5, 0.5, headrests + 2)[1:-1] * width * (headrests > 1):
        head = rounded_box(0.26, 0.18, 0.10, 0.045, paint, 1).moved(float(place), -back - 0.09, 0.015)
        parts.append(_leant(head))
    return parts


def dashboard(width: float, height: float = 0.26, depth: float = 0.45) -> Component:
    """A dashboard about the middle of its upper edge towards the windscreen; it reaches down and back."""
    box = rounded_box(width, height, depth, 0.08, MATERIAL["interior"], 1)
    return box.moved(0.0, 0.5 * height, -0.5 * depth)


def steering_wheel(radius: float = 0.185, tilt: float = 0.45) -> list[Component]:
    """A wheel about the origin facing the driver (towards -z), its upper side leaning forward by radians."""
    turn = np.linspace(0.0, 2.0 * np.pi, 10, endpoint=False)
    rim = pipe(
        np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.0 * turn], axis=1),
        0.016,
        MATERIAL["plastic"],
        segments=4,
        closed=True,
    )
    hub = rounded_box(1.9 * radius, 0.10, 0.04, 0.018, MATERIAL["plastic"], 1)
    return [part.turned("x", -tilt) for part in (rim, hub)]


def driver(tall: float = 0.88) -> list[Component]:
    """A person on a seat's origin who holds the steering wheel, `tall` metres from cushion to crown."""
    arms = [
        pipe(
            np.array([[0.20 * s, -0.44, 0.10], [0.27 * s, -0.24, 0.30], [0.14 * s, -0.32, 0.52]]),
            0.045,
            MATERIAL["clothes"],
            5,
        )
        for s in (-1.0, 1.0)
    ]
    return [*passenger(tall), *(arm.spared() for arm in arms)]


def passenger(tall: float = 0.88, clothes: str = "clothes") -> list[Component]:
    """Trunk, head and hair of a person on a seat's origin, `tall` metres from cushion to crown."""
    shoulder = tall - 0.27
    trunk = ellipsoid(0.44, shoulder + 0.02, 0.26, MATERIAL[clothes], 7, 3, 0.8)
    head = ellipsoid(0.16, 0.25, 0.20, MATERIAL["skin"], 7, 4).moved(0.0, 0.13 - tall, 0.09)
    hair = ellipsoid(0.18, 0.20, 0.19, MATERIAL["interior"], 7, 3).moved(0.0, 0.10 - tall, 0.06)
    return [part.spared() for part in (trunk.moved(0.0, -0.5 * shoulder, 0.10), head, hair)]


def passengers(places: FloatArray, tall: float, fraction: float, rng: np.random.Generator) -> list[Component]:
    """People on a fraction of the seats with origins `places` (N, 3)."""
    return [
        part.moved(*place.tolist())
        for place in places[rng.random(len(places)) < fraction]
        for part in passenger(
            tall - float(rng.uniform(0.0, 0.1)), ("clothes", "seat", "interior")[int(rng.integers(3))]
        )
    ]


def _leant(part: Component) -> Component:
    return part.turned("x", _LEAN)
