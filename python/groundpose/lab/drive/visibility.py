"""The view of each solid of a scene from the camera, and which solids are in front of which."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.drive.footprints import Footprints
from groundpose.lab.drive.scene import Scene, Vehicle
from groundpose.lab.drive.silhouette import NEAR, outline
from groundpose.lab.drive.solids import Solid, cover, prop_corners, prop_slabs, solid
from groundpose.types import Camera

# Smallest side of a labelled box in the image, pixels.
_LEAST_PX = 6.0


@dataclass(frozen=True, eq=False)
class Sight:
    """A solid seen from the camera: `row` among vehicles and things, box (4,) not cut at the image border,
    outline, footprint `(origin, heading, box)`; `target` is None for things beside the road;
    cover: fraction of the outline that hides what is behind it, below 1 for bars and wires."""

    row: int
    box: FloatArray
    polygons: FloatArray
    footprint: tuple[FloatArray, float, FloatArray]
    target: Target | None = None
    cover: float = 1.0

    @property
    def length(self) -> float:
        """Length of the footprint's longer side, metres."""
        return float((self.footprint[2][1] - self.footprint[2][0]).max())


@dataclass(frozen=True, eq=False)
class Target:
    """A vehicle to be labelled: its mesh in the image, (V, 2) pixels and (V,) depth."""

    vehicle: Vehicle
    solid: Solid
    R: FloatArray
    t: FloatArray
    pixels: FloatArray
    depth: FloatArray

    @cached_property
    def front_faces(self) -> tuple[NDArray[np.intp], FloatArray]:
        """The faces (F, 3) turned to the camera and their boxes (4, F) in the image."""
        faces = self.solid.facing(-self.R.T @ self.t)
        if self.depth.min() < NEAR:
            faces = faces[(self.depth[faces] >= NEAR).all(axis=1)]
        (u0, u1, u2), (v0, v1, v2) = (np.ascontiguousarray(self.pixels[:, i])[faces.T] for i in range(2))
        left, top = (np.minimum(np.minimum(a, b), c) for a, b, c in ((u0, u1, u2), (v0, v1, v2)))
        right, bottom = (np.maximum(np.maximum(a, b), c) for a, b, c in ((u0, u1, u2), (v0, v1, v2)))
        return faces, np.stack([left, top, right, bottom])


def look(scene: Scene, index: int, vehicle: Vehicle) -> Sight | None:
    """Project a vehicle; None when nothing of it is in the image."""
    known = solid(vehicle.class_name, vehicle.seed)
    R, t = scene.camera_from_object(vehicle)
    if _beside(scene.camera, known.corners @ R.T + t):
        return None
    points = known.vertices @ R.T + t
    box = _extent(scene.camera, points, known.faces)
    if box is None or not meets_image(scene.camera, box):
        return None
    pixels = scene.camera.project(points)
    heading = math.atan2(vehicle.R_world[0, 2], vehicle.R_world[2, 2])
    return Sight(
        row=index,
        box=box,
        polygons=outline(scene.camera, known.slabs @ R.T + t),
        footprint=(vehicle.t_world[[0, 2]], heading, known.body.bbox_3d[:, [0, 2]]),
        target=Target(vehicle, known, R, t, pixels, points[:, 2]),
    )


def _beside(camera: Camera, corners: FloatArray) -> bool:
    """Whether a solid with these corners (8, 3) cannot be in the image."""
    if corners[:, 2].min() < NEAR:
        return bool(corners[:, 2].max() < NEAR)
    return not meets_image(camera, _around(camera.project(corners)))


