"""The shape models that ship: mean keypoints, modes and box of each class."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from groundpose._checks import input_error
from groundpose.shape import ShapeModel
from groundpose.vehicles.keypoints import KINDS

FOLDER = Path(__file__).with_name("models")
"""Where `python -m groundpose.lab.bodies.make_models` writes."""


def shape_model(kind: str) -> ShapeModel:
    """The shape model of class `kind`: principal components of the bodies of `groundpose.lab.bodies.body`.

    Its object frame is theirs: origin on the ground under the middle, x right, y down, z forward, metres.

    Raises:
        InputError: an unknown class.
    """
    if kind not in KINDS:
        raise input_error("kind", f"one of {', '.join(KINDS)}", repr(kind))
    return _loaded(kind)


@cache
def _loaded(kind: str) -> ShapeModel:
    return ShapeModel.load(FOLDER / f"{kind}.npz")
