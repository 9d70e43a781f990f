"""Fair timing: contestants take turns on the same small chunks of work, so a machine's moods hit all.

The one place where pose estimation is timed: the tables of bars and `groundpose bench` both build on it.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from groundpose.lab.evaluate.methods import Method
from groundpose.lab.evaluate.rivals import Rival
from groundpose.lab.evaluate.scenes import Array, Scenes

CHUNK = 50
"""Objects of one batch call: a busy image."""

Contestant = Callable[[Scenes], float]
"""Seconds it needed for the objects of a chunk."""


def ours(method: Method, threads: int = 1, batch: int | None = None) -> Contestant:
    """The whole Python batch call; models and options exist before, as a user's do.

    `batch`: objects of a call; None: all objects of the chunk in one.
    """

    def contestant(scenes: Scenes) -> float:
        parts = [scenes] if batch is None else in_chunks(scenes, batch)
        options = [method.options_for(part) for part in parts]
        for part in parts:
            _ = part.models

        def calls() -> None:
            for part, its_options in zip(parts, options, strict=True):
                method.estimate(part, threads, its_options)

        return clocked(calls)

    return contestant


def rival(library: Rival) -> Contestant:
    """The library's own calls alone, without building its inputs: the time most in its favour."""
    return lambda scenes: sum(library.solve(scene).call_seconds for scene in scenes.singles)


def clocked(call: Callable[[], Any]) -> float:
    """Seconds of one call."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def interleaved(chunks: Sequence[Scenes], contestants: dict[str, Contestant]) -> dict[str, Array]:
    """Seconds an OBJECT of every contestant on every chunk, {name: (chunks,)}; order turns with the chunk."""
    seconds = {name: np.zeros(len(chunks)) for name in contestants}
    names = list(contestants)
    for chunk in chunks:  # build models and single scenes outside the clock
        _ = chunk.models, chunk.singles
    for contestant in contestants.values():  # imports, first allocations
        contestant(chunks[0][: min(5, len(chunks[0]))])
    gc.collect()
    gc.disable()
    try:
        for k, chunk in enumerate(chunks):
            for name in names[k % len(names) :] + names[: k % len(names)]:
                seconds[name][k] = contestants[name](chunk) / len(chunk)
    finally:
        gc.enable()
    return seconds


def in_chunks(scenes: Scenes, size: int = CHUNK) -> list[Scenes]:
    """Whole chunks of `size` objects (at least one, however small)."""
    count = max(len(scenes) // size, 1)
    return [scenes[k * size : (k + 1) * size] for k in range(count)]


def against(seconds: dict[str, Array], reference: str) -> list[dict[str, Any]]:
    """Median microseconds an object, and median over chunks of its time / the reference's on the same one."""
    return [
        {
            "method": name,
            "us an object": 1e6 * float(np.median(values)),
            "quartiles us": quartiles(1e6 * values),
            "ratio": float(np.median(values / seconds[reference])),
        }
        for name, values in seconds.items()
    ]


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