def _extent(camera: Camera, points: FloatArray, faces: NDArray[np.intp]) -> FloatArray | None:
    """Box (4,) of a mesh, cut at the near plane; None when all of it is behind."""
    front = points[:, 2] >= NEAR
    if not front.any():
        return None
    if not front.all():
        edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        crossing = edges[front[edges[:, 0]] != front[edges[:, 1]]]
        a, b = points[crossing[:, 0]], points[crossing[:, 1]]
        fraction = (NEAR - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
        points = np.concatenate([points[front], a + fraction * (b - a)])
    return _around(camera.project(points))


def _around(pixels: FloatArray) -> FloatArray:
    """Box (4,) of pixels (N, 2); columns in one piece are compared much faster than rows of two."""
    columns = np.ascontiguousarray(pixels.T)
    return np.concatenate([columns.min(axis=1), columns.max(axis=1)])


def meets_image(camera: Camera, box: FloatArray) -> bool:
    """Whether enough of a box is in the image to be labelled."""
    cut = clipped(camera, box)
    return bool(min(cut[2] - cut[0], cut[3] - cut[1]) >= _LEAST_PX)


def clipped(camera: Camera, box: FloatArray) -> FloatArray:
    """The part of a box (4,) inside the image."""
    assert camera.image_size is not None
    width, height = camera.image_size
    return np.clip(box, 0.0, [width - 1.0, height - 1.0, width - 1.0, height - 1.0])


def things(scene: Scene, seen: list[Sight]) -> list[Sight]:
    """The things beside the road that may hide a vehicle."""
    if not scene.props:
        return []
    R, t = scene.R_camera_from_world, scene.t_camera_from_world
    corners = prop_corners(scene.props) @ R.T + t
    depth = corners[..., 2]
    pixels = scene.camera.project(corners)
    low, high = pixels.min(axis=1), pixels.max(axis=1)
    cut = depth.min(axis=1) < NEAR  # its box cannot be projected directly
    low[cut], high[cut] = -np.inf, np.inf
    boxes = np.array([clipped(scene.camera, sight.box) for sight in seen])
    farthest = np.array([sight.target.depth.max() for sight in seen if sight.target is not None])
    meets = ((low[:, None] < boxes[:, 2:]) & (high[:, None] > boxes[:, :2])).all(axis=2)
    meets &= (depth.min(axis=1)[:, None] < farthest) & (depth.max(axis=1)[:, None] > NEAR)
    found = []
    for row in np.flatnonzero(meets.any(axis=1)).tolist():
        prop = scene.props[row]
        polygons = outline(scene.camera, prop_slabs(prop) @ R.T + t)
        if len(polygons):
            box = np.concatenate([polygons.min(axis=(0, 1)), polygons.max(axis=(0, 1))])
            half = 0.5 * np.array([prop.size[0], prop.size[2]])
            footprint = (prop.position[[0, 2]], prop.yaw, np.stack([-half, half]))
            found.append(Sight(len(scene.vehicles) + row, box, polygons, footprint, cover=cover(prop)))
    return found


class Order:
    """Which of two solids is in front of the other: their footprints do not overlap, so a ray from the camera
    through their common part in the image enters one of them first."""

    def __init__(self, scene: Scene, views: list[Sight]) -> None:
        """Compare every vehicle of `views` with all."""
        self.scene = scene
        self.footprints = Footprints.of(
            np.array([v.footprint[0] for v in views]),
            np.array([v.footprint[1] for v in views]),
            np.array([v.footprint[2] for v in views]),
        )
        self.place = {view.row: i for i, view in enumerate(views)}
        self.boxes = np.array([clipped(scene.camera, v.box) for v in views])
        self.position = scene.camera_position[[0, 2]]
        self.nearer = {v.row: self._nearer_than(i) for i, v in enumerate(views) if v.target is not None}

    def before(self, a: Sight, b: Sight) -> bool:
        """Whether `a` may hide a part of `b`."""
        return bool(self.nearer[b.row][self.place[a.row]])

    def _nearer_than(self, i: int) -> NDArray[np.bool_]:
        boxes, own = self.boxes, self.boxes[i]
        meets: NDArray[np.bool_] = np.all((boxes[:, :2] < own[2:]) & (boxes[:, 2:] > own[:2]), axis=1)
        meets[i] = False
        rows = np.flatnonzero(meets)
        if not len(rows):
            return meets
        common = 0.5 * (np.maximum(boxes[rows, :2], own[:2]) + np.minimum(boxes[rows, 2:], own[2:]))
        camera, mount = self.scene.camera, self.scene.mount
        if not mount.tilted:  # all rows of a column lie in about one vertical plane
            common[:, 1] = camera.cy
        level = (camera.rays(common) @ self.scene.R_camera_from_world)[:, [0, 2]]
        level /= np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
        own_reach, reached = self._entry(np.full(len(rows), i), level), self._entry(rows, level)
        meets[rows] = reached < own_reach
        return meets

    def _entry(self, rows: NDArray[np.intp], directions: FloatArray) -> FloatArray:
        """Distance at which ray n enters footprint rows[n]. A ray that misses it (mirrors extend beyond) gets
        the distance of its middle."""
        reached = self.footprints[rows].entry(self.position, directions)
        away = np.linalg.norm(self.footprints.middle[rows] - self.position, axis=1)
        return np.where(np.isfinite(reached), reached, away)
