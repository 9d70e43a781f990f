"""Rows about honesty: do the stated covariances hold the truth, and is chance refused?"""

from __future__ import annotations

import dataclasses

import numpy as np

import groundpose as gp
from groundpose.lab.contenders import own
from groundpose.lab.contenders.objects import Array, Objects
from groundpose.lab.contenders.own import Own
from groundpose.lab.evaluate.rows import Context, Detail, Result
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.metrics import rotation_error_deg
from groundpose.lab.targets import TARGETS

CHI2_95_OF_6 = 12.592
"""95 % of a chi-square variable with six degrees of freedom lie below."""
GROSS_DEG = 15.0
"""A pose further off is a wrong answer, not a noisy one; no covariance is meant to cover it."""


def squared_mahalanobis(scenes: Objects, poses: gp.PoseBatch) -> Array:
    """Squared error in units of the stated covariance, (T,); NaN without an answer."""
    turned = scenes.R @ np.swapaxes(poses.R, 1, 2)
    w = 0.5 * np.stack(
        [
            turned[:, 2, 1] - turned[:, 1, 2],
            turned[:, 0, 2] - turned[:, 2, 0],
            turned[:, 1, 0] - turned[:, 0, 1],
        ],
        axis=1,
    )
    error = np.concatenate([w, scenes.t - poses.t], axis=1)
    covariance = np.where(poses.ok[:, None, None], poses.covariance, np.eye(6))
    return np.asarray(np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0]))


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
        poses = method.poses(scenes)
        found = poses.ok & (rotation_error_deg(scenes.R, poses.R) < GROSS_DEG)
        d2 = squared_mahalanobis(scenes, poses)[found]
        details.append(
            {
                "setting": name,
                "method": method.name,
                "inside the 95 % region, %": 100 * float(np.mean(d2 < CHI2_95_OF_6)),
                "mean squared error / 6 (ideal 1)": float(np.mean(d2)) / 6,
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
