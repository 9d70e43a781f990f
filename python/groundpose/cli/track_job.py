"""The loop of `groundpose track`: frames in, rows out, bad frames named and counted."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import IO, cast

from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from groundpose._checks import blamed, input_error
from groundpose._core import InputError
from groundpose.cli.output import complain, console, say
from groundpose.cli.track_input import Followed, Odometry
from groundpose.cli.track_output import OpenFrames, Sink
from groundpose.draw.tracks import TrackPictures
from groundpose.tracking import Tracker, Tracks

INTERRUPTED = 130
"""Exit status."""
_TAKE = 256
"""Frames after which finished rows are written."""
_NAMED = 5
"""Errors that are shown each; the others are counted."""


@dataclass
class TrackJob:
    """A run.

    Args:
        tracker: that has seen nothing.
        sinks: what rows go to.
        frames: what the sinks know of frames.
        fps: times of frames, instead of their own.
        odometry: how the camera moves.
        live: rows come with their frame, not smoothed by what comes later.
        pictures: drawn frame by frame; None: none.
        goes_on: whether the same command goes on with a run that was interrupted.
    """

    tracker: Tracker
    sinks: list[Sink]
    frames: OpenFrames
    fps: float | None = None
    odometry: Odometry | None = None
    live: bool = False
    pictures: TrackPictures | None = None
    goes_on: bool = False
    bad: list[InputError] = field(default_factory=list)
    unnamed: int = 0

    def run(self, given: Iterator[Followed | InputError], stream: IO[str]) -> int:
        """Follow all frames; the exit status. `stream` is where rows go, for a terminal's progress.

        Raises the first error of a frame when no frame could be followed.
        """
        status = 0
        try:
            with _progress(stream) as progress:
                task = progress.add_task("frames", total=None)
                for number, frame in enumerate(given):
                    self._follow(number, frame)
                    progress.advance(task)
        except KeyboardInterrupt:
            goes_on = "; the same command goes on" if self.goes_on else ""
            complain(f"interrupted; frames followed: {self.tracker.frames}{goes_on}")
            status = INTERRUPTED
        if not self.tracker.frames and self.bad:
            raise self.bad[0]
        last = self.tracker.finish()
        if not self.live:
            self._hand_out(last)
        for sink in self.sinks:
            sink.close()
        return status or self._report()

    def _follow(self, number: int, frame: Followed | InputError) -> None:
        try:
            if isinstance(frame, InputError):
                raise frame
            now, time = self._next(number, frame)
            if self.live:
                self._hand_out(now)
            if self.pictures is not None:
                self.pictures.add(frame.id, time, frame.pixels(), frame.seen, now, frame.path)
        except InputError as error:
            self._complain(error)
        if self.live:
            self.tracker.take()  # what it would be smoothed
        elif self.tracker.frames % _TAKE == 0:
            self._hand_out(self.tracker.take())

    def _next(self, number: int, frame: Followed) -> tuple[Tracks, float]:
        with blamed(frame.place):
            if frame.time is None and self.fps is None:
                raise input_error("--fps", "frames a second, for input without times", "none")
            time = cast(float, number / self.fps if self.fps is not None else frame.time)
            moved = None if self.odometry is None else self.odometry.moved(number)
            now = self.tracker.update(frame.seen, time, moved)
        self.frames.note(self.tracker.frames - 1, frame, time)
        return now, time

    def _hand_out(self, tracks: Tracks) -> None:
        complete = self.tracker.frames if self.live else self.tracker.open_frame
        for sink in self.sinks:
            sink.add(tracks, complete)
        self.frames.forget(complete)

    def _complain(self, error: InputError) -> None:
        """Errors of an endless stream must not fill the memory."""
        if len(self.bad) < _NAMED:
            self.bad.append(error)
            complain(error)
        else:
            self.unnamed += 1

    def _report(self) -> int:
        for reason, count in self.tracker.skipped.most_common():
            say(f"left out: {count} x {reason}")
        if self.unnamed:
            complain(f"and {self.unnamed} more frames left out")
        return 1 if self.bad else 0


def _progress(stream: IO[str]) -> Progress:
    err = console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.completed} frames"), TimeElapsedColumn())
    shown = err.is_terminal and not (stream is sys.stdout and stream.isatty())
    return Progress(*columns, console=err, disable=not shown, transient=True)
