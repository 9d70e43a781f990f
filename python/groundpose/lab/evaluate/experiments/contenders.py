"""Families of methods: a search and everything that follows it is run together, so the search runs once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from groundpose.lab.evaluate import oracle
from groundpose.lab.evaluate.baselines import reppnp
from groundpose.lab.evaluate.baselines.geometry import Pose, normalised
from groundpose.lab.evaluate.baselines.reppnp import DELTA_FACTOR
from groundpose.lab.evaluate.experiments.outcome import CHUNK, Mask, Outcome, inlier_mask, missing
from groundpose.lab.evaluate.experiments.polish import GN, LEAST_POINTS, PNPS, Polish
from groundpose.lab.evaluate.experiments.settings import Setting
from groundpose.lab.evaluate.methods import DEFAULT, HRE_CUBE, NO_PRIOR, UP2P, Method, paper_search
from groundpose.lab.evaluate.scenes import Scenes

REPEATS, LONG_ENOUGH = 3, 0.05
"""Batch calls of our core are timed so often, or until so many seconds; the median counts."""


class Family(Protocol):
    """Methods that are run together."""

    @property
    def name(self) -> str:
        """Of the family."""
        ...

    def methods(self) -> dict[str, str]:
        """{name: note} of every method that can run here."""
        ...

    def trials(self, setting: Setting, trials: int) -> int:
        """How many of the trials it is given: fewer where it is too slow."""
        ...

    def run(self, scenes: Scenes, wanted: list[str]) -> dict[str, Outcome]:
        """Outcomes of the wanted methods."""
        ...


def run_solver(method: Method, scenes: Scenes) -> Outcome:
    """Our solver on one thread, in batch calls of one chunk."""
    parts, seconds = [], np.zeros(len(scenes))
    method.estimate(scenes[: min(5, len(scenes))])
    for first in range(0, len(scenes), CHUNK):
        chunk = scenes[first : first + CHUNK]
        options, _ = method.options_for(chunk), chunk.models  # a user has both before an image comes
        took: list[float] = []
        while len(took) < REPEATS and sum(took) < LONG_ENOUGH:  # a batch of 2 ms is easily disturbed
            start = time.perf_counter()
            poses = method.estimate(chunk, 1, options)
            took.append(time.perf_counter() - start)
        parts.append(poses)
        seconds[first : first + CHUNK] = np.median(took) / len(chunk)
    R, t = np.concatenate([p.R for p in parts]), np.concatenate([p.t for p in parts])
    return Outcome(R, t, seconds, np.concatenate([p.iterations for p in parts]).astype(float))


def polished(search: Outcome, kept: Mask, scenes: Scenes, polish: Polish) -> Outcome:
    """A PnP on the points that the search kept (T, P); its time is added to the search's."""
    R, t = missing(len(scenes))
    seconds = search.seconds.copy()
    for k in np.flatnonzero(np.isfinite(search.t[:, 0]) & (kept.sum(axis=1) >= LEAST_POINTS)):
        X, pixels = scenes.keypoints_3d[k][kept[k]], scenes.keypoints_2d[k][kept[k]]
        start = time.perf_counter()
        try:
            pose = polish.fit(X, normalised(pixels, scenes.camera), (search.R[k], search.t[k]))
        except np.linalg.LinAlgError:
            pose = None
        seconds[k] += time.perf_counter() - start
        if pose is not None and np.isfinite(pose[0]).all() and np.isfinite(pose[1]).all():
            R[k], t[k] = pose
    return Outcome(R, t, seconds, search.iterations)


def each_polished(
    name: str, polishes: Sequence[Polish], search: Outcome, kept: Mask, scenes: Scenes, wanted: list[str]
) -> dict[str, Outcome]:
    """A search followed by every polishing method that is wanted, under the names of both."""
    names = {f"{name}+{polish.name}": polish for polish in polishes}
    return {both: polished(search, kept, scenes, p) for both, p in names.items() if both in wanted}


def _all(setting: Setting, trials: int) -> int:
    return trials


def searched(solver: str, refinement: str) -> Method:
    """RNSC-P1P or RNSC-P3P, alone or with a refinement of the core."""
    options = paper_search(solver, refinement, HRE_CUBE)
    suffix = "" if refinement == "none" else f"+{refinement.upper()}"
    return Method(f"RNSC-{solver.upper()}{suffix}", f"paper's search, refinement {refinement}", options)


