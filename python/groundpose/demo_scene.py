"""The street of `groundpose demo`: vehicles with known poses, what a detector would say of them, a picture.

Everything is made here with numpy from a seed; nothing of it is fitted to the estimator.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.shape import ShapeModel, extent
from groundpose.types import Camera, View

CAMERA = Camera(fx=1000.0, fy=1000.0, cx=639.5, cy=259.5, image_size=(1280, 600))
CAMERA_HEIGHT = 1.5

# The estimator is told a level camera; the real one is tilted by this (pitch, roll).
TRUE_TILT = (math.radians(0.9), math.radians(-0.7))

# One side of a body: forward (share of the length), up (share of the height), out (share of half the width).
_SEDAN = {
    "bumper_front": (0.49, 0.20, 0.90),
    "hood_front": (0.46, 0.50, 0.92),
    "windshield_base": (0.20, 0.66, 0.90),
    "roof_front": (0.04, 0.99, 0.68),
    "roof_rear": (-0.22, 1.00, 0.68),
    "rear_window_base": (-0.38, 0.71, 0.86),
    "tail": (-0.48, 0.67, 0.90),
    "bumper_rear": (-0.50, 0.22, 0.92),
    "wheel_front": (0.29, 0.21, 1.00),
    "wheel_rear": (-0.29, 0.21, 1.00),
    "mirror": (0.14, 0.70, 1.00),
    "door": (-0.08, 0.68, 0.97),
}
_VAN = {
    "bumper_front": (0.50, 0.16, 0.90),
    "hood_front": (0.47, 0.42, 0.92),
    "windshield_base": (0.37, 0.55, 0.92),
    "roof_front": (0.21, 0.97, 0.82),
    "roof_rear": (-0.46, 1.00, 0.82),
    "rear_window_base": (-0.49, 0.56, 0.92),
    "tail": (-0.495, 0.48, 0.94),
    "bumper_rear": (-0.50, 0.18, 0.94),
    "wheel_front": (0.31, 0.16, 1.00),
    "wheel_rear": (-0.30, 0.16, 1.00),
    "mirror": (0.31, 0.56, 1.00),
    "door": (0.05, 0.56, 0.97),
}
KEYPOINT_NAMES = tuple(f"{name}_{side}" for side in ("left", "right") for name in _SEDAN)

# Label, class, x and z on the ground (metres), yaw (degrees), paint. The last one gets no usable keypoints.
_TRAFFIC = (
    ("cut at edge", "car", 3.45, 7.4, 1.0, (176, 58, 46)),
    ("parked car", "car", 3.45, 15.5, -2.0, (222, 222, 218)),
    ("parked van", "van", 3.40, 26.0, 0.5, (238, 190, 84)),
    ("car ahead", "car", 0.20, 18.5, 1.5, (62, 92, 132)),
    ("oncoming car", "car", -3.60, 16.0, 181.0, (70, 124, 96)),
    ("oncoming van", "van", -3.50, 27.0, 179.0, (205, 212, 216)),
    ("turning car", "car", -2.30, 37.0, 115.0, (148, 72, 118)),
    ("far parked", "car", 3.30, 45.0, -1.0, (52, 54, 60)),
    ("points wrong", "car", -6.50, 14.5, 180.0, (120, 134, 150)),
)


@dataclass(frozen=True)
class Scene:
    """What the estimator is told (`view`, `keypoints_2d`, `bboxes`, `models`) and the truth."""

    view: View
    true_view: View
    labels: tuple[str, ...]
    keypoints_2d: FloatArray
    bboxes: FloatArray
    models: tuple[ShapeModel, ...]
    R: FloatArray
    t: FloatArray
    bodies: tuple[FloatArray, ...]
    paints: tuple[tuple[int, int, int], ...]


def body(kind: str, length: float, height: float, width: float, cabin: float = 0.0) -> FloatArray:
    """24 keypoints (24, 3), metres, of a sedan ("car") or van; origin on the ground below the middle.

    `cabin` moves the roof and windows forward, in shares of the length.
    """
    shares = np.array(list((_VAN if kind == "van" else _SEDAN).values()))
    shares[2:6, 0] += cabin
    right = np.stack([0.5 * width * shares[:, 2], -height * shares[:, 1], length * shares[:, 0]], axis=1)
    return np.concatenate([right * (-1.0, 1.0, 1.0), right])


def body_box(length: float, height: float, width: float) -> FloatArray:
    """3D box (2, 3), metres, of a body."""
    return np.array([[-0.5 * width, -height, -0.5 * length], [0.5 * width, 0.0, 0.5 * length]])


def shape_models(seed: int = 0) -> dict[str, ShapeModel]:
    """ "car" by principal components of forty procedural sedans, "van" as one rigid body."""
    rng = np.random.default_rng([seed, 1])
    dimensions = [_car_dimensions(rng) for _ in range(40)]
    boxes = np.stack([body_box(*d[:3]) for d in dimensions])
    sedans = np.stack([body("car", *d) for d in dimensions])
    car = ShapeModel.fit(sedans, 3, bbox_3d=boxes, keypoint_names=KEYPOINT_NAMES, name="car")
    van = ShapeModel(body("van", *_VAN_SIZE), body_box(*_VAN_SIZE), keypoint_names=KEYPOINT_NAMES, name="van")
    return {"car": car, "van": van}


_VAN_SIZE = (4.95, 1.95, 1.92)


def _car_dimensions(rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Length, height, width (metres) and shift of the cabin of a random sedan."""
    size = rng.normal((4.45, 1.48, 1.80), (0.20, 0.05, 0.05))
    return float(size[0]), float(size[1]), float(size[2]), float(rng.normal(0.0, 0.015))


