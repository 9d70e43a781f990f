"""Parts by processes of this machine. They end with the process that started them, however that ends."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context, parent_process

from groundpose._core import InputError
from groundpose.fleet.parts import Part, estimate_part
from groundpose.fleet.worker import EstimateFrames

TRIES = 3
"""Of a part during which workers end."""
Outcome = tuple[Part, str | None]
"""A part, and what went wrong with it."""


def in_this_process(estimate: EstimateFrames, parts: list[Part], workers: int) -> Iterator[Outcome]:
    """One part after the other."""
    for part in parts:
        yield part, attempt(estimate, part)


def in_processes(estimate: EstimateFrames, parts: list[Part], workers: int) -> Iterator[Outcome]:
    """Parts as they are done. A worker that the system ends is replaced, and its part tried again."""
    tries = dict.fromkeys(range(len(parts)), 0)
    while tries:
        others = set(active_children())
        # not forked: threads and contexts of other libraries do not survive that
        pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin)
        try:
            yield from _once(pool, estimate, parts, tries, workers)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in set(active_children()) - others:
                child.terminate()  # what it does is done anew


def _once(
    pool: ProcessPoolExecutor,
    estimate: EstimateFrames,
    parts: list[Part],
    tries: dict[int, int],
    workers: int,
) -> Iterator[Outcome]:
    """What is done until all is, or a worker ends; `tries` keeps what is left."""
    waiting, running = list(tries), dict[Future[str | None], int]()
    while waiting or running:
        while waiting and len(running) < workers:
            number = waiting.pop(0)
            running[pool.submit(attempt, estimate, parts[number])] = number
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            number = running.pop(future)
            try:
                said = future.result()
            except BrokenProcessPool:
                left = [number, *running.values()]
                yield from _given_up(left, parts, tries)
                return
            del tries[number]
            yield parts[number], said


def _given_up(left: list[int], parts: list[Part], tries: dict[int, int]) -> Iterator[Outcome]:
    """A worker has ended, the parts `left` were under way: those that have been so too often."""
    for number in left:
        tries[number] += 1
        if parts[number].is_done():  # it was the other one
            del tries[number]
            yield parts[number], None
        elif tries[number] >= TRIES:
            del tries[number]
            yield parts[number], f"{TRIES} times a worker was ended by the system (memory?) with this part"


def attempt(estimate: EstimateFrames, part: Part) -> str | None:
    """Do a part; what is wrong with it, in words."""
    try:
        estimate_part(estimate, part)
    except InputError as error:
        return f"{part.source}: {error}"
    except OSError as error:
        return f"{error.filename or part.source}: {error.strerror or error}"
    except MemoryError:
        return f"{part.source}: no memory"
    return None


def _begin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process; the parent handles it
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait for the parent's end on the pipe that only the parent holds open."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
