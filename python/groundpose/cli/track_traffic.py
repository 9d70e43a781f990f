"""`groundpose track --counts --summary`: who crosses lines and lanes, as tables."""

from __future__ import annotations

import math
from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from groundpose._checks import input_error
from groundpose._writing import whole_file
from groundpose.cli.track_output import OpenFrames
from groundpose.formats.site import Site
from groundpose.formats.traffic import crossing_head, crossing_lines, flow_head, flow_lines
from groundpose.tracking import Tracks
from groundpose.traffic import Crossing, CrossingCounter, TrafficSummary
from groundpose.world import World


@dataclass(frozen=True)
class Tables:
    """What the command line says: files, and seconds of an interval."""

    counts: Path | None
    summary: Path | None
    every: float | None

    def check(self, site: Site) -> None:
        """Refuse tables without anything to count, and intervals without a table."""
        for option, path in (("--counts", self.counts), ("--summary", self.summary)):
            if path is not None and not (site.lines or site.lanes):
                raise input_error(option, "lines or lanes, of --lanes or --world", "none")
        if self.every is not None and self.summary is None:
            raise input_error("--every", "--summary, whose intervals it gives", "none")
        if self.every is not None and not 0.0 < self.every < math.inf:
            raise input_error("--every", "seconds above 0", self.every)

    def open(self, stack: ExitStack, site: Site, frames: OpenFrames) -> list[TrafficTables]:
        """The tables that are wanted, whose files are whole when `stack` ends. Raises OSError."""
        streams = [
            None if path is None else stack.enter_context(whole_file(path))
            for path in (self.counts, self.summary)
        ]
        if streams == [None, None]:
            return []
        counter, (counts, summary) = CrossingCounter(site.lines, site.lanes), streams
        return [TrafficTables(counter, frames, site.world, counts, summary, self.every)]


class TrafficTables:
    """Crossings and flows on their way to files."""

    def __init__(
        self,
        counter: CrossingCounter,
        frames: OpenFrames,
        world: World | None,
        counts: IO[str] | None,
        summary: IO[str] | None,
        every: float | None,
    ) -> None:
        """Begin the tables that are wanted. Raises InputError."""
        self.counter, self.frames, self.world = counter, frames, world
        self._counts, self._flows = counts, summary
        self._summary = TrafficSummary(counter, every)
        self._times: deque[tuple[int, float]] = deque()
        self._noted = -1
        if counts is not None:
            counts.write(crossing_head(world))
        if summary is not None:
            summary.write(flow_head())

    def add(self, tracks: Tracks, complete: int) -> None:
        """More rows."""
        for number, time in self.frames.times.items():
            if number > self._noted:
                self._times.append((number, time))
                self._noted = number
        self._write(self.counter.add(tracks, complete))

    def close(self) -> None:
        """No more rows come."""
        self._write(self.counter.finish())
        if self._flows is not None:
            self._flows.write(flow_lines(self._summary.take(math.inf)))

    def _write(self, crossings: list[Crossing]) -> None:
        if self._counts is not None:
            self._counts.write(crossing_lines(crossings, self.world))
            self._counts.flush()
        until = -math.inf
        while self._times and self._times[0][0] <= self.counter.settled:
            until = self._times.popleft()[1]
            self._summary.watch(until)
        self._summary.add(crossings)
        if self._flows is not None:
            self._flows.write(flow_lines(self._summary.take(until)))
            self._flows.flush()