def make_scene(seed: int = 0) -> Scene:
    """The street: 24 keypoints a vehicle with noise of 1 % of its box, 30 to 40 % of them wrong
    (anywhere in the box), two or three not seen; boxes with 1 px of noise, cut by the image."""
    rng = np.random.default_rng(seed)
    models = shape_models(seed)
    pitch, roll = TRUE_TILT
    true_view = View(CAMERA, pitch, roll, CAMERA_HEIGHT)
    R, t, keypoints, boxes, bodies = [], [], [], [], []
    for index, (_, kind, x, z, yaw_deg, _) in enumerate(_TRAFFIC):
        dimensions = _VAN_SIZE if kind == "van" else _car_dimensions(rng)
        yaw = math.radians(yaw_deg)
        c, s = math.cos(yaw), math.sin(yaw)
        R.append(true_view.R_camera_from_ground @ [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        t.append(true_view.R_camera_from_ground @ [x, CAMERA_HEIGHT, z])
        bodies.append(body(kind, *dimensions))
        corners = np.array(list(itertools.product(*body_box(*dimensions[:3]).T)))
        box = extent(true_view.project(corners @ R[-1].T + t[-1])).ravel() + rng.normal(0.0, 1.0, 4)
        boxes.append(np.clip(box, 0.0, [1279.0, 599.0, 1279.0, 599.0]))
        pixels = true_view.project(bodies[-1] @ R[-1].T + t[-1])
        hopeless = index == len(_TRAFFIC) - 1
        keypoints.append(_detected(rng, pixels, boxes[-1], 1.0 if hopeless else rng.uniform(0.3, 0.4)))
    return Scene(
        view=View(CAMERA, height=CAMERA_HEIGHT),
        true_view=true_view,
        labels=tuple(row[0] for row in _TRAFFIC),
        keypoints_2d=np.stack(keypoints),
        bboxes=np.stack(boxes),
        models=tuple(models[row[1]] for row in _TRAFFIC),
        R=np.stack(R),
        t=np.stack(t),
        bodies=tuple(bodies),
        paints=tuple(row[5] for row in _TRAFFIC),
    )


def _detected(rng: np.random.Generator, pixels: FloatArray, box: FloatArray, wrong: float) -> FloatArray:
    """Keypoints (P, 2) as a detector sees them: noise, wrong ones, NaN for those not seen."""
    side = max(box[2] - box[0], box[3] - box[1])
    noisy = pixels + rng.normal(0.0, 0.01 * side, pixels.shape)
    order = rng.permutation(len(pixels))
    count = round(wrong * len(pixels))
    noisy[order[:count]] = rng.uniform(box[:2], box[2:], (count, 2))
    noisy[order[count : count + rng.integers(2, 4)]] = np.nan
    outside = ~((noisy >= -0.5) & (noisy <= np.array(CAMERA.image_size) - 0.5)).all(axis=1)
    noisy[outside] = np.nan
    return noisy
