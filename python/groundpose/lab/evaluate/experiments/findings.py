"""The paper's claims against stored results: each a sentence of the paper, a verdict and the numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from groundpose.lab.contenders.polish import GN, PNPS
from groundpose.lab.evaluate.experiments.series import MICROSECONDS, Array, Results
from groundpose.lab.evaluate.experiments.settings import BBOX_ERROR_KINDS, EXPERIMENTS, OUTLIERS

E_R, E_T, FAILURES = "mean_e_r_deg", "mean_e_t_percent", "failures"
WORDS = {E_R: "mean e_r", E_T: "mean e_t", FAILURES: "failures"}
P1P, P3P = "RNSC-P1P", "RNSC-P3P"
FLAT = 1.1
"""A curve is flat when its largest mean is at most this times its value without error."""
WORKS = 0.05
"""A method works in a setting when at most this fraction of trials fails."""
TIE = 1e-9
"""Numbers that are equal up to rounding are not worse than each other."""
NOT_COMPARED = ("oracle", "ours")
Lines = list[str]
Where = tuple[str, str, str]
"""Experiment, curve, outlier model."""


@dataclass(frozen=True)
class Finding:
    """One claim."""

    claim: str
    confirmed: bool | None
    """None: not enough was measured."""
    numbers: Lines


def _label(outliers: str) -> str:
    return "outliers in the image" if outliers == "image" else "outliers in the box"


def _pair(results: Results, where: Where, a: str, b: str, quantity: str) -> tuple[Array, Array, Array]:
    """x and the quantity of two methods where both have it."""
    x, first = results.curve(*where, a, quantity)
    _, second = results.curve(*where, b, quantity)
    both = np.isfinite(first) & np.isfinite(second)
    return x[both], first[both], second[both]


def _span(values: Array) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


def fewer_iterations(results: Results) -> Finding:
    """E1: iterations of the two searches."""
    numbers, verdicts = [], []
    for outliers in OUTLIERS:
        where = ("E1", "outlier_ratio", outliers)
        x, one, three = _pair(results, where, P1P, P3P, "mean_iterations")
        if not len(x):
            continue
        verdicts.append(bool(np.all(one < three)))
        numbers.append(
            f"{_label(outliers)}: {_span(one)} iterations against {_span(three)}; at {100 * x[-1]:.0f} % "
            f"{one[-1]:.1f} against {three[-1]:.0f}, a factor of {three[-1] / one[-1]:.0f}"
        )
    claim = "RNSC-P1P takes far fewer iterations than RNSC-P3P at every outlier ratio"
    return Finding(claim, all(verdicts) if verdicts else None, numbers)


def less_time(results: Results) -> Finding:
    """E1: time of the two searches, alone and with the same refinement."""
    numbers, verdicts = [], []
    for outliers in OUTLIERS:
        where = ("E1", "outlier_ratio", outliers)
        for suffix in ("", "+GN", "+HRE"):
            x, one, three = _pair(results, where, P1P + suffix, P3P + suffix, MICROSECONDS)
            if len(x):
                verdicts.append(bool(np.all(one < three)))
                ratio = three / one
                numbers.append(
                    f"{_label(outliers)}, time of {P3P}{suffix} / {P1P}{suffix}: {ratio.min():.2f} to "
                    f"{ratio.max():.0f}, {ratio[-1]:.0f} at {100 * x[-1]:.0f} %"
                )
    claim = "RNSC-P1P takes less time than RNSC-P3P at every outlier ratio, same scoring and refinement"
    return Finding(claim, all(verdicts) if verdicts else None, numbers)


def more_accurate(results: Results) -> Finding:
    """E1 and E2: one-point against three-point search, whatever follows."""
    numbers, better, total = [], 0, 0
    for outliers in OUTLIERS:
        for experiment, curve in (("E1", "outlier_ratio"), ("E2", "n_points")):
            for quantity in (E_R, E_T):
                ratios: list[float] = []
                for suffix in ("", *(f"+{p.name}" for p in (GN, *PNPS))):
                    where = (experiment, curve, outliers)
                    _, one, three = _pair(results, where, P1P + suffix, P3P + suffix, quantity)
                    ratios += list(one / three)
                wins = sum(ratio <= 1.0 for ratio in ratios)
                if ratios:
                    head = f"{experiment}, {_label(outliers)}, {WORDS[quantity]}"
                    pairs = f"{wins} of {len(ratios)} pairs"
                    numbers.append(f"{head}: better in {pairs}, median ratio {np.median(ratios):.2f}")
                better, total = better + wins, total + len(ratios)
    claim = "RNSC-P1P, alone and followed by any method, is more accurate than RNSC-P3P followed by the same"
    return Finding(claim, better >= 0.95 * total if total else None, numbers)


def reppnp_breaks(results: Results) -> Finding:
    """E1 and E2: where REPPnP stops working."""
    numbers: Lines = []
    verdicts: list[bool] = []
    for outliers in OUTLIERS:
        x, failures = results.curve("E1", "outlier_ratio", outliers, "REPPnP", FAILURES)
        n, failures_n = results.curve("E2", "n_points", outliers, "REPPnP", FAILURES)
        for name, values, at in (("outlier ratio", failures, x), ("points", failures_n, n)):
            if np.isfinite(values).any():
                text = ", ".join(f"{a:g}: {100 * v:.1f} %" for a, v in zip(at, values, strict=True))
                numbers.append(f"{_label(outliers)}, failures over {name}: {text}")
        if np.isfinite(failures).all() and np.isfinite(failures_n).all():
            verdicts.append(bool(np.all(failures[x > 0.5 + TIE] > WORKS)))
            verdicts.append(bool(np.all(failures_n[n < 200] > failures_n[n >= 200].max())))
    claim = "REPPnP frequently fails above 50 % outliers and with fewer than 200 points"
    return Finding(claim, all(verdicts) if verdicts else None, numbers)


@dataclass(frozen=True)
class Crossing:
    """E3 or E4: how far off pitch or box may be before P1P is no better than P3P."""

    experiment: str
    curve: str
    limit: float
    unit: str
    words: str

    def __call__(self, results: Results) -> Finding:
        """Better within the limit, worse beyond it; one step of the axis is left in doubt."""
        numbers, verdicts = [], []
        for outliers in OUTLIERS:
            for suffix in ("", "+GN"):
                where = (self.experiment, self.curve, outliers)
                x, one, three = _pair(results, where, P1P + suffix, P3P + suffix, E_R)
                if not len(x):
                    continue
                good = one <= three
                inside, outside = np.abs(x) <= self.limit, np.abs(x) > self.limit + 1.0
                verdicts.append(bool(good[inside].all() and not good[outside].any()))
                better = ", ".join(f"{v:g}" for v in x[good]) or "none"
                better_than = f"{P1P}{suffix} has a lower mean e_r than {P3P}{suffix}"
                numbers.append(f"{_label(outliers)}: {better_than} at errors of {better} {self.unit}")
        claim = (
            f"RNSC-P1P-based methods are better than RNSC-P3P-based ones while {self.words} is within "
            f"{self.limit:g} {self.unit}, and worse otherwise"
        )
        return Finding(claim, all(verdicts) if verdicts else None, numbers)


def hre_is_flat(results: Results) -> Finding:
    """HRE: how much the curves rise."""
    numbers, verdicts = [], []
    methods = ("RNSC-P1P+HRE", "RNSC-P1P+GN", "ours, default", "ours, no priors")
    for outliers in OUTLIERS:
        for curve in ("pitch_error_deg", *(f"bbox_error {kind}" for kind in BBOX_ERROR_KINDS)):
            rises = {}
            for method in methods:
                x, y = results.curve("HRE", curve, outliers, method, E_R)
                if np.isfinite(y).all():
                    rises[method] = float(y.max() / y[x == 0.0][0])
            if rises:
                text = ", ".join(f"{method} {rise:.2f}" for method, rise in rises.items())
                head = f"{curve.replace('_', ' ')}, {_label(outliers)}"
                numbers.append(f"{head}, largest mean e_r / that without error: {text}")
            if {"RNSC-P1P+HRE", "RNSC-P1P+GN"} <= set(rises):
                verdicts.append(rises["RNSC-P1P+HRE"] <= FLAT < rises["RNSC-P1P+GN"])
    claim = "RNSC-P1P+HRE is flat under pitch and box errors, RNSC-P1P+GN is not"
    return Finding(claim, all(verdicts) if verdicts else None, numbers)


def ours_is_best(results: Results) -> Finding:
    """E1 to E4: our default against every other method, setting by setting."""
    numbers, met = [], []
    for experiment in ("E1", "E2", "E3", "E4"):
        ours = "ours, no priors" if experiment in ("E1", "E2") else "ours, default"
        for quantity in (E_R, E_T, FAILURES):
            settings, lost = _lost(results, experiment, ours, quantity)
            if settings:
                met.append(not lost)
                head = f"{experiment}, {ours}, {WORDS[quantity]}: at or below every other contender in"
                numbers.append(f"{head} {settings - len(lost)} of {settings} settings" + _examples(lost))
    claim = (
        "Our default (E1 and E2: without priors) is at or below every other contender in mean e_r, mean "
        "e_t and failures in every setting"
    )
    return Finding(claim, all(met) if met else None, numbers)


def _lost(results: Results, experiment: str, ours: str, quantity: str) -> tuple[int, Lines]:
    """How many settings have our number, and those where another contender is lower, on fewer trials too."""
    count, lost = 0, []
    others = [m for m in results.methods(experiment) if not m.startswith(NOT_COMPARED)]
    for setting in EXPERIMENTS[experiment]:
        own = results.value(experiment, setting.key, ours, quantity)
        trials = results.value(experiment, setting.key, ours, "trials")
        if not np.isfinite(own):
            continue
        count += 1
        values = {m: results.value(experiment, setting.key, m, quantity) for m in others}
        numbers = {m: value for m, value in values.items() if math.isfinite(value)}
        if numbers and min(numbers.values()) < own - TIE:
            best = min(numbers, key=lambda m: numbers[m])
            count_best = results.value(experiment, setting.key, best, "trials")
            fewer = f" (its first {count_best:.0f} trials)" if count_best < trials else ""
            lost.append(f"{setting.key}: {own:.3g} against {numbers[best]:.3g} of {best}{fewer}")
    return count, lost


def _examples(lost: Lines, most: int = 6) -> str:
    if not lost:
        return ""
    more = f"; and {len(lost) - most} more" if len(lost) > most else ""
    return ". Not in: " + "; ".join(lost[:most]) + more


CLAIMS: dict[str, tuple[Callable[[Results], Finding], ...]] = {
    "E1 and E2: outlier ratio and number of points": (
        fewer_iterations,
        less_time,
        more_accurate,
        reppnp_breaks,
    ),
    "E3 and E4: pitch and box errors": (
        Crossing("E3", "pitch_error_deg", 1.5, "deg", "the pitch error"),
        Crossing("E4", "bbox_error shift", 2.0, "px", "the error of the box (both sides shifted)"),
        Crossing("E4", "bbox_error outward", 2.0, "px", "the error of the box (both sides outward)"),
    ),
    "Hierarchical robust estimation": (hre_is_flat,),
    "Our default": (ours_is_best,),
}
"""{section: claims}"""
