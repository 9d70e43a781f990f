"""Fair timing: contestants take turns on the same small chunks of work, so a machine's moods hit all."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from groundpose.evaluate.methods import Method
from groundpose.evaluate.rivals import Rival
from groundpose.evaluate.scenes import Array, Scenes

CHUNK = 50
"""Objects of one batch call: a busy image."""

Contestant = Callable[[Scenes], float]
"""Seconds it needed for the objects of a chunk."""


def ours(method: Method, threads: int = 1) -> Contestant:
    """The whole Python batch call; models and options exist before, as a user's do."""

    def contestant(scenes: Scenes) -> float:
        options, _ = method.options_for(scenes), scenes.models
        return _clocked(lambda: method.estimate(scenes, threads, options))

    return contestant


def rival(library: Rival) -> Contestant:
    """The library's own calls alone, without building its inputs: the time most in its favour."""
    return lambda scenes: sum(library.solve(scene).call_seconds for scene in scenes.singles)


def _clocked(call: Callable[[], Any]) -> float:
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
            "quartiles us": [1e6 * float(q) for q in np.percentile(values, [25, 75])],
            "ratio": float(np.median(values / seconds[reference])),
        }
        for name, values in seconds.items()
    ]
