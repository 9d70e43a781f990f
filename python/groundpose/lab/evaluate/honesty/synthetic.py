"""Rows about honesty: do the stated covariances hold the truth, and is chance refused?"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

import groundpose as gp
from groundpose.lab.contenders import own
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.contenders.own import Own
from groundpose.lab.evaluate.honesty.coverage import Stated
from groundpose.lab.evaluate.real_data import apollo
from groundpose.lab.evaluate.rows import Context, Detail, Result
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.metrics import rotation_error_deg
from groundpose.lab.targets import TARGETS

GROSS_DEG = 15.0
"""A pose further off is a wrong answer, not a noisy one; no covariance is meant to cover it."""

LABELLED, LABELLED_FACTOR = "ApolloCar3D, labelled by hand, known models", 12.0
"""Keypoints labelled by hand and an error factor for them: their errors are not independent either."""


def stated(scenes: Objects, method: Own = own.DEFAULT) -> Stated:
    """Errors of the poses within `GROSS_DEG` of the truth, and what was stated of them."""
    poses = method.poses(scenes)
    found = Stated.of(poses, scenes.R, scenes.t)
    return found.only(rotation_error_deg(scenes.R[poses.ok], poses.R[poses.ok]) < GROSS_DEG)


def settings(trials: int, data: Path) -> dict[str, Stated]:
    """Keypoints of the caller: with independent noise, and labelled by hand where there are any."""
    found = {
        "synthetic vehicles (V1)": stated(generate("vehicle", trials)),
        "synthetic cubes (E1), 50 % outliers": stated(generate("cube", trials, outlier_ratio=0.5)),
        "synthetic cubes (E1), 90 % outliers": stated(generate("cube", trials, outlier_ratio=0.9)),
    }
    if (data / "apollo_cars_dev.npz").exists():
        cars = apollo(data, known_model=True)
        found[f"{LABELLED}, error factor 1"] = stated(cars)
        found[f"{LABELLED}, error factor {LABELLED_FACTOR:g}"] = stated(
            cars, Own("", options={"keypoint_error_factor": LABELLED_FACTOR})
        )
    return found


def coverage(context: Context) -> Result:
    """Fraction of true poses inside the stated 95 % region, over poses within 15 degrees of the truth."""
    settings: tuple[tuple[str, str, dict[str, float], Own], ...] = (
        ("V1", "vehicle", {}, own.DEFAULT),
        ("V1", "vehicle", {}, own.NO_PRIOR),
        ("V1", "vehicle", {}, own.HRE),
        ("E1 50 %", "cube", {"outlier_ratio": 0.5}, own.DEFAULT),
        ("E1 90 %", "cube", {"outlier_ratio": 0.9}, own.DEFAULT),
    )
    details: list[Detail] = []
    for name, kind, setting, method in settings:
        context.advance(f"covariance {name} {method.name}")
        scenes = generate(kind, context.trials, seed=context.seed, **setting)
        dimensions, d2 = stated(scenes, method).squared_distances()["pose"]
        details.append(
            {
                "setting": name,
                "method": method.name,
                "inside the 95 % region, %": 100 * float(np.mean(d2 < gp.region_radius2(0.95, dimensions))),
                "mean squared error / 6 (ideal 1)": float(np.mean(d2)) / dimensions,
            }
        )
    inside = [line["inside the 95 % region, %"] for line in details if line["method"] == own.DEFAULT.name]
    return Result(
        [
            TARGETS["coverage least"].check(min(inside)),
            TARGETS["coverage most"].check(max(inside)),
        ],
        details,
    )


def chance(context: Context) -> Result:
    """Vehicles whose keypoints all are uniform in the box: how many get a pose, against true ones refused."""
    scenes = generate("vehicle", context.trials, seed=context.seed)
    rng = np.random.default_rng(context.seed)
    low, high = scenes.bboxes[:, None, :2], scenes.bboxes[:, None, 2:]
    uniform = low + (high - low) * rng.random(scenes.keypoints_2d.shape)
    junk = dataclasses.replace(scenes, keypoints_2d=np.where(np.isnan(scenes.keypoints_2d), np.nan, uniform))
    details: list[Detail] = []
    for limit in (-1.0, 0.0, gp.Options().max_log10_nfa, 2.0, np.inf):
        context.advance(f"chance {limit}")
        method = Own("", "", {"max_log10_nfa": float(limit)})
        accepted, kept = (float(method.poses(s).ok.mean()) for s in (junk, scenes))
        details.append(
            {
                "max_log10_nfa": str(limit),
                "random keypoints called ok, %": 100 * accepted,
                "true scenes refused, %": 100 * (1 - kept),
            }
        )
    default = details[2]
    return Result(
        [
            TARGETS["chance accepted"].check(default["random keypoints called ok, %"]),
            TARGETS["chance refused"].check(default["true scenes refused, %"]),
        ],
        details,
    )
