"""`groundpose track`: poses over time in, vehicles with their speeds out."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Annotated, cast

import typer
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from groundpose._checks import blamed, input_error
from groundpose._core import InputError
from groundpose._writing import whole_file
from groundpose.cli.box_choice import BoxChoice
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.crew import split
from groundpose.cli.inputs import NetworkFile, is_image, is_several
from groundpose.cli.output import complain, console, mistakes, refuse, say, standard_output
from groundpose.cli.track_input import Followed, Odometry, of_images, of_lines, pose_lines
from groundpose.formats.calibrations import read_calibration
from groundpose.formats.tracks import ENDINGS, FORMATS
from groundpose.tracking import Tracker, TrackOptions, Tracks
from groundpose.tracking.options import CameraMotion
from groundpose.types import View

_TAKE = 256
"""Frames after which finished rows are written."""
_NAMED = 5
"""Errors that are shown each; the others are counted."""


def track(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="INPUT",
            help="Poses that [bold]groundpose estimate[/bold] wrote (.jsonl), or - for standard input; or a "
            "folder of images or a video, with [bold]--boxes[/bold] or [bold]--detector[/bold].",
        ),
    ],
    camera: Annotated[
        Path,
        typer.Option(help="The camera and its tilt: a profile of groundpose calibrate, or any camera file."),
    ],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="File to write: .csv, .jsonl, or .txt for KITTI's format."),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help=f"{', '.join(FORMATS)}; default: by the ending of -o, else jsonl.")
    ] = "",
    fps: Annotated[
        float | None,
        typer.Option(help="Frames a second, of input without times.", show_default="the input's times"),
    ] = None,
    camera_motion: Annotated[
        str, typer.Option(help="static, or unknown: places and speeds are then relative to the camera.")
    ] = "static",
    odometry: Annotated[
        Path | None,
        typer.Option(
            help="How the camera moves: CSV with x, z (m) and heading (rad), a row per frame.", metavar="FILE"
        ),
    ] = None,
    boxes: Annotated[Path | None, typer.Option(help="2D boxes of images, as of estimate.")] = None,
    detector: Annotated[
        Path | None, typer.Option(help="Detector of 2D boxes (.onnx), as of estimate.")
    ] = None,
    network: NetworkFile = None,
    height: Annotated[
        float | None, typer.Option(help="Height of the camera, instead of the file's.", metavar="METRES")
    ] = None,
    draw: Annotated[
        Path | None,
        typer.Option(help="Pictures with trails and speeds; put {id} into the name.", metavar="FILE"),
    ] = None,
    birds_eye: Annotated[
        Path | None, typer.Option(help="Picture of all tracks from above (.png, .svg, .pdf).", metavar="FILE")
    ] = None,
    live: Annotated[
        bool,
        typer.Option(
            "--live", help="Write every frame's vehicles at once, not smoothed by what comes later."
        ),
    ] = False,
) -> None:
    """Follow vehicles over time: one identity, one size and one front each, with speeds.

    Rows are smoothed by later frames and come when a vehicle has left; with
    --live every frame's come at once. Frames that cannot be used are named
    and left out; what was found so far is written when it is interrupted.

    Exit status: 0 when all went well; 1 when some frames were bad (the
    others are done); 2 when the call was wrong and nothing was done.

    [bold]Examples[/bold]

      groundpose track poses.jsonl --camera camera.json --fps 10 -o tracks.csv

      groundpose track mast.mp4 --boxes boxes.json --camera camera.json -o tracks.csv --birds-eye tracks.png

      groundpose estimate frames.jsonl | groundpose track - --camera camera.json --fps 10 --live
    """
    with mistakes():
        view = read_calibration(camera)
        if height is not None:
            view = View(view.camera, view.pitch, view.roll, height)
        if fps is not None and not (fps > 0.0 and math.isfinite(fps)):
            raise input_error("--fps", "a number above 0", fps)
        motion = "odometry" if odometry is not None else camera_motion
        tracker = Tracker(view, TrackOptions(camera_motion=cast(CameraMotion, motion)))
        moves = None if odometry is None else Odometry(odometry)
        _spare((source, camera, boxes, odometry), (out, birds_eye))
        job = _Job(tracker, fps, moves, _format(form, out), live, view)
        job.pictures(draw, birds_eye)
        with _frames(source, view, camera, BoxChoice(boxes, detector, None), network, height) as frames:
            status = job.run(frames, out)
    raise typer.Exit(status)


def _format(form: str, out: Path | None) -> str:
    meant = "" if out is None else ENDINGS.get(out.suffix.lower(), "")
    if form and form not in FORMATS:
        raise input_error("--format", f"one of {', '.join(FORMATS)}", form)
    if out is not None and not form and not meant:
        raise input_error("-o", f"a file that ends in {', '.join(ENDINGS)}, or --format", out)
    return form or meant or "jsonl"


def _spare(inputs: tuple[Path | None, ...], outputs: tuple[Path | None, ...]) -> None:
    """Refuse to write onto an input."""
    for path in outputs:
        for given in inputs:
            if (
                path is not None
                and given is not None
                and path.exists()
                and given.exists()
                and path.samefile(given)
            ):
                refuse(f"{path}: is an input; give another name")


@contextmanager
def _frames(
    source: Path, view: View, camera: Path, found_by: BoxChoice, network: Path | None, height: float | None
) -> Iterator[Iterator[Followed | InputError]]:
    if found_by.boxes is None and found_by.detector is None and not is_image(source):
        with pose_lines(source, view) as lines:
            yield of_lines(lines, source.parent)
        return
    from groundpose.cli.images import ImageWork
    from groundpose.cli.run import Mounting
    from groundpose.frame import FramePriors
    from groundpose.keypoints.network import Network
    from groundpose.keypoints.pipeline import Pipeline

    found_by.check(source)
    frame = None if view.height is None else FramePriors()
    mounting = Mounting(view.pitch, view.roll, height, None, frame)
    crew, each = split(None, is_several(source))
    pipeline = Pipeline(Network(network, each))
    yield of_images(
        ImageWork(source, found_by, CameraChoice(camera), mounting, -math.inf, pipeline, crew=crew)
    )


@dataclass
class _Job:
    """Frames in, rows out."""

    tracker: Tracker
    fps: float | None
    odometry: Odometry | None
    form: str
    live: bool
    view: View
    names: dict[int, str | int] = field(default_factory=dict)
    bboxes: dict[tuple[int, int], tuple[float, ...]] = field(default_factory=dict)
    bad: list[InputError] = field(default_factory=list)
    left_out: int = 0
    rows: int = 0

    def pictures(self, draw: Path | None, birds_eye: Path | None) -> None:
        """What is drawn beside the rows."""
        from groundpose.draw.tracks import TrackMap, TrackPictures

        self.drawn = None if draw is None else TrackPictures(draw)
        self.map = None if birds_eye is None else TrackMap(birds_eye)

    def run(self, frames: Iterator[Followed | InputError], out: Path | None) -> int:
        """Follow, write, draw; the exit status."""
        status = 0
        with ExitStack() as stack:
            stream = standard_output() if out is None else stack.enter_context(whole_file(out))
            try:
                self._follow(frames, stream)
            except KeyboardInterrupt:
                complain(f"interrupted; frames followed: {self.tracker.frames}")
                status = 130
            if not self.live:
                self._write(self.tracker.finish(), stream)
            if not self.rows and self.form == "csv":
                stream.write(FORMATS["csv"](self.tracker.take()))
            if not self.tracker.frames and self.bad:
                raise self.bad[0]
        if self.map is not None:
            self.map.save()
        return status or self._report()

    def _follow(self, frames: Iterator[Followed | InputError], stream: IO[str]) -> None:
        with _progress(stream) as progress:
            task = progress.add_task("frames", total=None)
            for number, frame in enumerate(frames):
                try:
                    if isinstance(frame, InputError):
                        raise frame
                    now = self._next(number, frame)
                    if self.live:
                        self._write(now, stream)
                    if self.drawn is not None:
                        self.drawn.add(frame.id, frame.pixels(), frame.seen, now)
                except InputError as error:
                    self._complain(error)
                if not self.live and self.tracker.frames % _TAKE == 0:
                    self._write(self.tracker.take(), stream)
                elif self.live:
                    self.tracker.take()
                progress.advance(task)

    def _next(self, number: int, frame: Followed) -> Tracks:
        with blamed(frame.place):
            if frame.time is None and self.fps is None:
                raise input_error("--fps", "frames a second, for input without times", "none")
            time = number / self.fps if self.fps is not None else frame.time
            moved = None if self.odometry is None else self.odometry.moved(number)
            now = self.tracker.update(frame.seen, cast(float, time), moved)
        k = self.tracker.frames - 1
        self.names[k] = frame.id
        if self.form == "kitti":
            self.bboxes.update({(k, i): tuple(box) for i, box in enumerate(frame.seen.bboxes.tolist())})
        return now

    def _write(self, tracks: Tracks, stream: IO[str]) -> None:
        if self.map is not None:
            self.map.add(tracks)
        more = {"bboxes": self.bboxes, "view": self.view} if self.form == "kitti" else {}
        text = FORMATS[self.form](tracks, self.names, not self.rows, **more) if len(tracks) else ""
        self.rows += len(tracks)
        stream.write(text)
        stream.flush()

    def _complain(self, error: InputError) -> None:
        """Errors of an endless stream must not fill the memory."""
        if len(self.bad) < _NAMED:
            self.bad.append(error)
            complain(error)
        else:
            self.left_out += 1

    def _report(self) -> int:
        for reason, count in self.tracker.skipped.most_common():
            say(f"left out: {count} x {reason}")
        if self.left_out:
            complain(f"and {self.left_out} more frames left out")
        return 1 if self.bad else 0


def _progress(stream: IO[str]) -> Progress:
    err = console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.completed} frames"), TimeElapsedColumn())
    shown = err.is_terminal and not (stream is sys.stdout and stream.isatty())
    return Progress(*columns, console=err, disable=not shown, transient=True)
