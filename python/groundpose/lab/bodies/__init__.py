"""Procedural vehicles: closed meshes with materials and keypoints, any number of each class."""

from groundpose.lab.bodies.body import MATERIALS, Body
from groundpose.lab.bodies.catalogue import STYLE_NAMES, STYLES, body, keypoints_of

__all__ = ["MATERIALS", "STYLES", "STYLE_NAMES", "Body", "body", "keypoints_of"]
