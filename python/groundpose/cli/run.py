"""The loop of `groundpose estimate`: results written as they come, bad ones named and counted."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Container, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)

from groundpose._checks import blamed, input_error
from groundpose._core import InputError
from groundpose.cli.learned import LearnedCamera
from groundpose.cli.output import complain, console, say
from groundpose.cli.results import Output, Pictures
from groundpose.formats.frames import Frame
from groundpose.frame import FramePriors
from groundpose.poses import PoseBatch
from groundpose.types import View


@dataclass(frozen=True)
class Mounting:
    """Pitch and roll in radians and height in metres, instead of what files say; None: what they say.

    `frame_sigma` is how far off the tilt may be (standard deviation) for a whole frame, whose tilt is then
    estimated first; None: it is the frame's. With `frame` all vehicles of a frame stand on one road,
    with `learned` those of all frames before one camera. `view` is that of all frames, whatever files say.
    """

    pitch: float | None = None
    roll: float | None = None
    height: float | None = None
    frame_sigma: float | None = None
    frame: FramePriors | None = None
    learned: LearnedCamera | None = None
    view: View | None = None

    def of(self, view: View) -> View:
        """The view with what is said here."""
        view = view if self.view is None else self._profiled(view)
        pitch = view.pitch if self.pitch is None else self.pitch
        roll = view.roll if self.roll is None else self.roll
        return replace(
            view, pitch=pitch, roll=roll, height=view.height if self.height is None else self.height
        )

    def _profiled(self, view: View) -> View:
        """The profile's. Raises InputError for pictures of another size."""
        assert self.view is not None
        known, given = self.view.camera.image_size, view.camera.image_size
        if None not in (known, given) and known != given:
            raise input_error("--profile", f"pictures of {known}, as it was learned from", given)
        return self.view

    def arguments(self, view: View) -> dict[str, Any]:
        """For `estimate_poses` and `Pipeline` in this view."""
        frame = self.frame if self.learned is None else self.learned.of(view)
        return {"frame_tilt_sigma": self.frame_sigma, "frame": frame}

    def remarks(self) -> list[str]:
        """What to say at the end."""
        return [] if self.learned is None else self.learned.remarks()


@dataclass(frozen=True)
class Result:
    """One frame, its poses, its picture if that is at hand, and in how many boxes there is no vehicle."""

    frame: Frame
    poses: PoseBatch
    image: NDArray[np.uint8] | None = None
    no_vehicle: int = 0

    @property
    def vehicles(self) -> int:
        """How many there are."""
        return len(self.poses) - self.no_vehicle


class Work(Protocol):
    """What there is to do; iterating does it, one by one in the same order every time, and gives an
    InputError for a bad one."""

    finished: Container[int]
    """Numbers, from 0, of those that are done already: iterating gives None for them."""

    @property
    def name(self) -> str:
        """Of the input, for messages."""

    @property
    def noun(self) -> str:
        """What it consists of: frames, images."""

    @property
    def total(self) -> int | None:
        """How many; None: not known."""

    @property
    def several(self) -> bool:
        """Whether there may be more than one."""

    @property
    def passed_over(self) -> int:
        """How many objects were left out so far."""

    def __iter__(self) -> Iterator[Result | InputError | None]:
        """Do it."""

    def remarks(self) -> list[str]:
        """What to say at the end."""


@dataclass
class Tally:
    """What a run has done so far: `items` of the work, the vehicles in them and their poses, the errors, and
    what looks wrong in the inputs by its kind."""

    begun: float = field(default_factory=time.monotonic)
    items: int = 0
    vehicles: int = 0
    poses: int = 0
    errors: list[InputError] = field(default_factory=list)
    remarks: dict[str, list[str]] = field(default_factory=dict)

    def add(self, result: Result) -> None:
        """One item more."""
        self.items += 1
        self.vehicles += result.vehicles
        self.poses += int(result.poses.ok.sum())
        for remark in result.poses.remarks:
            kind = remark.partition(":")[0]
            self.remarks.setdefault(kind, []).append(f"{result.frame.place}: {remark}")

    def remark_lines(self, noun: str) -> list[str]:
        """The first remark of each kind, and how many more there are."""
        return [
            first + (f" (and {len(more)} more {noun})" if more else "")
            for first, *more in self.remarks.values()
        ]

    def line(self, noun: str, place: object) -> str:
        """The run in a line: `9 images, 46 vehicles, 45 poses, results/poses.jsonl, 0.9 s`."""
        counts = ((self.items, noun), (self.vehicles, "vehicles"), (self.poses, "poses"))
        parts = [counted(count, word) for count, word in counts]
        return ", ".join([*parts, str(place), f"{time.monotonic() - self.begun:.1f} s"])


