"""Procedural vehicles: closed meshes with materials and keypoints, any number of each class."""

from groundpose.lab.bodies.body import MATERIALS, Body
from groundpose.lab.bodies.catalogue import body, keypoints_of
from groundpose.lab.bodies.regions import STYLES

__all__ = ["MATERIALS", "STYLES", "Body", "body", "keypoints_of"]
