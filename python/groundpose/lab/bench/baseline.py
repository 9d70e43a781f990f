"""A baseline to keep, and what has become worse than it.

Times of different machines do not compare, times relative to another library in the same process roughly do.
So a baseline holds, for every case, our time relative to the library to beat, our accuracy, and instruction
counts. What counts as a loss:

- **relative time**: more than 10 % above the baseline, with the whole 95 % interval of the median above that
  line. Turns of a pair are on the same objects, one right after the other, so the interval holds what noise
  does to the ratio; a median above the line with an interval that reaches below it is "unsure", which is said
  and is no loss. (A change of the other library's build or of the kind of processor moves the ratio too: a
  baseline belongs to a machine.)
- **accuracy**: one more failing object, or a mean error more than 0.2 % larger. The same seed gives the same
  objects and nothing is drawn at random besides, so there is no noise; 0.2 % is room for sums in another
  order, which move the last digits, and with them now and then the number of steps.
- **instructions**: more than 10 % more of a row. Counts repeat to the digit for one toolchain.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from groundpose._checks import input_error
from groundpose.lab.contenders.registry import TO_BEAT
from groundpose.lab.evaluate import report

MOST_LOSS = 1.10
"""Relative time, and instructions, at which a loss begins."""
ROUNDING = 1.002
"""Factor on a mean error that is no loss of accuracy."""
_ERRORS = ("mean e_r deg", "mean e_t %", "failures %")
_SAME = ("seed", "quick")

LOST, UNSURE, BETTER, SAME, GONE = "lost", "unsure", "better", "same", "not measured"


@dataclass(frozen=True)
class Difference:
    """One number against its baseline."""

    case: str
    what: str
    before: float
    now: float | None
    verdict: str


def of(content: dict[str, Any]) -> dict[str, Any]:
    """What is worth keeping of a finished run."""
    times, accuracy = {}, {}
    for name, case in content["cases"].items():
        lines = case.get("lines", [])
        for line in lines:
            if line["method"] == TO_BEAT:
                # ours / theirs: the interval turns around
                low, high = line["times ours, 95 %"]
                times[name] = {"relative time": 1.0 / line["times ours"], "95 %": [1.0 / high, 1.0 / low]}
        if lines:
            mine = lines[0]
            accuracy[name] = {key: mine[key] for key in ("objects", *_ERRORS)}
    counts = {
        f"{row['setting']}: {row['work']}": round(row["instructions"] / row["objects"])
        for row in content["cases"].get("instructions", {}).get("rows", ())
    }
    keys = (*_SAME, "machine", "versions")
    return {
        **{key: content[key] for key in keys},
        "reference": TO_BEAT,
        "times": times,
        "accuracy": accuracy,
        "instructions": counts,
    }


def save(content: dict[str, Any], path: Path) -> None:
    """Keep a run. Raises InputError when it holds nothing to compare with later."""
    kept = of(content)
    if not kept["times"] and not kept["accuracy"]:
        raise input_error("--save-baseline", "a run with timed cases", "none in it")
    report.write_json(path, kept)


def read(path: Path) -> dict[str, Any]:
    """A stored baseline. Raises InputError for another kind of file, OSError where there is none."""
    if not path.exists():
        raise FileNotFoundError(2, "no such file", str(path))
    kept = report.read_json(path)
    if not {"times", "accuracy", "instructions"} <= set(kept):
        raise input_error("--compare", "a file of --save-baseline", str(path))
    return kept


def compare(content: dict[str, Any], before: dict[str, Any], asked: set[str]) -> list[Difference]:
    """Every number of the baseline for the cases that were asked for, against the run's.

    Raises InputError when the run is of other objects, or shares no number with the baseline.
    """
    now = of(content)
    for key in _SAME:
        if now[key] != before[key]:
            raise input_error("--compare", f"a baseline with {key} {now[key]}", f"one with {before[key]}")
    found = [_time(n, b, now["times"].get(n)) for n, b in before["times"].items() if n in asked]
    for name, errors in before["accuracy"].items():
        if name in asked:
            found += _accuracy(name, errors, now["accuracy"].get(name))
    if "instructions" in asked:
        counts = now["instructions"]
        found += [_count(name, b, counts.get(name)) for name, b in before["instructions"].items()]
    if all(d.verdict == GONE for d in found):
        raise input_error("--compare", "a baseline that shares a case with this run", "none in common")
    return found


def _time(name: str, before: dict[str, Any], now: dict[str, Any] | None) -> Difference:
    what, was = f"time relative to {TO_BEAT}", before["relative time"]
    if now is None:
        return Difference(name, what, was, None, GONE)
    is_now, (low, high) = now["relative time"], now["95 %"]
    if is_now > MOST_LOSS * was:
        verdict = LOST if low > MOST_LOSS * was else UNSURE
    else:
        verdict = BETTER if high * MOST_LOSS < was else SAME
    return Difference(name, what, was, is_now, verdict)


def _accuracy(name: str, before: dict[str, Any], now: dict[str, Any] | None) -> list[Difference]:
    if now is None or now["objects"] != before["objects"]:
        return [Difference(name, "accuracy (other objects)", before["failures %"], None, GONE)]
    found = []
    for key in _ERRORS:
        was, is_now = before[key], now[key]
        room = 1.0 if key == "failures %" else ROUNDING
        verdict = LOST if is_now > room * was else BETTER if was > room * is_now else SAME
        found.append(Difference(name, key, was, is_now, verdict))
    return found


def _count(name: str, before: float, now: float | None) -> Difference:
    if now is None:
        return Difference(name, "instructions", before, None, GONE)
    verdict = LOST if now > MOST_LOSS * before else BETTER if now * MOST_LOSS < before else SAME
    return Difference(name, "instructions per object", before, now, verdict)
