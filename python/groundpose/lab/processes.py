"""Worker processes of the laboratory: they end with the process that started them, however that ends."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from typing import Any

from groundpose._checks import cores, input_error


@contextmanager
def worker_pool(
    jobs: int, begin: Callable[..., None] | None = None, arguments: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Processes that work until the block ends; an error in it, Ctrl-C too, ends them at once.

    Args:
        jobs: how many processes, at most one for each core.
        begin: called in each of them first, with `arguments`.

    Raises:
        InputError: the system has ended one of them.
    """
    others = set(active_children())
    # not forked: threads and contexts of other libraries do not survive that
    context = get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, cores()), context, _begin, (begin, arguments))
    try:
        yield pool
        pool.shutdown()
    except BrokenProcessPool:
        expected = "as many processes as memory allows"
        raise input_error("jobs", expected, f"{jobs}; one was ended") from None
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(active_children()) - others:
            child.terminate()  # their work is no longer needed
        raise


def _begin(begin: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process; the parent handles it
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if begin is not None:
        begin(*arguments)


def _end_with_parent() -> None:
    """Wait for the parent's end on the pipe that only the parent holds open."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
