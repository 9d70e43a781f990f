"""Vehicles: classes, keypoints, shape models; procedural bodies when they are asked for."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import (
    KEYPOINTS,
    KINDS,
    Keypoint,
    flip_indices,
    keypoint_indices,
    keypoint_names,
)
from groundpose.vehicles.shape_models import shape_model

if TYPE_CHECKING:
    from groundpose.lab.bodies import MATERIALS, STYLES, Body, body, keypoints_of

__all__ = [
    "CLASSES",
    "KEYPOINTS",
    "KINDS",
    "MATERIALS",
    "STYLES",
    "Body",
    "Keypoint",
    "body",
    "flip_indices",
    "keypoint_indices",
    "keypoint_names",
    "keypoints_of",
    "shape_model",
]

# Procedural bodies belong to the laboratory, which the runtime does not import.
_OF_THE_LABORATORY = ("MATERIALS", "STYLES", "Body", "body", "keypoints_of")


def __getattr__(name: str) -> Any:
    if name not in _OF_THE_LABORATORY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("groundpose.lab.bodies"), name)
