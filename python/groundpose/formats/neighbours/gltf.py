"""A glTF scene of one frame: 3D boxes, and the estimated shapes as lines between their keypoints; with the
package trimesh (extra `gltf`).

Metres; x right, y up along the ground's normal, z backward, the origin in the camera, as viewers of glTF
expect it.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose._core import InputError
from groundpose._writing import whole_file
from groundpose.draw.colours import POSE
from groundpose.formats.extras import extra_package
from groundpose.formats.neighbours.context import Context
from groundpose.formats.scenes import Scene
from groundpose.shape import ShapeModel
from groundpose.vehicles.shape_models import shape_model
from groundpose.vehicles.skeleton import skeleton

_GLTF_FROM_GROUND = np.diag([1.0, -1.0, -1.0])
_OPACITY = 96
_SAME = 1e-6
_FOREIGN = "shape of a model that does not come with the package"
_NONE = "shape, which tracks do not have"


def write_gltf(scenes: Iterable[Scene], path: Path, context: Context) -> None:
    """Write the frame; see `groundpose.formats.neighbours.write_scenes`."""
    trimesh = extra_package("trimesh", "trimesh", "gltf")
    frames = iter(scenes)
    scene = next(frames, None)
    if scene is None:
        raise input_error("scenes", "a frame", "none")
    if next(frames, None) is not None:
        raise input_error("scenes", "one frame for a glTF file", "several")
    made = trimesh.Scene(base_frame="ground")
    world = _GLTF_FROM_GROUND @ scene.view.R_camera_from_ground.T
    for k in scene.rows:
        name = f"{scene.classes[k] or 'vehicle'} {scene.ids[k]}"
        made.add_geometry(_box(trimesh, scene, k, world), node_name=f"{name} box", geom_name=f"{name} box")
        lines = _lines(trimesh, scene, k, world)
        if lines is None:
            context.left_out[_FOREIGN if scene.motion is None else _NONE] += 1
        else:
            made.add_geometry(lines, node_name=f"{name} shape", geom_name=f"{name} shape")
    binary = path.suffix.lower() != ".gltf"
    if not made.geometry:
        raise input_error(f"frame {scene.id}", "vehicles with a pose", "none")
    if binary:
        data = made.export(file_type="glb")
    else:
        data = trimesh.exchange.gltf.export_gltf(made, merge_buffers=True, embed_buffers=True)["model.gltf"]
    with whole_file(path, "wb") as stream:
        stream.write(data)


def _box(trimesh: Any, scene: Scene, k: int, world: FloatArray) -> Any:
    low, high = scene.bbox_3d[k]
    box = trimesh.creation.box(extents=high - low)
    box.apply_transform(_transform(world @ scene.R[k], world @ scene.centre[k]))
    colour = [int(POSE[i : i + 2], 16) for i in (1, 3, 5)]
    box.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(
            baseColorFactor=[*colour, _OPACITY], alphaMode="BLEND", doubleSided=True, roughnessFactor=1.0
        )
    )
    return box


def _lines(trimesh: Any, scene: Scene, k: int, world: FloatArray) -> Any | None:
    """The shape's lines; None where its model is not the bundled one of its class."""
    model = bundled_model(scene, k)
    if model is None:
        return None
    points = model.keypoints(scene.shape_coefficients[k]) @ scene.R[k].T + scene.t[k]
    segments = points[np.array(skeleton(scene.classes[k]))] @ world.T
    return trimesh.load_path(segments)


def bundled_model(scene: Scene, k: int) -> ShapeModel | None:
    """The model that comes with the package for the class of object `k`, if its 3D box is that of the object:
    frames may bring other models under the same name."""
    try:
        model = shape_model(scene.classes[k])
    except InputError:
        return None
    coefficients = scene.shape_coefficients[k]
    if len(coefficients) < model.modes:
        return None
    box = model.stretched_bbox_3d(coefficients)
    return model if np.allclose(box, scene.bbox_3d[k], rtol=0.0, atol=_SAME) else None


def _transform(R: FloatArray, t: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = R, t
    return matrix
