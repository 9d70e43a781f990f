"""Cars of known shape on the ground, seen as the vehicles of V1 are: the core's generator has no shapes."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import numpy as np

import groundpose as gp
from groundpose.lab.bodies.catalogue import outline
from groundpose.lab.contenders.objects import Array, Objects, relative_thresholds

BODIES = 24
"""Cars that the shape models are made of: enough for 10 modes."""
KEYPOINTS = 28
# as V1: nominal pitch 0, true pitch 1.5 deg (sd), noise 1 to 3 % of the longer box side
_PITCH_SIGMA = np.radians(1.5)
_HEIGHT, _NEAREST, _FARTHEST = 1.5, 8.0, 60.0
_NOISE, _OUTLIERS = (0.01, 0.03), (0.2, 0.5)


@cache
def car_model(modes: int) -> gp.ShapeModel:
    """Our cars' mean and this many modes of variation; 0: the mean car."""
    points, boxes = _bodies()
    if modes == 0:
        return gp.ShapeModel(points.mean(axis=0), boxes.mean(axis=0), name="car")
    return gp.ShapeModel.fit(points, modes, bbox_3d=boxes, name="car")


@cache
def _bodies() -> tuple[Array, Array]:
    """Keypoints (S, P, 3) and boxes (S, 2, 3)."""
    points, boxes = zip(*(outline("car", seed) for seed in range(BODIES)), strict=True)
    return np.stack(points), np.stack(boxes)


def cars(modes: int, trials: int, seed: int = 0) -> Objects:
    """Cars with random coefficients of `modes` modes. Depends on (modes, trials, seed) only.

    Contenders without shapes get the true one.
    """
    rng, model = np.random.default_rng([seed, modes]), car_model(modes)
    camera = gp.Camera(1000.0, 1000.0, 957.0, 540.0, image_size=(1914, 1080))
    rows = [_car(rng, model, camera) for _ in range(trials)]
    columns = dict(zip(rows[0], zip(*(row.values() for row in rows), strict=True), strict=True))
    arrays: dict[str, Any] = {name: np.stack(values) for name, values in columns.items()}
    return Objects(
        **arrays,
        view=gp.View(camera, pitch=0.0),
        models=[model] * trials,
        inlier_threshold=relative_thresholds(arrays["bboxes"]),
    )


def _car(rng: np.random.Generator, model: gp.ShapeModel, camera: gp.Camera) -> dict[str, Array]:
    """One car whose whole box is in the image."""
    while True:
        coefficients = rng.normal(size=model.modes) * np.sqrt(model.eigenvalues)
        keypoints_3d = model.keypoints(coefficients)
        view = gp.View(camera, pitch=float(rng.normal() * _PITCH_SIGMA))
        depth = rng.uniform(_NEAREST, _FARTHEST)
        x = depth * rng.uniform(-0.9, 0.9) * camera.cx / camera.fx
        R = view.R_camera_from_ground @ _about_y(rng.uniform(-np.pi, np.pi))
        t = view.R_camera_from_ground @ np.array([x, _HEIGHT, depth])
        low, high = model.bbox_3d_of(coefficients)
        corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
        seen = view.project(corners @ R.T + t)
        bbox = np.concatenate([seen.min(axis=0), seen.max(axis=0)])
        if np.all(bbox[:2] >= 0.0) and bbox[2] < 1914.0 and bbox[3] < 1080.0:
            break
    longer = max(bbox[2] - bbox[0], bbox[3] - bbox[1])
    pixels = view.project(keypoints_3d @ R.T + t)
    pixels = pixels + rng.normal(size=pixels.shape) * longer * rng.uniform(*_NOISE)
    wrong = rng.permutation(len(pixels)) < round(rng.uniform(*_OUTLIERS) * len(pixels))
    pixels[wrong] = rng.uniform(bbox[:2], bbox[2:], (int(wrong.sum()), 2))
    return {
        "keypoints_2d": pixels,
        "rigid": keypoints_3d,
        "bboxes": bbox,
        "R": R,
        "t": t,
        "inlier_truth": ~wrong,
    }


def _about_y(yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
