"""Times of the laboratory: single calls, turns on the same objects, and their statistics."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
CHUNK = 50
"""Objects of one batch call: a busy image. Times are averaged over so many before a median is taken."""
Work = TypeVar("Work", bound="Sized")
Timed = Callable[[Any], float]
"""Seconds that were needed for the objects of a chunk."""


class Sized(Protocol):
    """Objects that can be cut into chunks."""

    def __len__(self) -> int:
        """Number of objects."""
        ...

    def __getitem__(self, rows: slice, /) -> Any:
        """The objects of a slice."""
        ...


class Clock:
    """Adds up the time of the calls that count; whatever happens between them does not."""

    def __init__(
        self, now: Callable[[], float] = time.perf_counter, repeats: int = 1, enough: float = math.inf
    ) -> None:
        """A clock at zero.

        Args:
            now: seconds; `time.thread_time` leaves out what else the machine does.
            repeats: batch calls are made so often, and the median counts; a short one is easily disturbed.
            enough: seconds after which a batch call is not repeated again.
        """
        self.seconds = 0.0
        self._now, self._repeats, self._enough = now, repeats, enough

    def __call__(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The function's answer; its time is added."""
        start = self._now()
        result = function(*arguments)
        self.seconds += self._now() - start
        return result

    def batch(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The answer of a batch call that may be repeated; its median time is added."""
        took: list[float] = []
        while not took or (len(took) < self._repeats and sum(took) < self._enough):
            start = self._now()
            result = function(*arguments)
            took.append(self._now() - start)
        self.seconds += float(np.median(took))
        return result


def thread_clock() -> Clock:
    """A clock of this thread's processor time."""
    return Clock(time.thread_time)


def clocked(call: Callable[[], Any]) -> float:
    """Seconds of one call."""
    clock = Clock()
    clock(call)
    return clock.seconds


def times_of(call: Callable[[], Any], most: int, enough: float = math.inf) -> list[float]:
    """Seconds of up to `most` calls, at least one, that together need `enough` seconds."""
    took = [clocked(call)]
    while len(took) < most and sum(took) < enough:
        took.append(clocked(call))
    return took


def shortest(call: Callable[[], Any], seconds: float) -> float:
    """Shortest time of the calls that fit into `seconds`: disturbances only ever add."""
    best, end = clocked(call), time.perf_counter() + seconds
    while time.perf_counter() < end:
        best = min(best, clocked(call))
    return best


def interleaved(chunks: Sequence[Sized], timed: Mapping[str, Timed]) -> dict[str, Array]:
    """Seconds per OBJECT on every chunk, {name: (chunks,)}.

    All take turns on the same chunks, and the order changes with the chunk, so that the machine's moods hit
    all alike.
    """
    seconds = {name: np.zeros(len(chunks)) for name in timed}
    names = list(timed)
    for one in timed.values():  # imports, first allocations
        one(chunks[0][: min(5, len(chunks[0]))])
    gc.collect()
    gc.disable()
    try:
        for k, chunk in enumerate(chunks):
            for name in names[k % len(names) :] + names[: k % len(names)]:
                seconds[name][k] = timed[name](chunk) / len(chunk)
    finally:
        gc.enable()
    return seconds


def in_chunks(objects: Work, size: int = CHUNK) -> list[Work]:
    """Whole chunks of `size` objects (at least one, however small)."""
    count = max(len(objects) // size, 1)
    return [objects[k * size : (k + 1) * size] for k in range(count)]


def against(seconds: dict[str, Array], reference: str) -> list[dict[str, Any]]:
    """Median microseconds per object, and median over chunks of the time / the reference's on the same."""
    return [
        {
            "method": name,
            "us per object": 1e6 * float(np.median(values)),
            "quartiles us": quartiles(1e6 * values),
            "ratio": float(np.median(values / seconds[reference])),
        }
        for name, values in seconds.items()
    ]


def microseconds(seconds: Array) -> float:
    """Median over chunks of the mean time per object, (N,) seconds: an interruption hits few chunks."""
    parts = np.array_split(seconds, max(len(seconds) // CHUNK, 1))
    return 1e6 * float(np.median([np.mean(part) for part in parts]))


def quartiles(values: Array) -> list[float]:
    """The first and the third."""
    return [float(q) for q in np.percentile(values, [25, 75])]


def median_interval(values: Array, confidence: float = 0.95) -> list[float]:
    """Interval that holds the true median with at least this probability, whatever the distribution.

    Between the order statistics k and n + 1 - k, k the largest with P(Binomial(n, 1/2) < k) at most half
    of what is left; the whole range where there are too few values (fewer than 6 for 95 %).
    """
    ordered, count = np.sort(values), len(values)
    below, k = 0.0, 0
    while k < count // 2:
        below += math.comb(count, k) * 0.5**count
        if below > 0.5 * (1.0 - confidence):
            break
        k += 1
    k = max(k, 1)
    return [float(ordered[k - 1]), float(ordered[count - k])]
