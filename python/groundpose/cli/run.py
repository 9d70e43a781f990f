"""The loop of `groundpose estimate`: results written as they come, bad ones named and counted."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
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

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose.cli.learned import LearnedCamera
from groundpose.cli.output import Output, Pictures, complain, console
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
    """One frame, its poses, and its picture if that is at hand."""

    frame: Frame
    poses: PoseBatch
    image: NDArray[np.uint8] | None = None


class Work(Protocol):
    """What there is to do; iterating does it, one by one, and gives an InputError for a bad one."""

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

    def __iter__(self) -> Iterator[Result | InputError]:
        """Do it."""

    def remarks(self) -> list[str]:
        """What to say at the end."""


def run(work: Work, output: Output, pictures: Pictures | None) -> int:
    """Estimate, write, draw; returns the exit status."""
    done, errors = 0, []
    try:
        with _progress(work, output) as progress:
            task = progress.add_task(work.noun, total=work.total)
            for result in work:
                try:
                    if isinstance(result, InputError):
                        raise result
                    output.write(result.frame, result.poses)
                    if pictures is not None:
                        pictures.write(result.frame, result.poses, result.image)
                    done += 1
                except InputError as error:
                    errors.append(error)
                progress.advance(task)
    except KeyboardInterrupt:
        complain(f"interrupted; {work.noun} finished and written: {done}")
        return 130
    except BrokenPipeError:
        # The reader has enough. Keep Python from complaining when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    finally:
        output.close()
    return _report(work, done, errors)


def _progress(work: Work, output: Output) -> Progress:
    """What is done so far, on standard error, if that is a terminal and the results do not go there too."""
    err = console(stderr=True)
    count = [TextColumn(f"{{task.completed}} {work.noun}")]
    known = [TextColumn(work.noun), BarColumn(), MofNCompleteColumn()]
    columns = (SpinnerColumn(), *(count if work.total is None else known), TimeElapsedColumn())
    return Progress(*columns, console=err, disable=not err.is_terminal or output.on_terminal, transient=True)


def _report(work: Work, done: int, errors: list[InputError]) -> int:
    for error in errors:
        complain(error)
    for remark in work.remarks():
        console(stderr=True).print(remark, style="dim")
    if not errors:
        return 0
    if work.several:
        complain(f"{work.name}: {len(errors)} of {len(errors) + done} {work.noun} left out")
    return 1 if done else 2
