"""Indices of the materials by name, for the parts and bodies."""

from groundpose.lab.bodies.body import MATERIALS

MATERIAL: dict[str, int] = {name: index for index, name in enumerate(MATERIALS)}
"""Row of `MATERIALS` of each name."""
