"""One image with known poses, made by numpy alone, for the tests of the Python side."""

import itertools
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import groundpose as gp
import numpy as np
import pytest

# The real data that some tests want: where GROUNDPOSE_DATA says, else beside the checkout.
os.environ.setdefault("GROUNDPOSE_DATA", str(Path(__file__).parents[3] / "shared" / "data"))

CAMERA = gp.Camera(1000.0, 990.0, 640.0, 360.0, image_size=(1280, 720))
VIEW = gp.View(CAMERA, pitch=-0.02, roll=0.01)

# One side of a sedan: forward (share of the length), up (share of the height), out (share of half the width).
_SEDAN = (
    *((0.49, 0.20, 0.90), (0.46, 0.50, 0.92), (0.20, 0.66, 0.90), (0.04, 0.99, 0.68)),
    *((-0.22, 1.00, 0.68), (-0.38, 0.71, 0.86), (-0.48, 0.67, 0.90), (-0.50, 0.22, 0.92)),
    *((0.29, 0.21, 1.00), (-0.29, 0.21, 1.00), (0.14, 0.70, 1.00), (-0.08, 0.68, 0.97)),
)


def sedan(length: float, height: float, width: float) -> gp.ShapeModel:
    """A rigid model with 24 keypoints; its origin is on the ground below its middle."""
    forward, up, out = np.array(_SEDAN).T
    right = np.stack([0.5 * width * out, -height * up, length * forward], axis=1)
    box = [[-0.5 * width, -height, -0.5 * length], [0.5 * width, 0.0, 0.5 * length]]
    return gp.ShapeModel(np.concatenate([right * (-1.0, 1.0, 1.0), right]), box, name="car")


MODEL = sedan(4.5, 1.5, 1.8)


@dataclass(frozen=True)
class Batch:
    """Arguments of `estimate_poses` and the truth."""

    view: gp.View
    keypoints_2d: np.ndarray
    bboxes: np.ndarray
    models: Any
    R: np.ndarray
    t: np.ndarray
    inlier: np.ndarray

    def estimate(self, scores: Any = None, threads: int | None = 1, **options: Any) -> gp.PoseBatch:
        options_ = gp.Options(**options)
        return gp.estimate_poses(
            self.view, self.keypoints_2d, self.bboxes, self.models, scores, options_, threads
        )


def rotation_y(yaw: np.ndarray) -> np.ndarray:
    c, s, zero, one = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw), np.ones_like(yaw)
    return np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=-1).reshape(*yaw.shape, 3, 3)


def project(view: gp.View, R: np.ndarray, t: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Pixels (..., P, 2) by the definition of the pose, without the library."""
    camera = view.camera
    x = points @ np.swapaxes(R, -1, -2) + t[..., None, :]
    return np.stack(
        [camera.fx * x[..., 0] / x[..., 2] + camera.cx, camera.fy * x[..., 1] / x[..., 2] + camera.cy],
        axis=-1,
    )


def make_batch(
    n: int = 30,
    seed: int = 0,
    outliers: float = 0.3,
    noise: float = 0.01,
    view: gp.View = VIEW,
    model: gp.ShapeModel = MODEL,
    shape: np.ndarray | None = None,
    depth: tuple[float, float] = (8.0, 40.0),
) -> Batch:
    """N objects standing on the ground 1.5 m below the camera; noise is a share of the longer box side."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(*depth, n)
    ground = np.stack([z * rng.uniform(-0.35, 0.35, n), np.full(n, 1.5), z], axis=1)
    R = view.R_camera_from_ground @ rotation_y(rng.uniform(-np.pi, np.pi, n))
    t = ground @ view.R_camera_from_ground.T
    keypoints = np.broadcast_to(model.keypoints_3d, (n, *model.keypoints_3d.shape))
    if shape is not None:
        keypoints = keypoints + np.tensordot(shape, model.basis, axes=1)
    pixels = project(view, R, t, keypoints)
    corners = project(view, R, t, np.array(list(itertools.product(*model.bbox_3d.T))))
    boxes = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    side = np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1])[:, None, None]
    pixels = pixels + noise * side * rng.normal(size=pixels.shape)
    wrong = rng.random(pixels.shape[:2]) < outliers
    anywhere = boxes[:, None, :2] + rng.random(pixels.shape) * (boxes[:, None, 2:] - boxes[:, None, :2])
    pixels[wrong] = anywhere[wrong]
    return Batch(view, pixels, boxes, model, R, t, ~wrong)


def rotation_error_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(0.5 * (np.einsum("nij,nij->n", a, b) - 1.0), -1.0, 1.0)))


_NOT_BY_OBJECT = {"view", "nominal_view", "nominal_tilt_sigma", "tilt_covariance", "error_dof"}
_GIVEN = {"keypoints_2d", "bboxes", "models", "scale_covariance"}
# Result arrays of a batch, for comparisons bit for bit.
ARRAYS = tuple(name for name in gp.PoseBatch.__dataclass_fields__ if name not in _NOT_BY_OBJECT | _GIVEN)


def assert_same(a: gp.PoseBatch, b: gp.PoseBatch) -> None:
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@pytest.fixture(scope="session")
def batch() -> Batch:
    return make_batch()


@pytest.fixture(scope="session")
def poses(batch: Batch) -> gp.PoseBatch:
    return batch.estimate()


def as_json(array: np.ndarray) -> Any:
    """Nested lists with None for NaN."""
    return np.where(np.isnan(array), None, np.asarray(array, dtype=object)).tolist()


def frame_of(batch: Batch, frame_id: Any = None, **more: Any) -> dict[str, Any]:
    """The JSON frame of a batch, truth included."""
    camera, view = batch.view.camera, batch.view
    model = {"keypoints_3d": batch.models.keypoints_3d.tolist(), "bbox_3d": batch.models.bbox_3d.tolist()}
    truth = [{"R": R.tolist(), "t": t.tolist()} for R, t in zip(batch.R, batch.t, strict=True)]
    rows = zip(batch.keypoints_2d, batch.bboxes, truth, strict=True)
    frame = {
        "camera": {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy", "image_size")},
        "pitch_deg": float(np.degrees(view.pitch)),
        "roll_deg": float(np.degrees(view.roll)),
        "models": {"car": model},
        "objects": [
            {"model": "car", "keypoints_2d": as_json(k), "bbox": as_json(b), "truth": t} for k, b, t in rows
        ],
    }
    return frame | ({} if frame_id is None else {"id": frame_id}) | more
