"""Stored results against a baseline: what changed beyond noise.

Both must have the same trials and seed, so scenes are the same and a difference is one of the code. A change
still reshuffles random samples; how much that moves a mean is bounded by the error of the mean over scenes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from groundpose.lab.evaluate.experiments.store import Store

STANDARD_ERRORS = 3.0
"""A mean differs when it moves by more than this many standard errors, and by RELATIVE."""
RELATIVE = 0.01
TIME_FACTOR = 1.5
"""A method is slower or faster when its relative time, median over settings, changes by more than this."""
TIME_REFERENCE = "REPPnP"
"""Relative to what times are compared: NumPy and deterministic work, so not a part of our core."""
MEANS = {"mean_e_r_deg": "error_of_mean_e_r_deg", "mean_e_t_percent": "error_of_mean_e_t_percent"}


@dataclass(frozen=True)
class Difference:
    """One number that changed."""

    experiment: str
    setting: str
    method: str
    what: str
    before: float
    after: float
    noise: float
    """Largest change that means nothing."""

    @property
    def beyond_noise(self) -> bool:
        """Whether it means something."""
        return abs(self.after - self.before) > self.noise

    @property
    def worse(self) -> bool:
        """Every number compared is better when it is smaller."""
        return self.beyond_noise and self.after > self.before


def compare(before: Store, after: Store) -> list[Difference]:
    """Every number that changed at all. ValueError when the two cannot be compared."""
    if (before.experiment, before.trials, before.seed) != (after.experiment, after.trials, after.seed):
        raise ValueError(
            f"{after.path}: expected {before.experiment} with {before.trials} trials and seed {before.seed}, "
            f"got {after.experiment} with {after.trials} trials and seed {after.seed}"
        )
    found = []
    for setting, methods in before.results.items():
        for method, old in methods.items():
            new = after.results.get(setting, {}).get(method)
            if new is not None and new["trials"] == old["trials"]:
                found += _cell((before.experiment, setting, method), old, new)
    return [d for d in [*found, *_times(before, after)] if d.before != d.after]


def _cell(where: tuple[str, str, str], old: dict[str, Any], new: dict[str, Any]) -> list[Difference]:
    """Mean errors and failures of one method in one setting."""
    found = []
    for mean, error in MEANS.items():
        noise = max(STANDARD_ERRORS * max(old[error], new[error]), RELATIVE * old[mean])
        found.append(Difference(*where, mean, old[mean], new[mean], noise))
    trials, failures = old["trials"], "failures"
    count = max(old[failures] * trials, 1.0)
    noise = STANDARD_ERRORS * float(np.sqrt(count)) / trials
    return [*found, Difference(*where, failures, old[failures], new[failures], noise)]


def _times(before: Store, after: Store) -> list[Difference]:
    """Relative times: the median over settings of each, so that a disturbed setting does not decide."""
    ratios: dict[str, list[tuple[float, float]]] = {}
    for setting, methods in before.microseconds.items():
        now = after.microseconds.get(setting, {})
        reference = methods.get(TIME_REFERENCE), now.get(TIME_REFERENCE)
        for method, old in methods.items():
            new = now.get(method)
            if old and new and reference[0] and reference[1] and method != TIME_REFERENCE:
                ratios.setdefault(method, []).append((old / reference[0], new / reference[1]))
    found = []
    for method, pairs in ratios.items():
        old, new = (float(np.median(column)) for column in zip(*pairs, strict=True))
        where = (before.experiment, "median over settings", method)
        found.append(Difference(*where, f"time / {TIME_REFERENCE}", old, new, (TIME_FACTOR - 1.0) * old))
    return found


def stored(folder: Path) -> dict[str, Store]:
    """{experiment: results} of a folder."""
    return {path.stem: Store.read(path) for path in sorted(folder.glob("*.json"))}


def compare_folders(baseline: Path, results: Path) -> list[Difference]:
    """All experiments both folders have. ValueError when there is none."""
    before, after = stored(baseline), stored(results)
    shared = [name for name in before if name in after]
    if not shared:
        raise ValueError(
            f"{results}: expected results of {', '.join(before) or 'a baseline'}, got none of them"
        )
    return [d for name in shared for d in compare(before[name], after[name])]
