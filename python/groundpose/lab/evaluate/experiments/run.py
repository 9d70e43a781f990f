"""Runs experiments: in parallel over settings and contenders, continuing what is stored."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from groundpose._writing import only_writer
from groundpose.lab import timing
from groundpose.lab.contenders.polish import solve_all
from groundpose.lab.contenders.use import batched
from groundpose.lab.evaluate.experiments import entry
from groundpose.lab.evaluate.experiments.outcome import numbers
from groundpose.lab.evaluate.experiments.settings import Setting, settings_of
from groundpose.lab.evaluate.experiments.store import Store
from groundpose.lab.processes import worker_pool

THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
REPEATS, LONG_ENOUGH = 3, 0.05
"""Batch calls of our core are timed so often, or until so many seconds; the median counts."""
Advance = Callable[[int, int, str], None]
"""Tasks finished, tasks in all, what was finished last."""


@dataclass(frozen=True)
class Task:
    """Contenders that run together in one setting."""

    setting: Setting
    group: str
    methods: list[str]
    """Names of those that are not finished yet."""


@dataclass(frozen=True)
class Measured:
    """What a worker sends back."""

    numbers: dict[str, Any]
    microseconds: dict[str, float]


def measure(task: Task, trials: int, seed: int) -> Measured:
    """One task, in this process."""
    everywhere = entry.everywhere()
    those = [batched(everywhere[name], timing.CHUNK) for name in task.methods]
    most = min(entry.trials_of(one, task.setting, trials) for one in those)
    scenes = task.setting.scenes(trials, seed)[:most]
    those[0].solve(scenes[:1], timing.Clock())  # imports, first allocations
    answers = solve_all(those, scenes, timing.Clock(repeats=REPEATS, enough=LONG_ENOUGH))
    return Measured(
        {name: numbers(scenes, found) for name, found in answers.items()},
        {name: timing.microseconds(found.seconds) for name, found in answers.items()},
    )


def tasks(store: Store, methods: dict[str, str]) -> list[Task]:
    """What is left to do."""
    found = []
    for setting in settings_of(store.experiment):
        groups: dict[str, list[str]] = {}
        for name, contender in entry.everywhere().items():
            if name in methods and not store.has(setting.key, name):
                groups.setdefault(entry.group_of(contender), []).append(name)
        found += [Task(setting, group, names) for group, names in groups.items()]
    return found


def select(experiment: str, methods: list[str] | None) -> dict[str, str]:
    """Methods to run: those of `methods` that the experiment has. ValueError for a name that nothing has."""
    known, everywhere = _notes(experiment), entry.everywhere()
    if methods is None:
        return known
    if unknown := [name for name in methods if name not in everywhere]:
        raise ValueError(f"methods: expected some of {'; '.join(everywhere)}, got {'; '.join(unknown)}")
    return {name: note for name, note in known.items() if name in methods}


def _notes(experiment: str) -> dict[str, str]:
    """{name: what it is}"""
    return {name: one.note for name, one in entry.contenders_of(experiment).items()}


def run(
    experiment: str,
    trials: int,
    seed: int,
    folder: Path,
    methods: list[str] | None = None,
    jobs: int = 1,
    fresh: bool = False,
    advance: Advance = lambda done, total, text: None,
) -> Store:
    """Measure what is missing of an experiment and store it after every task, in `jobs` processes.

    `fresh` measures finished methods again, those of `methods` only. Raises InputError when another run
    writes into the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with only_writer(folder):
        return _run(experiment, trials, seed, folder, methods, jobs, fresh, advance)


def _run(
    experiment: str,
    trials: int,
    seed: int,
    folder: Path,
    methods: list[str] | None,
    jobs: int,
    fresh: bool,
    advance: Advance,
) -> Store:
    """In a folder that is ours alone."""
    store = Store.open(folder, experiment, trials, seed)
    wanted = select(experiment, methods)
    if fresh:
        store.forget(list(wanted))
    keys = [s.key for s in settings_of(experiment)]
    left = tasks(store, wanted)
    advance(0, len(left), "")
    if not left:
        return store
    with _one_thread_each(), worker_pool(min(jobs, len(left))) as pool:
        futures: dict[Future[Measured], Task] = {pool.submit(measure, t, trials, seed): t for t in left}
        for done, future in enumerate(as_completed(futures), start=1):
            task, measured = futures[future], future.result()
            store.add(task.setting.key, measured.numbers, measured.microseconds)
            store.write(keys, wanted, _notes(experiment))
            advance(done, len(left), f"{task.setting.key}, {task.group}")
    return Store.read(store.path)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Workers inherit these; a linear algebra library reads them when it is first imported."""
    before = {name: os.environ.get(name) for name in THREAD_LIMITS}
    os.environ.update(dict.fromkeys(THREAD_LIMITS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