def counted(count: int, noun: str) -> str:
    """`9 images`, `1 image`."""
    return f"{count} {noun if count != 1 else noun.removesuffix('s')}"


def run(work: Work, output: Output, pictures: Pictures | None, strict: bool = False) -> int:
    """Estimate, write, draw; returns the exit status."""
    tally = Tally()
    try:
        _go_on(work, output, tally)
        with _progress(work, output) as progress:
            task = progress.add_task(work.noun, total=work.total)
            for item, result in enumerate(work):
                if result is not None:
                    _keep(item, result, output, pictures, tally)
                progress.advance(task)
        output.complete()
    except KeyboardInterrupt:
        said, journal = output.interrupted(), output.journal
        # an item may be written whole and not yet be in the tally
        written = tally.items if journal is None else journal.items
        complain(f"interrupted; {work.noun} finished and written: {written}{said}")
        return 130
    except BrokenPipeError:
        # The reader has enough. Keep Python from complaining when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:  # a full disk, say
        with suppress(OSError):
            error.strerror = f"{error.strerror or error}{output.interrupted()}"
        raise
    finally:
        output.close()
    return _report(work, output, tally, strict)


def _go_on(work: Work, output: Output, tally: Tally) -> None:
    """Leave out what an interrupted run has finished, and say so."""
    journal = output.journal
    if journal is None:
        return
    if journal.dropped:
        say(f"{output.place}: begun anew: what is unfinished there is of another command or of other inputs")
    if journal.done:
        work.finished = journal.done
        tally.items, tally.vehicles, tally.poses = journal.items, journal.vehicles, journal.poses
        verb = "is" if journal.items == 1 else "are"
        say(f"{output.place}: going on: {counted(journal.items, work.noun)} {verb} finished")


def _keep(
    item: int, result: Result | InputError, output: Output, pictures: Pictures | None, tally: Tally
) -> None:
    """Write one result, or note what is wrong with it. What is computed is written even if its picture cannot
    be drawn."""
    if isinstance(result, InputError):
        tally.errors.append(result)
        return
    frame, poses, name = result.frame, result.poses, ""
    written = whole = False
    try:
        with blamed(frame.place, files=False):  # a disk that is full is so for all of them
            if output.named or pictures is not None:
                name = output.names.of(frame.id)
            output.write(frame, poses, name)
        written = True
        if pictures is not None:
            with blamed(frame.place):
                pictures.write(frame, poses, result.image, name)
        whole = True
    except InputError as error:
        tally.errors.append(error)
    if written:
        output.finished(item, result.vehicles, int(poses.ok.sum()), name)
    if whole:
        tally.add(result)


def _progress(work: Work, output: Output) -> Progress:
    """What is done so far, on standard error, if that is a terminal and the results do not go there too."""
    err = console(stderr=True)
    count = [TextColumn(f"{{task.completed}} {work.noun}")]
    known = [TextColumn(work.noun), BarColumn(), MofNCompleteColumn()]
    columns = (SpinnerColumn(), *(count if work.total is None else known), TimeElapsedColumn())
    return Progress(*columns, console=err, disable=not err.is_terminal or output.on_terminal, transient=True)


def _report(work: Work, output: Output, tally: Tally, strict: bool) -> int:
    """Say what is to be said; the exit status."""
    for error in tally.errors:
        complain(error)
    for remark in (*work.remarks(), *tally.remark_lines(work.noun)):
        say(remark)
    if tally.errors and work.several:
        bad = len(tally.errors)
        complain(f"{work.name}: {bad} of {bad + tally.items} {work.noun} left out")
    if tally.items and output.place is not None:
        say(tally.line(work.noun, output.place))
    if tally.errors:
        return 1 if tally.items else 2
    left_out = work.passed_over
    nothing = not tally.poses and tally.vehicles + left_out > 0
    return int(nothing or (strict and (left_out > 0 or tally.poses < tally.vehicles)))
