"""Row about exact data: one keypoint, the box and the tilt always contain the true pose."""

from __future__ import annotations

import numpy as np

import groundpose as gp
from groundpose import _core
from groundpose.lab.contenders.objects import Array
from groundpose.lab.evaluate.rows import Context, Result
from groundpose.lab.metrics import rotation_error_deg, translation_error_percent
from groundpose.lab.targets import TARGETS

PITCH_DEG = (-40.0, 10.0)
ROLL_DEG = (-5.0, 5.0)
DISTANCE_M = (5.0, 60.0)
CAR = np.array([[-0.9, -1.5, -2.25], [0.9, 0.0, 2.25]])
FOCAL, WIDTH, HEIGHT = 1000.0, 1914, 1080
SCENES_PER_TRIAL = 10
"""10,000 scenes with the 1000 trials of the other rows."""


def p1p_exact(context: Context) -> Result:
    """Random cars, tilts and keypoints without noise: rotation error of the best hypothesis of each scene."""
    count = SCENES_PER_TRIAL * context.trials
    best, solutions = np.full(count, np.inf), np.zeros(count, int)
    best_t = np.full(count, np.inf)
    rng = np.random.default_rng(context.seed)
    camera = gp.Camera(FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    for k in range(count):
        view, R, t, X, pixel, bbox = _scene(rng, camera)
        model = gp.ShapeModel(X[None], bbox_3d=CAR)
        found_R, found_t = _core.solve_p1p(view._handle, model._handle, 0, pixel, bbox, "all")
        solutions[k] = len(found_R)
        if len(found_R):
            e_r = rotation_error_deg(R, found_R)
            best[k], best_t[k] = e_r.min(), translation_error_percent(t, found_t)[e_r.argmin()]
        if k % SCENES_PER_TRIAL == 0:
            context.advance(f"exact P1P, scene {k} of {count}")
    detail = {
        "scenes": count,
        "worst best e_r deg": float(best.max()),
        "worst e_t % of the same": float(best_t.max()),
        "missed": int(np.sum(best > 1e-3)),
        "mean solutions": float(solutions.mean()),
        "most solutions": int(solutions.max()),
    }
    return Result([TARGETS["p1p"].check(best.max())], [detail])


def _scene(rng: np.random.Generator, camera: gp.Camera) -> tuple[gp.View, Array, Array, Array, Array, Array]:
    """View, true R and t, one keypoint of the car, its pixel, box of the car; all in front of the camera."""
    corners = np.array(np.meshgrid(*CAR.T)).reshape(3, -1).T
    while True:
        pitch, roll = np.radians(rng.uniform(*PITCH_DEG)), np.radians(rng.uniform(*ROLL_DEG))
        view = gp.View(camera, pitch=pitch, roll=roll)
        ray = np.linalg.solve(camera.K, [rng.uniform(0, WIDTH), rng.uniform(0, HEIGHT), 1.0])
        t = rng.uniform(*DISTANCE_M) * ray / np.linalg.norm(ray)
        yaw = rng.uniform(-np.pi, np.pi)
        c, s = np.cos(yaw), np.sin(yaw)
        R = view.R_camera_from_ground @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        X = rng.uniform(CAR[0], CAR[1])
        points = np.vstack([corners, X]) @ R.T + t
        if points[:, 2].min() > 0.5:
            pixels = points @ camera.K.T
            pixels = pixels[:, :2] / pixels[:, 2:]
            bbox = np.concatenate([pixels[:-1].min(axis=0), pixels[:-1].max(axis=0)])
            return view, R, t, X, pixels[-1], bbox
