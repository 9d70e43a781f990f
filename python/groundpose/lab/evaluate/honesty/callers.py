"""Keypoints of the caller: how probable it is that an answer to them is right.

`python -m groundpose.lab.evaluate.honesty.callers` prints the coefficients that stand in `tuning.rs`
(`CALLERS_PROBABILITY`). They are fitted on synthetic vehicles whose keypoints are made worse in every way,
because nobody knows which keypoints a caller has, and on some that agree but are scored as if nothing were
there. The misfit of the box is left out: synthetic boxes are exact, and those of callers are cut, loose or of
the visible part alone.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from groundpose import PoseBatch
from groundpose._checks import FloatArray
from groundpose.keypoints.decode import logistic_regression
from groundpose.lab.contenders import own
from groundpose.lab.contenders.objects import Mask, Objects
from groundpose.lab.evaluate.honesty.answers import right
from groundpose.lab.evaluate.honesty.probability import reliability
from groundpose.lab.evaluate.real_data import apollo, kitti
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.metrics import RELATIVE_THRESHOLD

FIT_SEED, TEST_SEED = 5, 9
FITTED, TESTED = 4000, 2000
"""Vehicles with scores, and as many without."""
IMAGINED, _IMAGINED_LOGIT = 400, -6.0
"""Vehicles of a fit that are not there, and the mean logit of their keypoints' scores."""
_USED = np.array([1.0, 0.0, 1.0, 1.0, 0.0, 1.0])
"""Numbers of the evidence: the misfit is not used, a vehicle's probability nobody says."""
_ALL_WRONG, _FEWEST_SEEN = 0.25, 0.25
"""Fraction of the vehicles with wrong keypoints alone; least fraction of keypoints that is seen."""
_NOISE = (0.001, 0.06)
"""Range of the additional noise, fraction of the box's longer side, uniform in its logarithm."""


def made_up(count: int, seed: int, scored: bool) -> Objects:
    """Vehicles of V1 with more noise, wrong keypoints up to all, fewer seen, with scores or without."""
    scenes, rng = generate("vehicle", count, seed=seed), np.random.default_rng([seed, scored])
    low, high = scenes.bboxes[:, None, :2], scenes.bboxes[:, None, 2:]
    side, shape = (high - low).max(axis=2), scenes.keypoints_2d.shape
    fraction = np.where(rng.random(count) < _ALL_WRONG, 1.0, rng.random(count))
    wrong = rng.random(shape[:2]) < fraction[:, None]
    noise = np.exp(rng.uniform(np.log(_NOISE[0]), np.log(_NOISE[1]), count))[:, None] * side
    moved = scenes.keypoints_2d + noise[..., None] * rng.normal(size=shape)
    points = np.where(wrong[..., None], low + (high - low) * rng.random(shape), moved)
    seen = rng.random(shape[:2]) < np.exp(rng.uniform(np.log(_FEWEST_SEEN), 0.0, count))[:, None]
    points = np.where((seen & ~np.isnan(scenes.keypoints_2d[..., 0]))[..., None], points, np.nan)
    near = np.linalg.norm(points - scenes.keypoints_2d, axis=2) <= RELATIVE_THRESHOLD * side
    assert scenes.inlier_truth is not None
    good = scenes.inlier_truth & ~wrong & near
    return replace(scenes, keypoints_2d=points, keypoint_scores=_scores(rng, good) if scored else None)


def _scores(rng: np.random.Generator, good: Mask) -> FloatArray:
    """Scores (N, P) of a detector: some know their good keypoints better than others, and some are bold."""
    count = len(good)
    sharp, bold = rng.uniform(0.5, 2.5, (count, 1)), rng.normal(0.0, 0.7, (count, 1))
    logit = np.where(good, sharp, -sharp) + bold + rng.normal(0.0, 0.7, good.shape)
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * logit)))


def imagined(count: int, seed: int) -> Objects:
    """Keypoints that agree, with scores that say there is no vehicle: networks see such in a background."""
    scenes, rng = generate("vehicle", count, seed=seed), np.random.default_rng(seed)
    logit = (
        _IMAGINED_LOGIT + rng.normal(size=(count, 1)) + rng.normal(0.0, 0.7, scenes.keypoints_2d.shape[:2])
    )
    return replace(scenes, keypoint_scores=0.5 * (1.0 + np.tanh(0.5 * logit)))


def fit() -> list[float]:
    """Bias and the coefficients of the six numbers of the evidence."""
    parts = [_answers(made_up(FITTED, FIT_SEED, scored)) for scored in (False, True)]
    nothing, there = _answers(imagined(IMAGINED, FIT_SEED + 1))
    parts.append((nothing, np.zeros_like(there)))
    evidence = np.concatenate([poses.evidence[poses.ok] for poses, _ in parts]) * _USED
    good = np.concatenate([is_right[poses.ok] for poses, is_right in parts])
    return logistic_regression(np.concatenate([np.ones((len(good), 1)), evidence], axis=1), good)


def _answers(objects: Objects) -> tuple[PoseBatch, Mask]:
    """Poses, and which are right."""
    poses = own.DEFAULT.poses(objects)
    return poses, right(objects.R, objects.t, poses.R, poses.t)


def judged(data: Path) -> dict[str, Any]:
    """`probability.reliability` of what is stated, by kind of keypoints; real ones from a folder."""
    found: dict[str, Objects] = {
        "synthetic vehicles (V1)": generate("vehicle", TESTED),
        "synthetic, every quality": made_up(TESTED, TEST_SEED, False),
        "synthetic, every quality, with scores": made_up(TESTED, TEST_SEED, True),
    }
    if (data / "kitti_cnn_keypoints14_dev.npz").exists():
        cars = kitti(data)
        found["KITTI, a CNN's keypoints"] = cars.without_scores()
        found["KITTI, a CNN's keypoints with scores"] = cars
    if (data / "apollo_cars_dev.npz").exists():
        found["ApolloCar3D, labelled by hand, known models"] = apollo(data, known_model=True)
    return {name: _judged(objects) for name, objects in found.items()}


def _judged(objects: Objects) -> dict[str, Any]:
    poses, is_right = _answers(objects)
    ok = poses.ok
    stated = {"objects": len(objects), "right": float(100 * is_right[ok].mean())}
    return stated | reliability(poses.probability[ok], is_right[ok])


if __name__ == "__main__":
    print(", ".join(f"{coefficient:.2f}" for coefficient in fit()))
