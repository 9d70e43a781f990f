"""A vehicle's body: a closed mesh with materials, its keypoints and its measures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray

MATERIALS: tuple[str, ...] = (
    "paint",
    "paint_second",  # two-tone bodies, box panels, stripes, advertising
    "glass",
    "chrome",
    "plastic",  # black trim, unpainted bumpers
    "rubber",  # seals, mud flaps
    "tyre",
    "rim",
    "headlamp",
    "taillamp",
    "indicator",
    "plate",
    "grille",
    "interior",
    "seat",
    "underbody",
    "metal",  # chassis, tanks, exhausts, brake discs
    "seam",  # gaps of doors, bonnet and boot
    "mirror",  # the reflecting glass of side mirrors
    "reversing_lamp",
    "display",  # destination of a bus
    "skin",
    "clothes",
)
"""Names of the surfaces; a face stores the index."""


@dataclass(frozen=True, eq=False)
class Body:
    """One vehicle in its object frame: x right, y down, z forward, metres; y = 0 is the ground.

    The origin lies on the ground under the middle of the body. Arrays are read-only.

    Args:
        class_name: one of `CLASSES`.
        style: of the class, one of `STYLES[class_name]`.
        seed: with class and style, the whole input of the generator.
        vertices: (V, 3).
        normals: (V, 3) unit shading normals; vertices are doubled at creases.
        faces: (F, 3) rows of `vertices`, counter-clockwise seen from outside.
        materials: (F,) rows of `MATERIALS`.
        parts: (F,) component of each face; each is closed once equal positions are merged.
        keypoints_3d: (P, 3) on the surface, in the order of `keypoint_names(class_name)`.
        bbox_3d: (2, 3) `[min, max]` corner without mirrors and antennas.
        wheels: (W, 4) centre x, y, z and radius.
    """

    class_name: str
    style: str
    seed: int
    vertices: FloatArray
    normals: FloatArray
    faces: NDArray[np.int32]
    materials: NDArray[np.uint8]
    parts: NDArray[np.uint16]
    keypoints_3d: FloatArray
    bbox_3d: FloatArray
    wheels: FloatArray

    def __post_init__(self) -> None:
        """Make the arrays read-only, because scenes share bodies."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def kind(self) -> str:
        """The former name of `class_name`."""
        return self.class_name

    @property
    def size(self) -> tuple[float, float, float]:
        """`(length, height, width)` of the 3D box, metres."""
        width, height, length = (self.bbox_3d[1] - self.bbox_3d[0]).tolist()
        return length, height, width
