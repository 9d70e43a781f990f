"""The shape models that ship: mean keypoints, modes and box of each class."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from groundpose._checks import input_error
from groundpose.shape import ShapeModel
from groundpose.vehicles.classes import CLASSES

FOLDER = Path(__file__).with_name("models")
"""Where `python -m groundpose.lab.bodies.make_models` writes."""


def shape_model(class_name: str) -> ShapeModel:
    """The shape model of a class: principal components of the bodies of `groundpose.lab.bodies.body`.

    Its object frame is theirs: origin on the ground under the middle, x right, y down, z forward, metres.

    Args:
        class_name: one of `groundpose.vehicles.CLASSES`.

    Raises:
        InputError: an unknown class.
    """
    if class_name not in CLASSES:
        raise input_error("class_name", f"one of {', '.join(CLASSES)}", repr(class_name))
    return _loaded(class_name)


@cache
def _loaded(class_name: str) -> ShapeModel:
    return ShapeModel.load(FOLDER / f"{class_name}.npz")
