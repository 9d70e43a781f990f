"""Cars, from kei cars to people carriers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.body import Body
from groundpose.lab.bodies.car.cabin import Cabin, Trim, make_cabin
from groundpose.lab.bodies.car.details import interior, mirrors, outside
from groundpose.lab.bodies.car.faces import ends, front_face, plate_points, rear_face
from groundpose.lab.bodies.car.lamps import headlamp, lamps, tail_lamp
from groundpose.lab.bodies.car.look import Face, Fittings, draw_face, draw_fittings
from groundpose.lab.bodies.car.seams import seams
from groundpose.lab.bodies.car.shape import CarShape, draw_shape
from groundpose.lab.bodies.car.shell import Shell, make_shell
from groundpose.lab.bodies.dimensions import random_stream
from groundpose.lab.bodies.finish import finished, mirrored_keypoints
from groundpose.lab.bodies.geometry.mesh import Component
from groundpose.lab.bodies.parts.wheels import CAR_RIMS, FIRST_COVER, Rim, hub_x, place_wheels, wheel


@dataclass(frozen=True, eq=False)
class _Car:
    """All choices of one car and its two large surfaces."""

    shape: CarShape
    face: Face
    fittings: Fittings
    rim: Rim
    phase: float
    shell: Shell
    cabin: Cabin


def build(style: str, seed: int) -> Body:
    """The car of this style with number `seed`."""
    car = _draw(style, seed)
    shape = car.shape
    ends_ = ends(shape, car.shell, car.face)
    wheels = _wheels(shape)
    wheel_parts = wheel(shape.outer.wheel_radius, shape.tyre_width, shape.rim_radius, car.rim, car.phase)
    components = [
        car.shell.component(),
        car.cabin.component(),
        *ends_,
        *lamps(shape, car.shell, car.face),
        *front_face(shape, car.shell, car.face),
        *rear_face(shape, car.shell, car.face),
        *seams(shape, car.shell),
        *mirrors(shape, car.cabin, car.fittings),
        *outside(shape, car.shell, car.cabin, car.fittings),
        *interior(shape, car.fittings, np.random.default_rng([88, seed])),
        *place_wheels(wheels, wheel_parts),
    ]
    return finished("car", style, seed, components, _keypoints(car), _box(car, ends_), wheels)


def keypoints(style: str, seed: int) -> tuple[FloatArray, FloatArray]:
    """`keypoints_3d` (28, 3) and `bbox_3d` (2, 3) of `build(style, seed)`, without its mesh."""
    car = _draw(style, seed)
    return _keypoints(car), _box(car, ends(car.shape, car.shell, car.face))


def _draw(style: str, seed: int) -> _Car:
    rng = random_stream("car", style, seed)
    shape = draw_shape(style, rng)
    face, fittings = draw_face(shape, rng), draw_fittings(shape, rng)
    steel = rng.random() > shape.age + 0.15
    rim = CAR_RIMS[int(rng.integers(FIRST_COVER, len(CAR_RIMS)) if steel else rng.integers(FIRST_COVER))]
    phase = float(rng.uniform(0.0, 2.0 * np.pi))
    trim = _trim(shape, face, rng)
    shell = make_shell(shape)
    return _Car(shape, face, fittings, rim, phase, shell, make_cabin(shape, shell, trim))


def _trim(shape: CarShape, face: Face, rng: np.random.Generator) -> Trim:
    old = shape.age < 0.4
    black = rng.random() < (0.45 if old else 0.85)
    two_tone = shape.style in ("suv", "hatchback", "coupe", "city_car", "kei_car")
    black_roof = shape.age > 0.7 and two_tone and rng.random() < 0.1
    return Trim(
        b_pillar="plastic" if black else "paint",
        frame="plastic" if rng.random() < 0.25 else "paint",
        belt=("plastic", "chrome", "paint")[int(rng.choice(3, p=(0.75, 0.15, 0.10)))],
        pillars="paint",
        roof="plastic" if black_roof else "paint",
        surround="plastic" if not shape.notchback and rng.random() < 0.35 else "paint",
        tail_lamps=face.tail_pillars,
        quarter=bool(rng.random() < (0.9 if shape.style in ("estate", "suv", "mpv") else 0.5)),
    )


def _wheels(shape: CarShape) -> FloatArray:
    """Centres and radius (4, 4), front right first."""
    x = shape.half_width - 0.014 - 0.5 * shape.tyre_width
    d = shape.outer
    return np.array(
        [
            [s * x, -d.wheel_radius, z, d.wheel_radius]
            for z in (d.front_axle, d.rear_axle)
            for s in (1.0, -1.0)
        ]
    )


def _box(car: _Car, end_parts: list[Component]) -> FloatArray:
    """Extent (2, 3) of body, bumpers and plates, down to the ground."""
    points = [
        car.shell.points.reshape(-1, 3),
        car.cabin.points.reshape(-1, 3),
        *(p.vertices for p in end_parts),
    ]
    low = np.min([p.min(axis=0) for p in points], axis=0)
    high = np.max([p.max(axis=0) for p in points], axis=0)
    width = max(high[0], -low[0])
    return np.array([[-width, low[1], low[2]], [width, 0.0, high[2]]])


def _keypoints(car: _Car) -> FloatArray:
    """Keypoints (28, 3) in the order of the table; the left ones mirror the right ones."""
    shape, shell, cabin = car.shape, car.shell, car.cabin
    wheels = _wheels(shape)
    face = hub_x(shape.tyre_width, car.rim)
    plates = plate_points(shape, shell, car.face)
    tail = cabin.tail_corner if car.face.tail_pillars else tail_lamp(shape, shell, car.face).outer_end(shell)
    housing = mirrors(shape, cabin, car.fittings)[0].vertices
    right = {
        "front_wheel": wheels[0, :3] + [face, 0.0, 0.0],
        "rear_wheel": wheels[2, :3] + [face, 0.0, 0.0],
        "headlamp": headlamp(shape, shell, car.face).outer_end(shell),
        "taillamp": tail,
        "mirror": housing[np.argmax(housing[:, 0])],
        "windscreen_top": cabin.corner("screen", end=True, top=True),
        "windscreen_bottom": cabin.corner("screen", end=True, top=False),
        "front_bumper": shell.points[shell.front_corner, shell.first_row],
        "rear_bumper": shell.points[shell.rear_corner, shell.first_row],
        "rear_window_bottom": cabin.corner("rear_window", end=False, top=False),
        "rear_window_top": cabin.corner("rear_window", end=False, top=True),
        "belt_b": cabin.corner("front_door", end=True, top=False),
        "belt_c": cabin.corner("quarter", end=True, top=False),
    }
    return mirrored_keypoints("car", right, {"front_plate": plates[0], "rear_plate": plates[1]})
