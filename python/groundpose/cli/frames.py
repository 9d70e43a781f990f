"""Frames with keypoints: `groundpose estimate` reads them from lines."""

from __future__ import annotations

import sys
from collections.abc import Container, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from groundpose._checks import blamed
from groundpose._core import InputError
from groundpose.cli.output import refuse
from groundpose.cli.run import Mounting, Result
from groundpose.estimate import estimate_poses
from groundpose.formats.frames import Frame, FrameSource, named_images
from groundpose.formats.records import pose_record, tilt_members
from groundpose.options import Options
from groundpose.poses import PoseBatch


@dataclass
class FrameWork:
    """Frames with keypoints, estimated one after the other."""

    source: FrameSource
    options: Options
    threads: int | None
    mounting: Mounting
    finished: Container[int] = ()
    noun = "frames"
    total = None
    passed_over = 0

    @property
    def name(self) -> str:
        """Of the file, or standard input."""
        return self.source.name

    @property
    def several(self) -> bool:
        """Whether there may be more than one frame."""
        return self.source.several

    def __iter__(self) -> Iterator[Result | InputError | None]:
        """Frames in order; None for those that are finished."""
        for number, frame in enumerate(self.source):
            if number in self.finished:  # read all the same: later lines know its models
                yield None
                continue
            yield frame if isinstance(frame, InputError) else self._done(frame)

    def _done(self, frame: Frame) -> Result | InputError:
        try:
            with blamed(frame.place):
                tilted = replace(frame, view=self.mounting.of(frame.view))
                poses = estimate_poses(
                    **tilted.arguments,
                    options=self.options,
                    threads=self.threads,
                    **self.mounting.arguments(tilted.view),
                )
        except InputError as error:
            return error
        return Result(tilted, poses)

    def remarks(self) -> list[str]:
        """What was learned of the camera."""
        return self.mounting.remarks()


def tilted_record(frame: Frame, poses: PoseBatch) -> str:
    """With the tilt of the frame, which was estimated."""
    return pose_record(frame, poses, tilt_members(poses.view))


def images_of(source: Path, tables: bool) -> list[Path]:
    """The pictures that frames name; of a pipe nobody can tell before."""
    if tables:
        from groundpose.cli import tables as of_tables  # with the network and pyarrow

        return of_tables.named_images(source)
    return named_images(source) if source.is_file() else []


@contextmanager
def opened(frames: Path) -> Iterator[FrameSource]:
    """The frames of a file, or of standard input for `-`."""
    if str(frames) == "-":
        if sys.stdin is None:
            refuse("standard input is closed; give a file")
        yield FrameSource(sys.stdin.buffer, "standard input", Path())
        return
    with frames.open("rb") as stream:
        yield FrameSource(stream, str(frames), frames.parent)
