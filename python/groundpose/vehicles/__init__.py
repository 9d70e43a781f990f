"""Vehicles made by code: 53 keypoints, four classes, bodies for pictures, shape models for estimation."""

from groundpose.lab.bodies.body import MATERIALS, Body
from groundpose.lab.bodies.catalogue import STYLES, body, keypoints_of
from groundpose.vehicles.keypoints import (
    KEYPOINTS,
    KINDS,
    Keypoint,
    flip_indices,
    keypoint_indices,
    keypoint_names,
)
from groundpose.vehicles.shape_models import shape_model

__all__ = [
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
