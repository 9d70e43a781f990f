"""A race: one of our methods against others on the same objects, pair by pair in turns, all checked first."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from groundpose.lab.contenders.contender import Contender, errors, seconds_of
from groundpose.lab.contenders.objects import Array, Objects
from groundpose.lab.timing import CHUNK, Clock, clocked, in_chunks, interleaved, median_interval, quartiles

MOST_FAILURES = 0.5
"""Fraction of objects with e_r > 10 deg or e_t > 10 %: whoever fails more often is not timed at all."""

Tell = Callable[[str], None]


class WrongAnswer(AssertionError):
    """Our own poses are not those of the truth: nothing about them is worth timing."""


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    seed: int = 0
    objects: int = 1000
    """Most objects a contender is checked on."""
    rounds: int = 60
    """Most turns of a pair."""
    fewest: int = 7
    """Fewest turns of a pair: six give a 95 % interval of a median."""
    seconds: float = 5.0
    """Time for a check or for a pair, unless the fewest turns take longer."""
    chunk_seconds: float = 0.5
    """Longest turn of a contender; slower ones get fewer objects in a turn, and so has ours against them."""
    largest_batch: int = 10_000
    quick: bool = False


QUICK = Effort(objects=8, rounds=2, fewest=2, seconds=0.02, chunk_seconds=0.01, largest_batch=40, quick=True)
"""Whether everything runs, not how fast: for tests."""
QUICK_SECONDS = {"machine": 6.0, "instructions": 600.0, "native": 300.0}
"""What such a case takes on two slow cores: those that are no races; the last two build and count."""
QUICK_RACE = 1.0
"""What a race then takes, most of it the making of objects and the import of libraries."""


def quick_seconds(groups: Iterable[str]) -> float:
    """What a quick run of cases of these groups takes."""
    return sum(QUICK_SECONDS.get(group, QUICK_RACE) for group in groups)


@dataclass(frozen=True)
class Race:
    """What is raced."""

    id: str
    group: str
    x: float
    """What varies within the group."""
    label: str
    scenes: Callable[[int, int], Objects]
    """(number of objects, seed) to objects."""
    reference: Contender
    others: tuple[Contender, ...]
    chunk: int = CHUNK
    """Objects of a turn."""
    whole: bool = False
    """Turns are never cut short: the number of objects is what the race is about."""
    outlier_ratio: float = 0.0

    def run(self, effort: Effort, tell: Tell) -> dict[str, Any]:
        """Check everybody, then time every other against the reference. WrongAnswer when ours are wrong."""
        chunk = min(self.chunk, effort.largest_batch)
        scenes = self.scenes(max(min(effort.objects, 20 * chunk), chunk), effort.seed)
        tell(self.reference.name)
        pace, ours = check(self.reference, scenes, effort)
        if ours["failures %"] > 100 * MOST_FAILURES:
            raise WrongAnswer(f"{self.id}: {self.reference.name} fails on {ours['failures %']:.0f} %")
        lines, left_out, own_times = [], {}, []
        for other in self.others:
            tell(other.name)
            if reason := self._absent(other):
                left_out[other.name] = reason
                continue
            its_pace, accuracy = check(other, scenes, effort)
            if accuracy["failures %"] > 100 * MOST_FAILURES:
                left_out[other.name] = f"fails on {accuracy['failures %']:.0f} % of {accuracy['objects']}"
                continue
            size = chunk if self.whole else turn(chunk, max(pace, its_pace), effort)
            seconds = self._pair(other, scenes, size, size * (pace + its_pace), effort)
            if size == chunk:
                own_times.append(seconds[0])
            lines.append({"method": other.name, "objects a turn": size} | compared(*seconds) | accuracy)
        if not own_times:
            own_times = [self._pair(None, scenes, chunk, chunk * pace, effort)[0]]
        mine = (
            {"method": self.reference.name, "objects a turn": chunk} | timed(np.concatenate(own_times)) | ours
        )
        return {
            "group": self.group,
            "x": self.x,
            "label": self.label,
            "lines": [mine, *lines],
            "left out": left_out,
        }

    def _absent(self, other: Contender) -> str | None:
        if other.slow_with_outliers and self.outlier_ratio >= 0.7:
            return "needs a fifth of a second and more per call with so many outliers"
        return other.missing()

    def _pair(
        self, other: Contender | None, scenes: Objects, size: int, seconds: float, effort: Effort
    ) -> list[Array]:
        """Seconds per object of the reference and of the other, turn by turn."""
        rounds = int(np.clip(effort.seconds / max(seconds, 1e-9), effort.fewest, effort.rounds))
        chunks = list(itertools.islice(itertools.cycle(in_chunks(scenes, size)), rounds))
        racing = {"reference": self.reference} | ({} if other is None else {"other": other})
        timed = {name: partial(seconds_of, one) for name, one in racing.items()}
        return list(interleaved(chunks, timed).values())


def turn(chunk: int, pace: float, effort: Effort) -> int:
    """Objects of a turn that does not take too long for the slower of two, given its seconds per object."""
    return int(np.clip(effort.chunk_seconds / max(pace, 1e-9), 1, chunk))


def check(contender: Contender, scenes: Objects, effort: Effort) -> tuple[float, dict[str, Any]]:
    """Seconds per object, roughly, and accuracy on as many objects as time allows."""
    seconds_of(contender, scenes[:1])  # imports
    few = scenes[:3]
    pace = clocked(lambda: contender.solve(few, Clock())) / len(few)
    count = int(np.clip(effort.seconds / max(pace, 1e-9), 3, min(effort.objects, len(scenes))))
    some = scenes[:count]
    found = errors(some, contender.solve(some, Clock()))
    pace = min(pace, seconds_of(contender, few) / len(few))
    return pace, {
        "objects": count,
        "mean e_r deg": found.mean_e_r_deg,
        "median e_r deg": found.median_e_r_deg,
        "mean e_t %": found.mean_e_t_percent,
        "failures %": 100 * found.failures,
    }


def timed(seconds: Array) -> dict[str, Any]:
    """Microseconds per object."""
    return {"us": 1e6 * float(np.median(seconds)), "us quartiles": quartiles(1e6 * seconds)}


def compared(reference: Array, other: Array) -> dict[str, Any]:
    """The other's time, and how many times the reference's it is, turn by turn on the same objects."""
    ratio = other / reference
    return timed(other) | {
        "times ours": float(np.median(ratio)),
        "times ours, quartiles": quartiles(ratio),
        "times ours, 95 %": median_interval(ratio),
        "turns": len(ratio),
    }
