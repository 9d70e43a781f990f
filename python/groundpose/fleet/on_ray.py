"""Parts by actors of a Ray cluster, or of one that is started here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from typing import Any

from groundpose._checks import input_error
from groundpose.fleet.parts import Part
from groundpose.fleet.pool import TRIES, Outcome, attempt
from groundpose.fleet.worker import EstimateFrames


def package() -> Any:
    """The package `ray`. Raises InputError when it is not installed."""
    try:
        return import_module("ray")
    except ModuleNotFoundError as error:
        raise input_error(
            "ray", "ray (pip install 'groundpose[fleet]')", f"no package {error.name}"
        ) from None


def on_ray(local: bool) -> Callable[[EstimateFrames, list[Part], int], Iterator[Outcome]]:
    """Actors of a cluster of their own (`local`), or of the one that is running: its machines share the
    folders."""
    return partial(_on_ray, local)


def _on_ray(local: bool, estimate: EstimateFrames, parts: list[Part], workers: int) -> Iterator[Outcome]:
    ray = package()
    try:
        ray.init(
            address="local" if local else "auto",
            num_cpus=workers if local else None,
            include_dashboard=False if local else None,
            log_to_driver=False,
            logging_level="error",
        )
    except ConnectionError as error:
        raise input_error("--ray auto", "a running Ray cluster", error) from None
    try:
        yield from _by_actors(ray, estimate, parts, workers)
    finally:
        ray.shutdown()


class _Worker:
    """An actor: a process with a network of its own."""

    def __init__(self, estimate: EstimateFrames) -> None:
        """Nothing is loaded yet."""
        self.estimate = estimate

    def attempt(self, part: Part) -> str | None:
        """Do a part; what is wrong with it."""
        return attempt(self.estimate, part)


def _by_actors(ray: Any, estimate: EstimateFrames, parts: list[Part], workers: int) -> Iterator[Outcome]:
    """Parts as they are done; Ray starts an actor that has ended again, and its part is tried again."""
    kind = ray.remote(num_cpus=estimate.threads, max_restarts=-1, max_task_retries=TRIES - 1)(_Worker)
    idle = [kind.remote(estimate) for _ in range(min(workers, len(parts)))]
    waiting, running = list(parts), dict[Any, tuple[Part, Any]]()
    while waiting or running:
        while waiting and idle:
            part, actor = waiting.pop(0), idle.pop()
            running[actor.attempt.remote(part)] = (part, actor)
        done, _ = ray.wait(list(running), num_returns=1)
        for answer in done:
            part, actor = running.pop(answer)
            idle.append(actor)
            try:
                said = ray.get(answer)
            except ray.exceptions.RayError as error:
                said = f"{part.source}: {str(error).strip().splitlines()[-1]}"
            yield part, said
