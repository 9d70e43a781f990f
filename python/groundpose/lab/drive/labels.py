"""Labels of a scene, computed without drawing it: boxes, truncation, occlusion, keypoints, visibility."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.drive.scene import Scene
from groundpose.lab.drive.silhouette import NEAR, Region, below, inside
from groundpose.lab.drive.visibility import Order, Sight, Target, clipped, look, things
from groundpose.types import View

OUTSIDE, HIDDEN, VISIBLE = 0, 1, 2
"""States of a keypoint: outside the image, hidden by its own body or by something else, visible."""

# Hidden fractions from which KITTI's occlusion level is 1, 2, 3; from the last one on there is no label.
_LEVELS = (0.1, 0.5, 0.9)
_NO_LABEL = 0.98

# A surface at most this far in front of a keypoint counts as its own surface, metres.
_SKIN = 0.03
# A point behind bars that cover less than this fraction is visible.
_BARS = 0.5
# Number of points on the road sampled between camera and vehicle.
_GROUND_SAMPLES = 24


@dataclass(frozen=True, eq=False)
class Label:
    """The labels of one vehicle in one image.

    Args:
        index: of the vehicle in `Scene.vehicles`.
        class_name, style, seed, state: of the vehicle and its body.
        bbox: (4,) left, top, right, bottom of the mesh in the image, cut at its border.
        bbox_full: (4,) the same, not cut at the border (but at the near plane 0.3 m before the camera).
        truncation: fraction of `bbox_full` outside the image.
        occluded_share: fraction of the outline in the image that other vehicles, things and the road hide.
        occlusion: KITTI's level of it: 0 below 0.1, 1 below 0.5, 2 below 0.9, 3 above.
        R, t: pose, camera_from_object.
        size: length, height, width of the body, metres; bbox_3d: (2, 3) its box in the object frame.
        keypoints_3d: (P, 3) object frame; keypoints_2d: (P, 2) pixels, NaN behind the camera.
        keypoint_states: (P,) OUTSIDE, HIDDEN or VISIBLE.
        plane_pitch, plane_roll: tilt of the camera against the plane of the road under this vehicle.
        rotation_y, alpha: KITTI's angles; location: (3,) KITTI's, the middle of the 3D box's bottom.
    """

    index: int
    class_name: str
    style: str
    seed: int
    state: str
    bbox: FloatArray
    bbox_full: FloatArray
    truncation: float
    occluded_share: float
    occlusion: int
    R: FloatArray
    t: FloatArray
    size: tuple[float, float, float]
    bbox_3d: FloatArray
    keypoints_3d: FloatArray
    keypoints_2d: FloatArray
    keypoint_states: NDArray[np.uint8]
    plane_pitch: float
    plane_roll: float
    rotation_y: float
    alpha: float
    location: FloatArray


def labels(scene: Scene) -> list[Label]:
    """Labels of the vehicles large and visible enough to find, in the order of `scene.vehicles`."""
    seen = [sight for i, v in enumerate(scene.vehicles) if (sight := look(scene, i, v)) is not None]
    if not seen:
        return []
    hiders = seen + things(scene, seen)
    order = Order(scene, hiders)
    rows = _road_rows(scene, seen)
    found = [
        _label(scene, sight, [h for h in hiders if order.before(h, sight)], row)
        for sight, row in zip(seen, rows, strict=True)
    ]
    return [label for label in found if label is not None]


def _label(scene: Scene, sight: Sight, hiders: list[Sight], road_row: float) -> Label | None:
    """The labels of one vehicle; None when it is hidden almost completely."""
    target = sight.target
    assert target is not None
    fraction = _hidden_fraction(scene, sight, hiders, road_row)
    if fraction >= _NO_LABEL:
        return None
    body, vehicle, R, t = target.solid.body, target.vehicle, target.R, target.t
    points = body.keypoints_3d @ R.T + t
    pixels = np.full((len(points), 2), np.nan)
    front = points[:, 2] >= NEAR
    pixels[front] = scene.camera.project(points[front])
    low, high = body.bbox_3d
    location = R @ [0.5 * (low[0] + high[0]), high[1], 0.5 * (low[2] + high[2])] + t
    plane = View.from_gravity(scene.camera, R[:, 1])
    rotation_y = math.atan2(R[0, 2], R[2, 2]) - 0.5 * math.pi
    bbox = clipped(scene.camera, sight.box)
    return Label(
        index=sight.row,
        class_name=vehicle.class_name,
        style=body.style,
        seed=vehicle.seed,
        state=vehicle.state,
        bbox=bbox,
        bbox_full=sight.box,
        truncation=1.0 - _area(bbox) / _area(sight.box),
        occluded_share=fraction,
        occlusion=int(np.searchsorted(_LEVELS, fraction, side="right")),
        R=R,
        t=t,
        size=body.size,
        bbox_3d=body.bbox_3d,
        keypoints_3d=body.keypoints_3d,
        keypoints_2d=pixels,
        keypoint_states=_states(scene, target, pixels, points[:, 2], hiders, road_row),
        plane_pitch=plane.pitch,
        plane_roll=plane.roll,
        rotation_y=_wrapped(rotation_y),
        alpha=_wrapped(rotation_y - math.atan2(location[0], location[2])),
        location=location,
    )


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _area(box: FloatArray) -> float:
    return float((box[2] - box[0]) * (box[3] - box[1]))


def _hidden_fraction(scene: Scene, sight: Sight, hiders: list[Sight], road_row: float) -> float:
    """Fraction of the outline inside the image that nearer solids and the road cover."""
    if not hiders and road_row >= below(scene.mount.roll, sight.box[[0, 2]], sight.box[3]).max():
        return 0.0
    region = Region.around(clipped(scene.camera, sight.box))
    own = region.mask(sight.polygons)
    total = np.count_nonzero(own)
    if total == 0:
        return 0.0
    clear = own & ~region.below(road_row, scene.mount.roll)
    whole = [hider.polygons for hider in hiders if hider.cover == 1.0]
    if whole:
        clear &= ~region.mask(np.concatenate(whole))
    open_ = clear.astype(float)
    for hider in hiders:
        if hider.cover < 1.0:
            open_ *= 1.0 - hider.cover * region.mask(hider.polygons)
    return float(1.0 - open_.sum() / total)


def _road_rows(scene: Scene, seen: list[Sight]) -> FloatArray:
    """Image row (N,) below which a crest of the road hides each vehicle, in an image turned level by the
    nominal roll, see `silhouette.below`."""
    position = scene.camera_position
    ends = np.array([scene.vehicles[sight.row].t_world for sight in seen])
    away = np.linalg.norm((ends - position)[:, [0, 2]], axis=1)
    # the ground under the vehicle itself hides nothing
    lengths = np.array([sight.length for sight in seen])
    reach = np.clip(1.0 - (0.5 * lengths + 1.0) / np.maximum(away, 1e-6), 0.0, 1.0)
    fraction = np.linspace(0.1, 1.0, _GROUND_SAMPLES) * reach[:, None]
    x = position[0] + fraction * (ends[:, None, 0] - position[0])
    z = position[2] + fraction * (ends[:, None, 2] - position[2])
    y, _ = scene.road.surface(x.ravel(), z.ravel())
    world = np.stack([x.ravel(), y, z.ravel()], axis=1)
    camera = world @ scene.R_camera_from_world.T + scene.t_camera_from_world
    rows = np.full(len(world), np.inf)
    front = camera[:, 2] >= NEAR
    rows[front] = below(scene.mount.roll, *scene.camera.project(camera[front]).T)
    # a vehicle under the camera has no ground before it
    rows[np.repeat(reach == 0.0, _GROUND_SAMPLES)] = np.inf
    return np.asarray(rows.reshape(len(seen), -1).min(axis=1))


def _states(
    scene: Scene, target: Target, pixels: FloatArray, depth: FloatArray, hiders: list[Sight], road_row: float
) -> NDArray[np.uint8]:
    """(P,) OUTSIDE, HIDDEN or VISIBLE."""
    assert scene.camera.image_size is not None
    width, height = scene.camera.image_size
    with np.errstate(invalid="ignore"):
        within = ((pixels >= -0.5) & (pixels < [width - 0.5, height - 0.5])).all(axis=1)
    states = np.where(within, VISIBLE, OUTSIDE).astype(np.uint8)
    rows = np.flatnonzero(within)
    hidden = own_body_hides(target, pixels[rows], depth[rows]) | (
        below(scene.mount.roll, *pixels[rows].T) > road_row
    )
    for hider in hiders:
        if hider.cover < _BARS:
            continue
        near = np.flatnonzero(((pixels[rows] >= hider.box[:2]) & (pixels[rows] <= hider.box[2:])).all(axis=1))
        hidden[near] |= inside(hider.polygons, pixels[rows[near]])
    states[rows[hidden]] = HIDDEN
    return states


def own_body_hides(target: Target, pixels: FloatArray, depth: FloatArray) -> NDArray[np.bool_]:
    """(N,) whether the vehicle's own surface lies before points at pixels (N, 2) and depths (N,).

    Exact: the ray of each pixel is intersected with the faces turned to the camera, in the image, where the
    inverse depth is linear over a face. Glass hides like paint.
    """
    if len(pixels) == 0:
        return np.zeros(0, dtype=bool)
    faces, (left, top, right, bottom) = target.front_faces
    # one coordinate at a time: few faces remain after the first two comparisons
    between = (left <= pixels[:, :1]) & (right >= pixels[:, :1])
    point, face = np.divmod(np.flatnonzero(between), len(faces))  # faster than nonzero of two axes
    kept = (top[face] <= pixels[point, 1]) & (bottom[face] >= pixels[point, 1])
    point, face = point[kept], face[kept]
    a, b, c = (target.pixels[faces[face, i]] - pixels[point] for i in range(3))
    areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1)
    total = areas.sum(axis=1)
    hit = ((areas * np.sign(total)[:, None]) >= 0.0).all(axis=1) & (total != 0.0)
    point, areas, total, face = point[hit], areas[hit], total[hit], face[hit]
    inverse = np.sum(areas / target.depth[faces[face]], axis=1) / total
    hidden = np.zeros(len(pixels), dtype=bool)
    hidden[point[1.0 / inverse < depth[point] - _SKIN]] = True
    return hidden


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
