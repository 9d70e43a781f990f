"""From the reference's types to the compiled core: what the tests that compare the two have in common."""

from __future__ import annotations

from typing import Any

import numpy as np
from groundpose import _core
from ref_geometry import Array, RefView
from ref_scenes import Scene


def core_camera(view: RefView) -> _core.Camera:
    camera = view.camera
    return _core.Camera(camera.fx, camera.fy, camera.cx, camera.cy, distortion=camera.distortion)


def core_view(view: RefView) -> _core.View:
    return _core.View(core_camera(view), pitch=view.pitch, roll=view.roll, height=view.height)


def core_model(
    keypoints_3d: Array, bbox_3d: Array, basis: Array | None = None, footprint: Array | None = None
) -> _core.Model:
    """Unit eigenvalues: the scenes draw their coefficients from N(0, 1). The core asks for C order."""
    basis = np.zeros((0, len(keypoints_3d), 3)) if basis is None else np.ascontiguousarray(basis)
    footprint = None if footprint is None else np.ascontiguousarray(footprint)
    keypoints_3d, bbox_3d = np.ascontiguousarray(keypoints_3d), np.ascontiguousarray(bbox_3d)
    return _core.Model(keypoints_3d, bbox_3d, basis, np.ones(len(basis)), footprint)


def estimate(
    view: RefView, pixels: Array, bbox: Array, model: _core.Model, threshold: float, **options: Any
) -> dict[str, Any]:
    """The answer for one object; its values without the leading axis, `status` by name."""
    fields = _core.Options(**options)
    thresholds = np.array([threshold])
    estimator = _core.Estimator(core_view(view), _core.Models.of(model), fields, thresholds, 1)
    answers = estimator.estimate(np.ascontiguousarray(pixels)[None], np.ascontiguousarray(bbox)[None])
    assert answers is not None
    return {name: answers.array(name)[0] for name in answers.names}


def estimate_scene(scene: Scene, basis: Array | None, threshold: float, **options: Any) -> dict[str, Any]:
    model = core_model(scene.keypoints_3d, scene.bbox_3d, basis)
    return estimate(scene.view, scene.pixels, scene.bbox, model, threshold, **options)
