"""Wrong and sure of it: how often the solver is silent about a mistake, its own or that of the caller.

An answer is silent about being wrong when its status is "ok", it is off by more than 15 degrees and by more
than five standard deviations of its own covariance, and its ambiguity is below 0.1. Writes
results/silent.json and, from it, docs/silent.md. Numbers depend on trials and seed only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._writing import write_text
from groundpose.lab.contenders import own
from groundpose.lab.contenders.objects import Array, Mask, Objects
from groundpose.lab.contenders.own import PRIOR_DEG, Own
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.honesty.answers import yaw_error
from groundpose.lab.evaluate.honesty.synthetic import GROSS_DEG
from groundpose.lab.evaluate.misled import CASES, Case

JSON, BEFORE, PAGE = Path("results/silent.json"), Path("results/silent_before.json"), Path("docs/silent.md")
MOST_SIGMAS, MOST_AMBIGUITY = 5.0, 0.1
HELD = Own(
    "ours, held to the ground",
    "tilt_sigma of the default, given: no last search without the ground",
    {"tilt_sigma": math.radians(PRIOR_DEG)},
)
LIMITS = {
    **{"pitch-20": 0.5, "lean-15": 0.5, "upside-down": 2.0, "class": 5.0},
    **dict.fromkeys(("collapsed", "shrunk", "tiny"), 0.0),
}
"""Most silent answers of a case, %, by their yaw; none where the keypoints are in one place."""
_YAW, _ROTATION = "silent, yaw, %", "silent, rotation, %"
NOTE = (
    "*Before*: the solver without the last search, the check of collapsed keypoints and the least "
    "probability, on the same scenes."
)
INTRO = """# Wrong, and sure of it

How often the solver is silent about a mistake, its own or that of whoever calls it: vehicles of the
synthetic protocol V1 with one mistake each, keypoints of the caller, no network.

**Silent**: status `ok`, wrong by more than 15 deg, by more than five standard deviations of the stated
covariance of the rotation, and `ambiguity` below 0.1. *Yaw* counts the error about the object's up axis,
*rotation* that of the whole rotation: a pose that is upright where the nominal tilt is wrong by 20 deg
has a right yaw and a rotation that is wrong by 20 deg. Where the keypoints say nothing of the object,
every answer is wrong and silent.

Against silence there are three things. Where neither the keypoints nor the box convince, a last search does
without the ground (`solver` is then `p3p`). Keypoints in one place of the box are `degenerate`, and a pose
that looks far smaller than the box is `improbable`. So is an answer whose probability, fitted on a mixture
of such objects and good ones, is below `min_probability` ([How sure an answer is](honesty.md)). Who gives
`tilt_sigma` means it: then there is no last search (*held to the ground*)."""


def rotation_vectors(R_true: Array, R: Array) -> Array:
    """(N, 3) radians `w` with `R_true = exp(w) R`; NaN without an answer. Exact up to half a turn."""
    turned = R_true @ np.swapaxes(R, 1, 2)
    sine = 0.5 * np.stack(
        [
            turned[:, 2, 1] - turned[:, 1, 2],
            turned[:, 0, 2] - turned[:, 2, 0],
            turned[:, 1, 0] - turned[:, 0, 1],
        ],
        axis=1,
    )
    length = np.linalg.norm(sine, axis=1)
    angle = np.arctan2(length, 0.5 * (np.trace(turned, axis1=1, axis2=2) - 1.0))
    # nearly half a turn: the axis is the column of R + I that is longest
    symmetric = (
        turned
        + np.swapaxes(turned, 1, 2)
        + (1.0 - np.trace(turned, axis1=1, axis2=2))[:, None, None] * np.eye(3)
    )
    column = np.argmax(np.abs(np.diagonal(symmetric, axis1=1, axis2=2)), axis=1)
    axis = symmetric[np.arange(len(R)), :, column]
    with np.errstate(invalid="ignore", divide="ignore"):
        axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        axis *= np.where((axis * sine).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
        small = sine * np.where(length > 0.0, angle / length, 1.0)[:, None]
    return np.asarray(np.where((angle > 3.0)[:, None], angle[:, None] * axis, small))


def judged(case: Case, scenes: Objects, poses: gp.PoseBatch) -> dict[str, Mask]:
    """Per object: whether it is refused, wrong and silent, by its yaw and by its rotation."""
    error = rotation_vectors(scenes.R, poses.R)
    covariance = np.where(poses.ok[:, None, None], poses.covariance[:, :3, :3], np.eye(3))
    sigmas2 = np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0])
    surely = (sigmas2 > MOST_SIGMAS**2) & (poses.ambiguity < MOST_AMBIGUITY)
    off = {"yaw": yaw_error(scenes.R, poses.R), "rotation": np.degrees(np.linalg.norm(error, axis=1))}
    found: dict[str, Mask] = {"refused": ~poses.ok}
    for name, angle in off.items():
        wrong = poses.ok & ((angle > GROSS_DEG) | (not case.has_truth))
        found[f"wrong, {name}"] = wrong
        found[f"silent, {name}"] = wrong & (surely | (not case.has_truth))
    return found


def line(case: Case, method: Own, trials: int, seed: int) -> dict[str, Any]:
    """Percentages of one case."""
    groups = [(scenes, method.poses(scenes)) for scenes in case.scenes(trials, seed)]
    parts = [judged(case, scenes, poses) for scenes, poses in groups]
    names = ("silent, yaw", "silent, rotation", "wrong, yaw", "wrong, rotation", "refused")
    percent = {f"{name}, %": 100.0 * float(np.concatenate([p[name] for p in parts]).mean()) for name in names}
    return {"id": case.id, "case": case.what, "method": method.name, **percent}


def measure(trials: int, seed: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """All cases, by the default and by the solver that is held to the ground."""
    lines = []
    for case in CASES:
        tell(case.what)
        lines += [line(case, method, trials, seed) for method in (own.DEFAULT, HELD)]
    return {
        "command": f"groundpose evaluate silent --trials {trials} --seed {seed}",
        "versions": report.versions(),
        "lines": lines,
    }


def rows(found: dict[str, Any], before: dict[str, Any]) -> list[dict[str, Any]]:
    """The table: per case what is wrong and silent now, and what was."""
    by_case = {(one["id"], one["method"]): one for one in found["lines"]}
    former = {one["id"]: one for one in before.get("lines", ())}
    table = []
    for case in CASES:
        now, held = (by_case[case.id, method.name] for method in (own.DEFAULT, HELD))
        limit = LIMITS.get(case.id)
        was = former.get(case.id, {})
        table.append(
            {
                "case": case.what,
                "silent by yaw, %": now[_YAW],
                "before": was.get(_YAW),
                "target": None if limit is None else f"at most {limit:g}",
                "met": None if limit is None else now[_YAW] <= limit,
                "silent by rotation, %": now[_ROTATION],
                "by rotation, before": was.get(_ROTATION),
                "by rotation, held to the ground": held[_ROTATION],
                "wrong by yaw, %": now["wrong, yaw, %"],
                "refused, %": now["refused, %"],
                "refused before": was.get("refused, %"),
            }
        )
    return table


def write_stored(root: Path) -> Path | None:
    """The page from the stored results; None when there are none."""
    found = report.read_json(root / JSON)
    if not found:
        return None
    lines = report.table(rows(found, report.read_json(root / BEFORE)))
    write_text(root / PAGE, "\n\n".join([INTRO, f"`{found['command']}`", lines, NOTE]) + "\n")
    return root / PAGE
