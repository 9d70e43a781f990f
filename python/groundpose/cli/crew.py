"""Threads that work ahead of who asks: answers come in the order of the items, and few wait at a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as StillAtWork
from itertools import repeat
from types import TracebackType
from typing import Any

from groundpose._checks import cores
from groundpose._checks import threads as checked_threads

LOOK = 0.05
"""Seconds between two looks for Ctrl-C, which a waiting lock hides on Windows."""
MOST = 4
"""Images at work at once: that bounds memory, and few more threads than these find work beside the caller."""


class Crew:
    """So many threads, none with one: then the caller works, item by item, when they are asked for.

    An item that fails is its error from then on, which is passed on in its place like None, the item that is
    done already; so that whatever came before it comes out first.
    """

    def __init__(self, threads: int) -> None:
        """They start when they are needed."""
        self.threads = threads
        self._workers = ThreadPoolExecutor(threads) if threads > 1 else None
        self._reader = ThreadPoolExecutor(1) if threads > 1 else None
        self._closing: list[Callable[[], None]] = []
        self._over = False

    def __enter__(self) -> Crew:
        """Itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        """What has not begun is not done; what has is waited for."""
        self._over = True
        if self._workers is None or self._reader is None:
            return
        self._workers.shutdown(wait=False, cancel_futures=True)
        for close in self._closing:  # a file of a database is closed by the thread that reads it
            self._reader.submit(close)
        self._reader.shutdown()
        self._workers.shutdown()

    def ahead(self, work: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        """What `work` makes of each item, by all threads, as many items ahead as there are threads."""
        if self._workers is None:
            return (done(work, item) for item in items)
        return self._ahead(self._workers, work, iter(items))

    def beside(self, items: Iterable[Any]) -> Iterator[Any]:
        """The items of an iterator that takes time, all fetched by one thread. Raises what it raises."""
        if self._reader is None:
            return iter(items)
        fetched = iter(items)
        if isinstance(fetched, Generator):
            self._closing.append(fetched.close)
        one = self._ahead(self._reader, lambda _: (False, None) if self._over else _next(fetched), repeat(0))
        return self._until_end(one)

    @staticmethod
    def _until_end(fetched: Iterator[tuple[bool, Any]]) -> Iterator[Any]:
        for is_item, item in fetched:
            if is_item:
                yield item
            elif item is None:
                return
            else:
                raise item

    def _ahead(
        self, pool: ThreadPoolExecutor, work: Callable[[Any], Any], items: Iterator[Any]
    ) -> Iterator[Any]:
        waiting: deque[Future[Any]] = deque()
        for item in items:
            waiting.append(pool.submit(_kept, work, item))
            if len(waiting) > self.threads:
                yield _answer(waiting.popleft())
        while waiting:
            yield _answer(waiting.popleft())


def split(threads: int | None, several: bool) -> tuple[int, int]:
    """Images at work at once, and threads for each; `threads` in all, None: all cores."""
    every = checked_threads(threads) or cores()
    at_once = min(every, MOST) if several else 1
    return at_once, every // at_once


def done(work: Callable[[Any], Any], item: Any) -> Any:
    """What `work` makes of an item, or the error; None and errors stay what they are."""
    if item is None or isinstance(item, BaseException):
        return item
    try:
        return work(item)
    except Exception as error:
        return error


def _next(items: Iterator[Any]) -> tuple[bool, Any]:
    """Whether there is one more, and it; else None, or what is raised instead."""
    try:
        return True, next(items)
    except StopIteration:
        return False, None
    except BaseException as error:
        return False, error


def _kept(work: Callable[[Any], Any], item: Any) -> Any:
    """The same in a thread, where nobody would see what is raised."""
    try:
        return done(work, item)
    except BaseException as error:
        return error


def _answer(future: Future[Any]) -> Any:
    while True:
        try:
            return future.result(LOOK)
        except StillAtWork:
            continue
