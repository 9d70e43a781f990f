"""Random scenes for the reference values and the tests: a car-sized box seen by a tilted camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from ref_geometry import (
    Array,
    Mask,
    RefCamera,
    RefView,
    box_columns,
    box_corners,
    project,
    rays_ground,
    upright_pose,
)


@dataclass(frozen=True)
class Scene:
    """One object: `pixels` are what is observed, `bbox` the extent of the eight projected corners (exact)."""

    view: RefView
    keypoints_3d: Array
    bbox_3d: Array
    bbox: Array
    pixels: Array
    inliers: Mask
    R: Array
    t: Array
    yaw: float
    shape: Array


def car_box(rng: np.random.Generator) -> Array:
    """(2, 3) 3D box of a car, its origin anywhere inside: width, height, length along x, y, z."""
    size = rng.uniform([1.5, 1.3, 3.5], [2.2, 2.2, 5.5])
    low = -size * rng.uniform(0.2, 0.8, 3)
    return np.array([low, low + size])


def car_model(rng: np.random.Generator, points: int = 28, modes: int = 3) -> tuple[Array, Array, Array]:
    """(mean (P, 3), basis (modes, P, 3), bbox_3d): keypoints in a car's box, random modes of 5 cm a point."""
    bbox_3d = car_box(rng)
    mean = rng.uniform(bbox_3d[0], bbox_3d[1], (points, 3))
    return mean, 0.05 * rng.standard_normal((modes, points, 3)), bbox_3d


def random_camera(rng: np.random.Generator) -> RefCamera:
    fx = rng.uniform(600.0, 1600.0)
    return RefCamera(fx, fx * rng.uniform(0.95, 1.05), rng.uniform(800.0, 1100.0), rng.uniform(450.0, 620.0))


def random_scene(
    rng: np.random.Generator,
    model: tuple[Array, Array, Array] | None = None,
    pitch_deg: tuple[float, float] = (-40.0, 10.0),
    roll_deg: tuple[float, float] = (-5.0, 5.0),
    distance: tuple[float, float] = (5.0, 60.0),
    noise: float = 0.0,
    outliers: int = 0,
    shape_sigma: float = 0.0,
) -> Scene:
    """An upright object at `distance` along a random pixel's ray, wholly in front; drawn again until it is
    so.

    The first points of a random permutation are outliers, uniform in the 2D box.
    """
    mean, basis, bbox_3d = model if model is not None else car_model(rng, 20, 0)
    corners = box_corners(bbox_3d)
    while True:
        camera = random_camera(rng)
        view = RefView(camera, np.radians(rng.uniform(*pitch_deg)), np.radians(rng.uniform(*roll_deg)))
        pixel = rng.uniform([0.05, 0.1], [0.95, 0.9], (1, 2)) * 2.0 * np.array([camera.cx, camera.cy])
        ray = rays_ground(view, pixel)[0]
        yaw = rng.uniform(-np.pi, np.pi)
        R, t = upright_pose(view, yaw, rng.uniform(*distance) * ray / np.linalg.norm(ray))
        shape = shape_sigma * rng.standard_normal(len(basis))
        points = mean + np.einsum("m,mpk->pk", shape, basis)
        if (corners @ R.T + t)[:, 2].min() > 0.5 and (points @ R.T + t)[:, 2].min() > 0.5:
            break
    bbox = np.array(box_columns(view, R, t, corners))
    pixels = project(camera, points @ R.T + t) + noise * rng.standard_normal((len(points), 2))
    inliers = np.ones(len(points), dtype=bool)
    inliers[rng.permutation(len(points))[:outliers]] = False
    pixels[~inliers] = rng.uniform(bbox[:2], bbox[2:], (outliers, 2))
    return Scene(view, mean, bbox_3d, bbox, pixels, inliers, R, t, yaw, shape)
