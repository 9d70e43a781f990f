"""All cases of `groundpose bench`, as tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from groundpose.lab.bench import sources, special
from groundpose.lab.bench.races import Effort, Race, Tell
from groundpose.lab.bench.scenes import KEYPOINTS as CAR_KEYPOINTS
from groundpose.lab.bench.scenes import cars
from groundpose.lab.contenders.contender import Contender
from groundpose.lab.contenders.libraries import POSELIB_TUNED
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.contenders.own import DEFAULT, Own, paper
from groundpose.lab.contenders.registry import contenders
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.timing import CHUNK


@dataclass(frozen=True)
class Case:
    """Something to measure; `run` gives what is stored."""

    id: str
    group: str
    run: Callable[[Effort, Tell], dict[str, Any]]


GROUPS = {
    "machine": "what one core of this machine can do",
    "vehicles": "V1, the vehicle-like protocol: ours, our core's other searches, every library",
    "keypoints": "cost against the number of keypoints",
    "outliers": "cost against the fraction of outliers",
    "shape": "cost against the number of shape modes",
    "batch": "objects of a call, one and two threads",
    "stages": "search, each refinement, covariance",
    "overhead": "Python's part of a call",
}
"""What `groundpose bench` measures, with `--only` some of it."""
BUILT = {
    "instructions": "instructions of every stage (cargo, valgrind)",
    "native": "the installed build against one for this very processor (cargo)",
}
"""What is measured only when asked for."""

KEYPOINTS = (8, 14, 28, 66, 300, 1000)
KEYPOINTS_OUTLIERS = 0.25
PERCENTS = (10, 20, 30, 40, 50, 60, 70, 80, 90)
MODES = (0, 5, 10)
BATCHES = (1, 10, 100, 1_000, 10_000)
TWO_THREADS = "ours, 2 threads"

# every row has what the rows before it have; solver and covariance as in the first
_SEARCH: dict[str, Any] = {"solver": "p1p", "covariance": False}
STAGES = (
    Own("search alone", "one-point search, no refinement", {**_SEARCH, "refinement": "none"}),
    Own("search + GN", "", {**_SEARCH, "refinement": "gn"}),
    Own("search + RE", "", {**_SEARCH, "refinement": "re"}),
    Own("search + HRE", "", {**_SEARCH, "refinement": "hre"}),
    Own("default without covariance", "", {"covariance": False}),
)
_HRE = paper("p1p", "hre")
_WITH_PRIOR = replace(
    _HRE,
    name="RNSC-P1P+HRE, shape prior",
    note="as the paper, but coefficients are pulled to zero",
    options={**_HRE.options, "shape_prior": True},
)


def _vehicles(trials: int, seed: int) -> Objects:
    return generate("vehicle", trials, seed=seed)


def _cube(**settings: Any) -> Callable[[int, int], Objects]:
    return lambda trials, seed: generate("cube", trials, seed=seed, **settings)


def _cars(modes: int) -> Callable[[int, int], Objects]:
    return lambda trials, seed: cars(modes, trials, seed)


def races() -> tuple[Race, ...]:
    """Everything that is timed against something else."""
    others = tuple(one for one in contenders("bench") if one.name != DEFAULT.name)
    found = [Race("vehicles", "vehicles", 0, "V1", _vehicles, DEFAULT, others)]
    for n in KEYPOINTS:
        scenes = _cube(n_points=n, outlier_ratio=KEYPOINTS_OUTLIERS)
        found.append(Race(f"keypoints/{n}", "keypoints", n, f"{n} keypoints", scenes, DEFAULT, others))
    for percent in PERCENTS:
        ratio = percent / 100
        name, scenes, label = f"outliers/{percent}", _cube(outlier_ratio=ratio), f"E1, {percent} % outliers"
        found.append(Race(name, "outliers", percent, label, scenes, DEFAULT, others, outlier_ratio=ratio))
    for m in MODES:
        label = f"{CAR_KEYPOINTS} keypoints, M = {m}"
        found.append(Race(f"shape/{m}", "shape", m, label, _cars(m), DEFAULT, others))
    label = f"{CAR_KEYPOINTS} keypoints, M = 5, HRE"
    found.append(Race("hre/5", "shape", 5, label, _cars(5), _HRE, (POSELIB_TUNED, _WITH_PRIOR)))
    found += [_batch(size) for size in BATCHES]
    found.append(Race("stages/0", "stages", 0, "V1", _vehicles, DEFAULT, STAGES))
    found.append(Race("stages/5", "stages", 5, "V1-like, M = 5", _cars(5), DEFAULT, STAGES))
    return tuple(found)


def _batch(size: int) -> Race:
    """Calls with so many objects, on one thread and on two."""
    one = replace(DEFAULT, batch=size)
    rest: tuple[Contender, ...] = (replace(one, name=TWO_THREADS, threads=2), POSELIB_TUNED)
    label, chunk = f"{size:,} object{'s' * (size > 1)} per call", max(size, CHUNK)
    return Race(f"batch/{size}", "batch", size, label, _vehicles, one, rest, chunk=chunk, whole=True)


def cases() -> tuple[Case, ...]:
    """All of them, in the order in which they are measured."""
    raced = tuple(Case(race.id, race.group, race.run) for race in races())
    return (
        Case("machine", "machine", special.machine),
        *raced,
        Case("overhead", "overhead", special.overhead),
        Case("instructions", "instructions", sources.instructions),
        Case("native", "native", sources.native),
    )


def chosen(only: str, instructions: bool = False, native: bool = False) -> list[Case]:
    """Cases of groups or with ids, comma separated; "" is every group that builds nothing.

    ValueError for a name that is neither.
    """
    every = cases()
    wanted = [name.strip() for name in only.split(",") if name.strip()]
    known = {*GROUPS, *BUILT, *(case.id for case in every)}
    if unknown := [name for name in wanted if name not in known]:
        groups = ", ".join([*GROUPS, *BUILT])
        raise ValueError(f"--only: expected some of {groups} or a case like outliers/50, got {unknown[0]!r}")
    wanted = wanted or list(GROUPS)
    wanted += ["instructions"] * instructions + ["native"] * native
    return [case for case in every if case.group in wanted or case.id in wanted]
