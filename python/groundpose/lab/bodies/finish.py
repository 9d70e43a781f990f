"""The last steps of every body: order the keypoints of both sides, merge the components into one mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.body import Body
from groundpose.lab.bodies.geometry.mesh import Component, assemble
from groundpose.lab.bodies.roof import roof_things
from groundpose.vehicles.keypoints import KEYPOINTS, keypoint_indices

MOST_TRIANGLES = 15_000
_MIRROR = np.array([-1.0, 1.0, 1.0])


def mirrored_keypoints(
    class_name: str, right: Mapping[str, FloatArray], middle: Mapping[str, FloatArray]
) -> FloatArray:
    """Keypoints (P, 3) of a class in order, from those of the right side and the middle.

    The names of the right side come without "right_".
    """
    rows = []
    for i in keypoint_indices(class_name):
        side, _, name = KEYPOINTS[i].name.partition("_")
        if KEYPOINTS[i].partner is None:
            rows.append(middle[KEYPOINTS[i].name])
        else:
            rows.append(right[name] if side == "right" else right[name] * _MIRROR)
    return np.array(rows)


def finished(
    class_name: str,
    style: str,
    seed: int,
    components: Sequence[Component],
    keypoints_3d: FloatArray,
    bbox_3d: FloatArray,
    wheels: FloatArray,
) -> Body:
    """The body made of components in the object frame (large surfaces first) and what is on its roof."""
    parts = [*components, *roof_things(class_name, style, seed, components[:2], keypoints_3d)]
    mesh = assemble(parts)
    if len(mesh.faces) > MOST_TRIANGLES:
        mesh = assemble([part for part in parts if not part.spare])
    return Body(
        class_name,
        style,
        seed,
        mesh.vertices,
        mesh.normals,
        mesh.faces,
        mesh.materials,
        mesh.parts,
        keypoints_3d,
        bbox_3d,
        wheels,
    )
