"""Boxes (4,) left, top, right, bottom of the virtual drive that hold no vehicle.

A box holds none when every vehicle of the scene, labelled or not, hidden or not, covers at most
`MOST_COVERED` of it. Pieces of vehicles are nothing too: a box within one vehicle that is at most
`LARGEST_PIECE` of the vehicle's box, if the crop of a network shows at most `MOST_SHOWN` of the vehicle
around it (a crop is wider than a narrow box). Vehicles used for training show at least 0.4 of their box
(`rendered.MOST_CUT`). Boxes between the two are in neither set, because either answer would be right.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from groundpose._checks import FloatArray
from groundpose.keypoints.codec import Codec
from groundpose.lab.drive import Scene
from groundpose.lab.drive.silhouette import NEAR
from groundpose.lab.drive.solids import prop_corners
from groundpose.lab.drive.visibility import clipped, look

MOST_COVERED = 0.03
LARGEST_PIECE, SMALLEST_PIECE, MOST_SHOWN = 0.18, 0.03, 0.28
LEAST_HEIGHT, MOST_HEIGHT = 18.0, 400.0
LEAST_ASPECT, MOST_ASPECT = 0.5, 3.0
_TRIES = 30
_CROP = Codec(128, 96)


@dataclasses.dataclass(frozen=True, eq=False)
class Place:
    """A box and the scene to draw it from."""

    box: FloatArray
    scene: Scene


@dataclasses.dataclass(frozen=True, eq=False)
class View:
    """A scene with the boxes (V, 4) of all its vehicles in the image and their rows (V,) in the scene."""

    scene: Scene
    vehicles: FloatArray
    rows: tuple[int, ...]

    @classmethod
    def of(cls, scene: Scene) -> View:
        """Project every vehicle, also hidden ones and those too small for a label of their own."""
        sights = [s for i, v in enumerate(scene.vehicles) if (s := look(scene, i, v)) is not None]
        boxes = [clipped(scene.camera, s.box) for s in sights]
        return cls(scene, np.array(boxes).reshape(-1, 4), tuple(s.row for s in sights))

    @property
    def size(self) -> FloatArray:
        """Width, height of the image."""
        assert self.scene.camera.image_size is not None
        return np.array(self.scene.camera.image_size, dtype=float)


Choose = Callable[[np.random.Generator, View], Place | None]


def covered(box: FloatArray, others: FloatArray) -> FloatArray:
    """Fraction of a box (4,) that each of the boxes (N, 4) covers."""
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    return np.asarray(np.maximum(high - low, 0.0).prod(axis=1) / (box[2:] - box[:2]).prod())


def inside(box: FloatArray, size: FloatArray) -> FloatArray | None:
    """The part of a box in an image of this size; None when it is too small for a box of a detector's."""
    cut = np.clip(box, 0.0, np.tile(size - 1.0, 2))
    width, height = cut[2:] - cut[:2]
    if not LEAST_HEIGHT <= height <= MOST_HEIGHT or not LEAST_ASPECT <= width / height <= MOST_ASPECT:
        return None
    return np.asarray(cut)


def detector_box(rng: np.random.Generator, centre: FloatArray, height: float | None = None) -> FloatArray:
    """A box of a detector's shapes; heights are as frequent in every octave."""
    if height is None:
        height = float(np.exp(rng.uniform(np.log(LEAST_HEIGHT), np.log(MOST_HEIGHT))))
    aspect = np.exp(rng.uniform(np.log(LEAST_ASPECT), np.log(MOST_ASPECT)))
    half = 0.5 * height * np.array([aspect, 1.0])
    return np.concatenate([centre - half, centre + half])


def anywhere(rng: np.random.Generator, view: View) -> Place | None:
    """Road, sky, houses, trees: whatever is there."""
    return _free(view, lambda: detector_box(rng, rng.random(2) * view.size))


def on_the_road(rng: np.random.Generator, view: View) -> Place | None:
    """As high as a vehicle would be there, standing on the ground beside or between the vehicles."""
    camera, scene = view.scene.camera, view.scene

    def draw() -> FloatArray | None:
        depth = np.exp(rng.uniform(np.log(5.0), np.log(80.0)))
        metres = rng.uniform(1.2, 3.0)
        u = rng.random() * view.size[0]
        ray = camera.rays(np.array([[u, camera.cy]]))[0]
        ground = ray / ray[2] * depth + scene.R_camera_from_world @ [0.0, scene.height, 0.0]
        if ground[2] < NEAR:
            return None
        foot = camera.project(ground[None])[0]
        height = camera.fy * metres / depth
        return detector_box(rng, foot - [0.0, 0.5 * height], float(height))

    return _free(view, draw)


