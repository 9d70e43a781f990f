"""Who is timed: ways to use our own solver, and other libraries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from groundpose.lab.evaluate import methods
from groundpose.lab.evaluate.experiments.libraries import EVERY_RIVAL
from groundpose.lab.evaluate.methods import Method
from groundpose.lab.evaluate.rivals import POSELIB_TUNED, Rival
from groundpose.lab.evaluate.scenes import Array, Scenes
from groundpose.lab.evaluate.timing import Contestant, ours, rival


@dataclass(frozen=True)
class Contender:
    """One way to get poses."""

    name: str
    note: str
    """How it is configured."""
    seconds: Contestant
    answer: Callable[[Scenes], tuple[Array, Array]]
    """R (N, 3, 3) and t (N, 3), NaN where there is no answer."""
    missing: str | None = None
    """Why it cannot run."""
    slow_with_outliers: bool = False


def own(method: Method, threads: int = 1, batch: int | None = None, name: str = "") -> Contender:
    """Our own solver: the whole Python batch call is timed."""
    answer = lambda scenes: method(scenes, threads)  # noqa: E731
    return Contender(name or method.name, method.note, ours(method, threads, batch), answer)


def library(other: Rival) -> Contender:
    """Another library: its own calls are timed, without building its inputs."""

    def answer(scenes: Scenes) -> tuple[Array, Array]:
        R, t = np.full((len(scenes), 3, 3), np.nan), np.full((len(scenes), 3), np.nan)
        for k, scene in enumerate(scenes.singles):
            found = other.solve(scene)
            if found.R is not None and found.t is not None:
                R[k], t[k] = found.R, found.t
        return R, t

    slow = other.slow_with_outliers
    return Contender(other.name, other.options, rival(other), answer, other.missing(), slow)


def search(solver: str, hre_thresholds: tuple[float, float, float]) -> Contender:
    """RNSC-P1P, -UP2P or -P3P of the paper on our own core, with its refinement."""
    options = methods.paper_search(solver, "hre", hre_thresholds)
    return own(Method(f"RNSC-{solver.upper()}+HRE", "the paper's search and refinement, our core", options))


_NAMES = ("PoseLib tuned", "PoseLib", "pycolmap", "OpenCV USAC MAGSAC + LM", "OpenCV SQPNP + LM")
LIBRARIES = tuple(next(r for r in EVERY_RIVAL if r.name == name) for name in _NAMES)
"""The libraries everybody knows, the one to beat first."""
TO_BEAT = POSELIB_TUNED.name
DEFAULT = methods.DEFAULT.name


def libraries() -> tuple[Contender, ...]:
    """All of them, installed or not."""
    return tuple(library(each) for each in LIBRARIES)


def described() -> dict[str, str]:
    """What every library is, or why it is missing, {name: text}: stored with results."""
    return {each.name: each.missing() or each.options for each in LIBRARIES}
