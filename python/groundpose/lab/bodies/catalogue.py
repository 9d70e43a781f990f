"""Vehicles by class and seed."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from groundpose._checks import FloatArray, count, input_error
from groundpose.lab.bodies import real
from groundpose.lab.bodies.body import Body
from groundpose.lab.bodies.box_truck import body as box_truck
from groundpose.lab.bodies.car import body as car
from groundpose.lab.bodies.dimensions import random_stream
from groundpose.lab.bodies.pickup import body as pickup
from groundpose.lab.bodies.regions import STYLES, draw_region, style_fractions
from groundpose.lab.bodies.van_bus import body as van_bus
from groundpose.vehicles.classes import CLASSES

STYLE_NAMES: tuple[str, ...] = tuple(style for class_name in CLASSES for style in STYLES[class_name])
"""All styles of all classes; labels store the index."""
_BUILDERS: dict[str, ModuleType] = {"car": car, "van_bus": van_bus, "pickup": pickup, "box_truck": box_truck}


def body(class_name: str, seed: int, style: str | None = None) -> Body:
    """The vehicle of class `class_name` with number `seed`; the same arguments give the same bytes.

    Without a style, the few seeds `real.seeds(class_name)` are vehicles drawn by hand; the others are
    procedural.

    Args:
        class_name: class, one of `CLASSES`.
        seed: 0 or larger.
        style: one of `STYLES[class_name]`; None: drawn from the seed with the frequencies on the road.

    Raises:
        InputError: an unknown class or style, a negative seed.
    """
    drawn = style_of(class_name, seed)  # checks class and seed
    if style is not None and style not in STYLES[class_name]:
        raise input_error("style", f"one of {', '.join(STYLES[class_name])}", repr(style))
    if style is None and seed in real.seeds(class_name):
        return real.build(class_name, seed)
    made: Body = _BUILDERS[class_name].build(style or drawn, seed)
    return made


def keypoints_of(class_name: str, seed: int) -> FloatArray:
    """`body(class_name, seed).keypoints_3d` (P, 3), computed without the mesh."""
    return outline(class_name, seed)[0]


def outline(class_name: str, seed: int) -> tuple[FloatArray, FloatArray]:
    """`keypoints_3d` (P, 3) and `bbox_3d` (2, 3) of `body(class_name, seed)`, computed without the mesh."""
    style = style_of(class_name, seed)  # checks class and seed
    if seed in real.seeds(class_name):
        return real.outline(class_name, seed)
    made: tuple[FloatArray, FloatArray] = _BUILDERS[class_name].keypoints(style, seed)
    return made


def style_of(class_name: str, seed: int) -> str:
    """The style of `body(class_name, seed)`, from its own stream: bodies stay when frequencies change."""
    if class_name not in CLASSES:
        raise input_error("class_name", f"one of {', '.join(CLASSES)}", repr(class_name))
    if seed in real.seeds(class_name):
        return real.style(class_name, seed)
    rng = np.random.Generator(
        np.random.PCG64(np.random.SeedSequence((count("seed", seed), CLASSES.index(class_name))))
    )
    return STYLES[class_name][int(rng.choice(len(STYLES[class_name]), p=style_fractions(class_name)))]


def region_of(class_name: str, seed: int, style: str | None = None) -> str:
    """The region, one of `regions.REGIONS`, of `body(class_name, seed, style)`."""
    style = style or style_of(class_name, seed)
    return draw_region(class_name, style, random_stream(class_name, style, seed))