@dataclass(frozen=True)
class Ransac:
    """RNSC-P1P or RNSC-P3P alone, followed by GN, HRE (both our own core) and every PnP."""

    solver: str
    trials: Callable[[Setting, int], int] = field(default=_all, repr=False)

    @property
    def name(self) -> str:
        """RNSC-P1P or RNSC-P3P."""
        return f"RNSC-{self.solver.upper()}"

    def methods(self) -> dict[str, str]:
        """The refinements of the core, then PnP methods."""
        own = [searched(self.solver, refinement) for refinement in ("none", "gn", "hre")]
        polish = {f"{self.name}+{p.name}": p.note for p in PNPS if p.missing() is None}
        return {m.name: m.note for m in own} | polish

    def run(self, scenes: Scenes, wanted: list[str]) -> dict[str, Outcome]:
        """See `Family`."""
        search = run_solver(searched(self.solver, "none"), scenes)
        found = {self.name: search}
        for refinement in ("gn", "hre"):
            method = searched(self.solver, refinement)
            if method.name in wanted:
                found[method.name] = run_solver(method, scenes)
        kept = inlier_mask(scenes, search.R, search.t)
        found |= each_polished(self.name, PNPS, search, kept, scenes, wanted)
        return {name: outcome for name, outcome in found.items() if name in wanted}


@dataclass(frozen=True)
class Reppnp:
    """REPPnP alone and followed by the same; delta_max = 1.4 t_in / f."""

    name: str = "REPPnP"
    trials: Callable[[Setting, int], int] = field(default=_all, repr=False)

    def methods(self) -> dict[str, str]:
        """Alone, GN and PnP methods."""
        alone = {self.name: "Ferraz et al. 2014, NumPy"}
        return alone | {f"{self.name}+{p.name}": p.note for p in (GN, *PNPS) if p.missing() is None}

    def run(self, scenes: Scenes, wanted: list[str]) -> dict[str, Outcome]:
        """See `Family`."""
        R, t = missing(len(scenes))
        seconds, kept = np.zeros(len(scenes)), np.zeros(scenes.inlier_truth.shape, bool)
        for k in range(len(scenes)):
            delta = DELTA_FACTOR * float(scenes.inlier_threshold[k]) / scenes.camera.fx
            start = time.perf_counter()
            x = normalised(scenes.keypoints_2d[k], scenes.camera)
            pose, kept[k], _ = reppnp(scenes.keypoints_3d[k], x, delta)
            seconds[k] = time.perf_counter() - start
            if pose is not None:
                R[k], t[k] = pose
        search = Outcome(R, t, seconds)
        found = {self.name: search} | each_polished(self.name, (GN, *PNPS), search, kept, scenes, wanted)
        return {name: outcome for name, outcome in found.items() if name in wanted}


@dataclass(frozen=True)
class Ours:
    """Our default, without priors, and with a 2-point upright search."""

    name: str = "ours"
    trials: Callable[[Setting, int], int] = field(default=_all, repr=False)

    def methods(self) -> dict[str, str]:
        """As in `evaluate.methods`."""
        return {m.name: m.note for m in (DEFAULT, NO_PRIOR, UP2P)}

    def run(self, scenes: Scenes, wanted: list[str]) -> dict[str, Outcome]:
        """See `Family`."""
        return {m.name: run_solver(m, scenes) for m in (DEFAULT, NO_PRIOR, UP2P) if m.name in wanted}


@dataclass(frozen=True)
class Oracles:
    """Least squares on the true inliers: floors."""

    name: str = "oracles"
    trials: Callable[[Setting, int], int] = field(default=_all, repr=False)

    def methods(self) -> dict[str, str]:
        """6-DoF, and 4-DoF that trusts the told tilt."""
        return {
            "oracle 6-DoF": "least squares on the true inliers",
            "oracle 4-DoF": "the same, upright in the told ground frame",
        }

    def run(self, scenes: Scenes, wanted: list[str]) -> dict[str, Outcome]:
        """See `Family`. Not timed: it starts at the truth."""
        c = scenes.camera
        intrinsics = (c.fx, c.fy, c.cx, c.cy)
        tilt = scenes.view.R_camera_from_ground
        poses: dict[str, list[Pose]] = {name: [] for name in wanted}
        for first in range(0, len(scenes), 100):  # memory: a Jacobian of 1000 scenes is half a gigabyte
            part = scenes[first : first + 100]
            problem = oracle.Problem(part.keypoints_2d, part.keypoints_3d, part.inlier_truth, intrinsics)
            for name in wanted:
                if name == "oracle 6-DoF":
                    poses[name].append(oracle.solve_6dof(problem, part.R, part.t))
                else:
                    poses[name].append(oracle.solve_4dof(problem, part.R, part.t, tilt))
        untimed = np.full(len(scenes), np.nan)
        return {
            name: Outcome(np.concatenate([R for R, _ in p]), np.concatenate([t for _, t in p]), untimed)
            for name, p in poses.items()
        }
