"""A folder of frames to a folder of poses, by some engine: what is missing is done, the rest is left."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

from groundpose._writing import only_writer
from groundpose.fleet.on_ray import on_ray
from groundpose.fleet.parts import Part, claim, counts_of, parts_of
from groundpose.fleet.pool import Outcome, in_processes, in_this_process
from groundpose.fleet.worker import FRAMES_AT_ONCE, EstimateFrames

Engine = Callable[[EstimateFrames, list[Part], int], Iterator[Outcome]]
ENGINES = ("none", "local", "auto")
"""Own processes, a Ray cluster that is started here, one that is running."""
_LEFT = ".groundpose-*.part"


@dataclass
class Report:
    """What a run did, and what the output holds now.

    Attributes:
        parts: how many there are. before: how many were done already. failed: what is wrong with parts.
        counts: "frames", "objects", "poses", "bad" of the output. new_frames: those of this run.
        seconds: of this run.
    """

    parts: int
    before: int
    failed: list[str] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    new_frames: int = 0
    seconds: float = 0.0


def engine_of(name: str, workers: int) -> Engine:
    """One of `ENGINES`."""
    if name == "none":
        return in_this_process if workers == 1 else in_processes
    return on_ray(name == "local")


def run(
    estimate: EstimateFrames,
    source: Path,
    out: Path,
    engine: Engine,
    workers: int,
    tell: Callable[[Part, int, int], None] = lambda part, done, parts: None,
) -> Report:
    """Estimate all parts whose outputs are not there yet. `tell` hears of each part that is done.

    Raises:
        InputError: no Parquet files, an output of another run, or one that another process writes. OSError.
    """
    parts = parts_of(source, out)
    claim(out, source, estimate)
    begun = time.monotonic()
    with only_writer(out):
        for left in out.rglob(_LEFT):  # of a run that was killed
            left.unlink(missing_ok=True)
        missing = [part for part in parts if not part.is_done()]
        report = Report(len(parts), len(parts) - len(missing))
        for number, (part, said) in enumerate(engine(estimate, missing, workers) if missing else (), 1):
            if said is None:
                report.new_frames += part.frames
            else:
                report.failed.append(said)
            tell(part, report.before + number, len(parts))
        report.seconds = time.monotonic() - begun
        report.counts = counts_of(parts)
    return report


@dataclass(frozen=True)
class Plan:
    """What a run would do: parts and how many of them are done, frames and bytes that are left, and seconds
    that a frame takes here."""

    parts: int
    done: int
    frames: int
    bytes: int
    frame_seconds: float

    def seconds(self, workers: int) -> float:
        """An estimate for the whole."""
        return self.frames * self.frame_seconds / workers


def plan(estimate: EstimateFrames, source: Path, out: Path) -> Plan:
    """Look at the input, and estimate some of its frames. Nothing is written. Raises OSError, InputError."""
    parts = parts_of(source, out)
    left = [part for part in parts if not part.is_done()]
    frames, size = sum(part.frames for part in left), sum(part.size for part in left)
    return Plan(len(parts), len(parts) - len(left), frames, size, _frame_seconds(estimate, left))


def _frame_seconds(estimate: EstimateFrames, parts: list[Part]) -> float:
    """Of the first frames, the second time: the first loads the network."""
    for part in parts:
        with import_module("pyarrow.parquet").ParquetFile(part.source, pre_buffer=False) as file:
            batch = next(file.iter_batches(FRAMES_AT_ONCE, [part.row_group]), None)
        if batch is not None and batch.num_rows:
            estimate(batch.slice(0, 1))
            begun = time.perf_counter()
            estimate(batch)
            return (time.perf_counter() - begun) / int(batch.num_rows)
    return 0.0
