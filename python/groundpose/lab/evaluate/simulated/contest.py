"""Who takes part in G1 and G2, and what each is given."""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np

import groundpose as gp
from groundpose.lab.evaluate.experiments.outcome import CHUNK
from groundpose.lab.evaluate.methods import DEFAULT, HRE_VEHICLE, Method, paper_search
from groundpose.lab.evaluate.rivals import POSELIB_TUNED, RIVALS, Clock, Rival
from groundpose.lab.evaluate.scenes import Array, Scene
from groundpose.lab.evaluate.simulated.errors import Answers
from groundpose.lab.evaluate.simulated.objects import Objects

RELATIVE_THRESHOLD = 0.0375
"""t_in = tau1 as a share of the longer side of the box; tau2 and tau3 follow (paper, sec. 4.2.3)."""
LOWEST_SCORE = 0.1
"""All that others can do with scores is to leave keypoints out: below this they do."""
FEWEST_POINTS = 4
"""Other libraries need so many."""
NO_SCORES, WEIGHTS, CUT = "", "scores as weights", f"score >= {LOWEST_SCORE:g}"
"""What is done with scores."""
SLOW = 2000
"""Vehicles that a slow method is given."""


@dataclass(frozen=True)
class Given:
    """What every method is given of N vehicles; l is that of the box given."""

    objects: Objects
    keypoints_2d: Array
    scores: Array
    bboxes: Array
    models: list[gp.ShapeModel]

    @property
    def inlier_threshold(self) -> Array:
        """(N,) px."""
        return np.asarray(RELATIVE_THRESHOLD * (self.bboxes[:, 2:] - self.bboxes[:, :2]).max(axis=1))

    def __getitem__(self, rows: slice) -> Given:
        """Some of the vehicles."""
        return Given(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def kept(self, scores: str) -> Array:
        """Keypoints (N, P, 2), those with a low score left out where scores are used so."""
        if scores != CUT:
            return self.keypoints_2d
        return np.where((self.scores >= LOWEST_SCORE)[..., None], self.keypoints_2d, np.nan)

    def shapes(self, coefficients: Array | None = None) -> Array:
        """(N, P, 3) metres: the models with these coefficients (N, M), NaN without an answer."""
        shapes = np.full((*self.keypoints_2d.shape[:2], 3), np.nan)
        for k, model in enumerate(self.models):
            points = model.keypoints_3d
            if coefficients is not None and model.modes:
                points = model.keypoints(coefficients[k, : model.modes])
            shapes[k, : len(points)] = points
        return shapes


class CpuClock(Clock):
    """Time of this thread alone: what else the machine does does not count, as it does not for ours."""

    def __call__(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """See `Clock`."""
        start = time.thread_time()
        result = function(*arguments)
        self.seconds += time.thread_time() - start
        return result


class Contestant(Protocol):
    """One line of the table."""

    @property
    def name(self) -> str:
        """With what it does with scores."""
        ...

    @property
    def note(self) -> str:
        """What it is."""
        ...

    @property
    def most(self) -> int | None:
        """How many vehicles it is given, the first ones; None: all."""
        ...

    def missing(self) -> str | None:
        """Why it cannot run, or None when it can."""
        ...

    def __call__(self, given: Given) -> Answers:
        """Poses and shapes of all vehicles, on one thread."""
        ...


@dataclass(frozen=True)
class Core:
    """Our own core with some options: our default and the paper's methods."""

    method: Method
    scores: str

    @property
    def name(self) -> str:
        """Of the method and what it does with scores."""
        return f"{self.method.name}, {self.scores}" if self.scores else self.method.name

    @property
    def note(self) -> str:
        """Of the method."""
        return self.method.note

    @property
    def most(self) -> int | None:
        """All."""
        return None

    def missing(self) -> str | None:
        """It is always there."""
        return None

    def __call__(self, given: Given) -> Answers:
        """See `Contestant`. Batch calls of CHUNK vehicles are timed."""
        options = gp.Options(relative_threshold=RELATIVE_THRESHOLD, **self.method.options)
        view, parts, seconds = given.objects.view, [], np.zeros(len(given.models))
        for first in range(0, len(seconds), CHUNK):
            part = given[first : first + CHUNK]
            keypoints = part.kept(self.scores)
            width = max(len(model.keypoints_3d) for model in part.models)  # as wide as the largest model
            arguments = np.ascontiguousarray(keypoints[:, :width]), part.bboxes, part.models
            scores = np.ascontiguousarray(part.scores[:, :width]) if self.scores == WEIGHTS else None
            start = time.thread_time()
            poses = gp.estimate_poses(view, *arguments, scores, options, threads=1)
            seconds[first : first + CHUNK] = (time.thread_time() - start) / len(part.models)
            parts.append((poses.R, poses.t, part.shapes(poses.shape_coefficients)))
        R, t, shapes = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Answers(R, t, shapes, seconds)


@dataclass(frozen=True)
class Library:
    """Another library: one call a vehicle, the rigid mean of its model."""

    rival: Rival
    scores: str

    @property
    def name(self) -> str:
        """Of the library and what it does with scores."""
        return f"{self.rival.name}, {self.scores}" if self.scores else self.rival.name

    @property
    def note(self) -> str:
        """Its options."""
        return f"{self.rival.options}; the mean shape where the model has modes"

    @property
    def most(self) -> int | None:
        """Fewer where it takes a millisecond each."""
        return None if self.rival is POSELIB_TUNED else SLOW

    def missing(self) -> str | None:
        """Whether it is installed."""
        return self.rival.missing()

    def __call__(self, given: Given) -> Answers:
        """See `Contestant`. The library's own calls are timed, not building its inputs."""
        count, camera = len(given.models), given.objects.camera
        R, t, seconds = np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan), np.zeros(count)
        library = importlib.import_module(self.rival.package)
        keypoints, thresholds, shapes = given.kept(self.scores), given.inlier_threshold, given.shapes()
        seen = np.isfinite(keypoints[..., 0])
        for k in np.flatnonzero(seen.sum(axis=1) >= FEWEST_POINTS):
            x, X = keypoints[k][seen[k]], shapes[k][seen[k]]
            scene = Scene(x, X, camera, float(thresholds[k]), given.objects.R[k], given.objects.t[k])
            clock = CpuClock()
            pose = self.rival.call(library, scene, clock)
            seconds[k] = clock.seconds
            if pose is not None and np.isfinite(pose[0]).all() and np.isfinite(pose[1]).all():
                R[k], t[k] = pose
        return Answers(R, t, shapes, seconds)


def paper(solver: str, refinement: str) -> Method:
    """RNSC-P1P or RNSC-P3P with a refinement of the paper."""
    options = paper_search(solver, refinement, HRE_VEHICLE)
    return Method(f"RNSC-{solver.upper()}+{refinement.upper()}", "the paper's, in our core", options)


NEVER_REFUSES = Method(
    "ours, never refusing", "the default with max_log10_nfa inf", {"max_log10_nfa": math.inf}
)
UP2P = Method(
    "ours, UP2P, never refusing", "the same with solver up2p", {"solver": "up2p", "max_log10_nfa": math.inf}
)
OWN = (DEFAULT, NEVER_REFUSES, UP2P)
SIMPLE = {"G1": "gn", "G2": "re"}
"""The refinement that the paper compares HRE with."""


def contestants(experiment: str) -> list[Contestant]:
    """Everybody that can run here, without scores first."""
    refinements = (SIMPLE[experiment], "hre")
    papers = [paper(solver, refinement) for solver in ("p1p", "p3p") for refinement in refinements]
    poselib = [rival for rival in RIVALS if rival.package == "poselib"]
    found: list[Contestant] = []
    for scores, own in ((NO_SCORES, NO_SCORES), (CUT, WEIGHTS)):
        found += [Core(method, own) for method in OWN]
        found += [Core(method, scores) for method in papers]
        found += [Library(rival, scores) for rival in poselib]
    return [one for one in found if one.missing() is None]
