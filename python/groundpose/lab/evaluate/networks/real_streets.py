"""Cars of KITTI's development frames: one look as labelled, and many looks with moved boxes and mirrored."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from groundpose.keypoints.network import VEHICLE_THRESHOLD, Network
from groundpose.keypoints.pipeline import Pipeline
from groundpose.lab.evaluate.networks.judged import EVERY_ANSWER
from groundpose.lab.training.streets import Judged, judge, looks, streets, summary

LOOKS = 6
"""Looks at a frame and as many at its mirror image."""
HEIGHTS = (30.0, 40.0, 60.0)
"""Limits of the groups by the height of the box, pixels; evaluated vehicles have 25 or more."""
GROUPS = ("25 to 30 px", "30 to 40 px", "40 to 60 px", "60 px and more")


def measure(network: Network, frames: Path) -> dict[str, Any]:
    """`{"streets": numbers of one look, "looks": of all, "heights": by height of the box}`.

    Poses are of every box, so that a box taken for empty or an answer that is improbable hides no error; the
    former are counted apart.
    """
    pipeline = Pipeline(network, vehicle_threshold=0.0, options=EVERY_ANSWER)
    seen = streets(frames)
    many = [judge(pipeline, look) for street in seen for look in looks(street, LOOKS)]
    return {
        "streets": summary([judge(pipeline, street) for street in seen]),
        "looks": summary(many) | {"all: called none %": called_none(many)},
        "heights": by_height(many),
    }


def called_none(judged: list[Judged]) -> float:
    """Percentage of vehicles in whose box the network sees none."""
    return float(
        100 * np.mean(np.concatenate([j.poses.vehicle_probability for j in judged]) < VEHICLE_THRESHOLD)
    )


def by_height(judged: list[Judged]) -> dict[str, dict[str, float]]:
    """Numbers of each of `GROUPS` that has vehicles."""
    height = np.concatenate([j.street.bboxes[:, 3] - j.street.bboxes[:, 1] for j in judged])
    rotation, yaw = (np.concatenate([getattr(j, n) for j in judged]) for n in ("rotation_error", "yaw_error"))
    group = np.digitize(height, HEIGHTS)
    found = {}
    for i, name in enumerate(GROUPS):
        chosen = group == i
        if chosen.any():
            found[name] = {
                "vehicles": int(chosen.sum()),
                "median e_r deg": float(np.median(rotation[chosen])),
                "mean e_r deg": float(np.mean(rotation[chosen])),
                "yaw above 15 deg %": float(100 * np.mean(yaw[chosen] > 15.0)),
                "yaw above 30 deg %": float(100 * np.mean(yaw[chosen] > 30.0)),
                "turned round %": float(100 * np.mean(yaw[chosen] > 90.0)),
            }
    return found
