"""The interface of everything that is compared, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

import groundpose as gp
from groundpose.lab.contenders.objects import Array, Mask, Objects
from groundpose.lab.metrics import Summary, rotation_error_deg, summarise, translation_error_percent
from groundpose.lab.timing import Clock


@dataclass(frozen=True)
class Answers:
    """Poses of N objects; NaN where there is no answer."""

    R: Array
    t: Array
    seconds: Array
    """(N,) of each, the same number for all objects of one batch call; NaN: not timed."""
    iterations: Array | None = None
    """(N,) samples a RANSAC drew; None when there is none or it does not say."""
    shape_coefficients: Array | None = None
    """(N, M); None: the mean shape."""
    kept: Mask | None = None
    """(N, P) keypoints that a search kept for a later step; None: those near its pose."""
    poses: gp.PoseBatch | None = None
    """All that our solver says, when it was one batch call."""


class Contender(Protocol):
    """One way to get poses."""

    @property
    def name(self) -> str:
        """In tables and figures; no two share one."""
        ...

    @property
    def note(self) -> str:
        """How it is configured."""
        ...

    @property
    def weighs_scores(self) -> bool:
        """Whether it can use keypoint scores as weights; the others can only leave keypoints out."""
        ...

    @property
    def slow_with_outliers(self) -> bool:
        """Whether it needs a fifth of a second and more per object at 70 % outliers."""
        ...

    def missing(self) -> str | None:
        """Why it cannot run, or None when it can."""
        ...

    def solve(self, objects: Objects, clock: Clock) -> Answers:
        """Poses of all objects; its own work, and nothing else, runs under the clock."""
        ...


def seconds_of(contender: Contender, objects: Objects) -> float:
    """Seconds for all objects."""
    clock = Clock()
    contender.solve(objects, clock)
    return clock.seconds


def errors(objects: Objects, answers: Answers) -> Summary:
    """Errors of one answer per object against the truth."""
    e_r = rotation_error_deg(objects.R, answers.R)
    return summarise(e_r, translation_error_percent(objects.t, answers.t))


def nothing(count: int) -> tuple[Array, Array]:
    """R and t without an answer."""
    return np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan)


def as_poses(objects: Objects, answers: Answers) -> gp.PoseBatch:
    """The answers as a batch; all that a contender does not say is as without an answer."""
    if answers.poses is not None:
        return answers.poses
    unseen = np.full_like(objects.keypoints_2d, np.nan)
    batch = gp.estimate_poses(objects.view, unseen, objects.bboxes, objects.models, threads=1)
    ok = np.asarray(np.isfinite(answers.t).all(axis=1))
    coefficients = np.zeros_like(batch.shape_coefficients)
    return replace(batch, R=answers.R, t=answers.t, ok=ok, shape_coefficients=coefficients)


def inlier_mask(objects: Objects, R: Array, t: Array) -> Mask:
    """(N, P) keypoints within the threshold of the poses given: counted alike for every contender."""
    Y = objects.keypoints_3d @ np.swapaxes(R, 1, 2) + t[:, None, :]
    u, v = np.moveaxis(objects.camera.project(Y) - objects.keypoints_2d, -1, 0)
    return np.asarray(np.hypot(u, v) <= objects.inlier_threshold[:, None])
