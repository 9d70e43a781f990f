"""Who takes part in an experiment, in which tasks, and on how many of its trials."""

from __future__ import annotations

from groundpose.lab.contenders.contender import Contender
from groundpose.lab.contenders.polish import Polished
from groundpose.lab.contenders.registry import EXPERIMENTS, installed
from groundpose.lab.evaluate.experiments.settings import Setting

# most trials from a fraction of outliers on: 5-point kernels of OpenCV need 17 ms per object at a half, 0.2 s
# at 0.7; its P3P 0.15 s at 0.9
CAPS_SLOW = ((0.8, 20), (0.6, 30), (0.45, 200))
CAPS = {"OpenCV P3P + LM": ((0.85, 100),)}
# E2 to E4 have the same fraction of outliers in 88 settings: contenders of 7 ms and more get fewer trials
OFTEN, FEW = "OpenCV", 200


def contenders_of(experiment: str) -> dict[str, Contender]:
    """{name: contender} of all that can run here and belong to the experiment."""
    return {one.name: one for one in installed(experiment)}


def everywhere() -> dict[str, Contender]:
    """{name: contender} of all experiments."""
    return {name: one for e in (*EXPERIMENTS, "HRE", "quick") for name, one in contenders_of(e).items()}


def group_of(contender: Contender) -> str:
    """The task in which it runs: those that share a search are in one, so that the search runs once."""
    return contender.search.name if isinstance(contender, Polished) else contender.name


def trials_of(contender: Contender, setting: Setting, trials: int) -> int:
    """Fewer at high fractions of outliers for the slow ones."""
    if contender.name.startswith(OFTEN) and setting.curve != "outlier_ratio":
        trials = min(trials, FEW)
    ratio = setting.options.get("outlier_ratio", 0.5)
    caps = CAPS_SLOW if contender.slow_with_outliers else CAPS.get(contender.name, ())
    return min([trials, *(cap for fraction, cap in caps if ratio >= fraction)])
