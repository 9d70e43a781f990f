"""The part of the image plane that is drawn, and tests of what is visible in it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose.lab.drive.scene import Scene

Floats = NDArray[np.float64]

NEAR, FAR = 0.4, 900.0


@dataclass(frozen=True, eq=False)
class Window:
    """A rectangle of the image plane: edges in pixels of the frame (a pixel reaches half a pixel around its
    integer centre) and the size it is drawn at."""

    left: float
    top: float
    right: float
    bottom: float
    width: int
    height: int

    @classmethod
    def whole(cls, scene: Scene) -> Window:
        """The window of the whole frame."""
        size = scene.camera.image_size
        assert size is not None
        return cls(-0.5, -0.5, size[0] - 0.5, size[1] - 0.5, *size)


def clip_from_camera(scene: Scene, window: Window) -> Floats:
    """(4, 4) off-centre projection; rows of the window from top to bottom are rows of the target from 0."""
    c, wide, high = scene.camera, window.right - window.left, window.bottom - window.top
    depth = (FAR + NEAR) / (FAR - NEAR), -2.0 * FAR * NEAR / (FAR - NEAR)
    return np.array([
        [2 * c.fx / wide, 0, (2 * c.cx - window.left - window.right) / wide, 0],
        [0, 2 * c.fy / high, (2 * c.cy - window.top - window.bottom) / high, 0],
        [0, 0, depth[0], depth[1]],
        [0, 0, 1, 0],
    ])  # fmt: skip


def camera_from_world(scene: Scene) -> Floats:
    """(4, 4)."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = scene.R_camera_from_world, scene.t_camera_from_world
    return out


def ray_from_clip(scene: Scene, window: Window) -> Floats:
    """(3, 3): `(x, y, 1)` of clip space to a direction in the world."""
    inverse = np.linalg.inv(clip_from_camera(scene, window)[[0, 1, 3], :3])
    return np.asarray(scene.R_camera_from_world.T @ inverse)


def box_corners(boxes: Floats) -> Floats:
    """Corners (N, 8, 3) of boxes (N, 2, 3) = `[min, max]`."""
    choice = np.array(list(itertools.product((0, 1), repeat=3)))
    return np.asarray(boxes[:, choice, np.arange(3)])


def in_view(clip: Floats, corners: Floats) -> NDArray[np.bool_]:
    """Which boxes (N, 8, 3) may reach into the frustum of `clip` = clip_from_world (4, 4)."""
    points = corners @ clip[:, :3].T + clip[:, 3]
    w = points[..., 3:]
    outside = np.concatenate([points[..., :3] < -w, points[..., :2] > w], axis=-1)
    return np.asarray(np.logical_not(np.any(np.all(outside, axis=1), axis=1)))


def sun_frame(sun: Floats, centre: Floats, radius: float, depth: float) -> Floats:
    """(4, 4) texture coordinates 0 to 1 from the world: a box around `centre`, seen from the sun."""
    side = np.cross(sun, [0.0, 0.0, 1.0] if abs(sun[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    axes = np.stack([side / (2 * radius), np.cross(sun, side) / (2 * radius), -sun / (2 * depth)])
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = axes, 0.5 - axes @ centre
    return out