def around_thing(rng: np.random.Generator, view: View) -> Place | None:
    """Around a person, a cyclist, a tree, a sign, a bin ...; every kind in view is as likely."""
    boxes, kinds = _things(view)
    if not kinds:
        return None
    names = sorted(set(kinds))

    def draw() -> FloatArray | None:
        name = names[int(rng.integers(len(names)))]
        box = boxes[int(rng.choice(np.flatnonzero(np.array(kinds) == name)))]
        centre, half = 0.5 * (box[:2] + box[2:]), 0.5 * (box[2:] - box[:2])
        # a detector's box is never too narrow, and of a wall it finds a piece
        height = min(2 * half[1], MOST_HEIGHT) * rng.uniform(0.8, 1.3)
        width = np.clip(2 * half[0] * rng.uniform(0.9, 1.2), 1.02 * LEAST_ASPECT * height, 2.9 * height)
        room = np.maximum(half - 0.5 * np.array([width, height]), 0.1 * half)
        middle, sides = centre + rng.uniform(-1.0, 1.0, 2) * room, 0.5 * np.array([width, height])
        return np.concatenate([middle - sides, middle + sides])

    return _free(view, draw)


def _things(view: View) -> tuple[FloatArray, list[str]]:
    """Boxes (N, 4) of the things beside the road that the image shows, and their kinds."""
    scene = view.scene
    if not scene.props:
        return np.empty((0, 4)), []
    corners = prop_corners(scene.props) @ scene.R_camera_from_world.T + scene.t_camera_from_world
    pixels = scene.camera.project(corners)
    boxes = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1)
    shown = (corners[..., 2].min(axis=1) >= NEAR) & (boxes[:, 3] - boxes[:, 1] >= LEAST_HEIGHT)
    shown &= ((boxes[:, 2:] > 0.0) & (boxes[:, :2] < view.size - 1.0)).all(axis=1)
    rows = np.flatnonzero(shown).tolist()
    return boxes[rows], [scene.props[i].kind for i in rows]


def piece(rng: np.random.Generator, view: View) -> Place | None:
    """A wheel, a door, a corner of the bonnet: a small box within one vehicle and on no other."""
    sides = view.vehicles[:, 2:] - view.vehicles[:, :2]
    large = np.flatnonzero(sides.min(axis=1, initial=np.inf) * np.sqrt(LARGEST_PIECE) >= LEAST_HEIGHT)
    if not len(large):
        return None

    for _ in range(_TRIES):
        row = int(rng.choice(large))
        box = _piece_of(rng, view.vehicles[row])
        cut = None if box is None else inside(box, view.size)
        if cut is not None and (covered(cut, np.delete(view.vehicles, row, axis=0)) <= MOST_COVERED).all():
            return Place(cut, view.scene)
    return None


def _piece_of(rng: np.random.Generator, vehicle: FloatArray) -> FloatArray | None:
    """A box anywhere in the box (4,) of a vehicle; None when it or its crop shows too much."""
    sides = vehicle[2:] - vehicle[:2]
    area = rng.uniform(SMALLEST_PIECE, LARGEST_PIECE) * sides.prod()
    aspect = np.exp(rng.uniform(np.log(LEAST_ASPECT), np.log(MOST_ASPECT)))
    half = 0.5 * np.sqrt(area * np.array([aspect, 1.0 / aspect]))
    room = 0.5 * sides - half
    if (room < 0.0).any():
        return None
    centre = 0.5 * (vehicle[:2] + vehicle[2:]) + rng.uniform(-1.0, 1.0, 2) * room
    box = np.concatenate([centre - half, centre + half])
    shown = covered(vehicle, _CROP.windows(box[None]))[0]
    return box if shown <= MOST_SHOWN else None


def emptied(rng: np.random.Generator, view: View) -> Place | None:
    """A vehicle's own box, drawn without this vehicle and all others in the box: an empty place between
    neighbours."""
    usable = [b for b in view.vehicles if inside(b, view.size) is not None]
    if not usable:
        return None
    box = usable[int(rng.integers(len(usable)))]
    there = covered(box, view.vehicles) > MOST_COVERED
    gone = {row for row, meets in zip(view.rows, there, strict=True) if meets}
    kept = tuple(v for i, v in enumerate(view.scene.vehicles) if i not in gone)
    return Place(box, dataclasses.replace(view.scene, vehicles=kept))


def _free(view: View, draw: Callable[[], FloatArray | None]) -> Place | None:
    """The first of some boxes that holds no vehicle."""
    for _ in range(_TRIES):
        box = draw()
        cut = None if box is None else inside(box, view.size)
        if cut is not None and (covered(cut, view.vehicles) <= MOST_COVERED).all():
            return Place(cut, view.scene)
    return None
