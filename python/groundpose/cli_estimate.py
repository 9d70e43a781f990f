"""`groundpose estimate`: frames in, poses out."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from groundpose._core import InputError, default_options
from groundpose.cli_output import FORMATS, Output, Pictures, complain, console, mistakes, refuse
from groundpose.formats.frames import Frame, FrameSource
from groundpose.types import Options

_DEFAULT = default_options()


def _option(name: str, text: str, metavar: str | None = None, *, shown: str | None = None) -> Any:
    """A command-line option for a field of `Options`; its default is the library's."""
    default = _DEFAULT[name]
    if shown is None:
        shown = {True: "on", False: "off"}[default] if isinstance(default, bool) else str(default)
    return typer.Option(help=text, metavar=metavar, show_default=shown, rich_help_panel="Method")


_TAUS = " ".join(f"{tau:g}" for tau in _DEFAULT["hre_thresholds"])


def estimate(
    frames: Annotated[
        Path,
        typer.Argument(
            metavar="FRAMES", help="One frame (.json), JSON lines (.jsonl), or - for standard input."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="File to write; a folder for KITTI text of several frames."),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help=f"{', '.join(FORMATS)}; default: table on a terminal, else jsonl.")
    ] = "",
    draw: Annotated[
        Path | None, typer.Option(help="Write a picture; with several frames put {id} into its name.")
    ] = None,
    pitch_deg: Annotated[
        float | None, typer.Option(help="Pitch of the camera, instead of the frames'.")
    ] = None,
    roll_deg: Annotated[
        float | None, typer.Option(help="Roll of the camera, instead of the frames'.")
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, show_default="all cores", help="Threads.")] = None,
    inlier_threshold: Annotated[
        float | None, _option("inlier_threshold", "Pixels, for all objects.", "PX", shown="by the box")
    ] = None,
    relative_threshold: Annotated[
        float | None,
        _option("relative_threshold", "Inlier threshold over the longer side of the box.", "SHARE"),
    ] = None,
    confidence: Annotated[
        float | None, _option("confidence", "Wanted probability of a good sample.", "P")
    ] = None,
    solver: Annotated[str | None, _option("solver", "auto, p1p, p3p, up2p or p1p_height.", "NAME")] = None,
    cases: Annotated[
        str | None, _option("cases", "Pairs of footprint corners: all or paper.", "NAME")
    ] = None,
    scoring: Annotated[str | None, _option("scoring", "msac or inliers.", "NAME")] = None,
    refinement: Annotated[str | None, _option("refinement", "default, hre, re, gn or none.", "NAME")] = None,
    hre_thresholds: Annotated[
        tuple[float, float, float] | None,
        _option("hre_thresholds", "tau 1, 2, 3 of hre over the inlier threshold.", "T T T", shown=_TAUS),
    ] = None,
    tilt_sigma_deg: Annotated[
        float | None,
        _option(
            "tilt_sigma", "Standard deviation of objects' lean; inf: free.", "DEG", shown="by refinement"
        ),
    ] = None,
    shape_prior: Annotated[
        bool | None, _option("shape_prior", "Pull shapes to the mean.", shown="by refinement")
    ] = None,
    bbox_sigma: Annotated[
        float | None,
        _option(
            "bbox_sigma", "Standard deviation of the box's sides; inf: not used.", "PX", shown="by refinement"
        ),
    ] = None,
    covariance: Annotated[bool | None, _option("covariance", "Compute covariances.")] = None,
    max_iterations: Annotated[
        int | None, _option("max_iterations", "Most samples for one object.", "N")
    ] = None,
    min_keypoints: Annotated[int | None, _option("min_keypoints", "Fewest keypoints seen.", "N")] = None,
    max_log10_nfa: Annotated[
        float | None, _option("max_log10_nfa", "Most false alarms to expect, log10; inf: any.", "X")
    ] = None,
    score_weights: Annotated[
        bool | None, _option("score_weights", "Weigh residuals by the keypoints' scores.")
    ] = None,
    seed: Annotated[int | None, _option("seed", "Of the random draws.", "N")] = None,
) -> None:
    """Estimate the poses of the objects of one frame or of many.

    Input is JSON: camera, tilt, models, and of each object its keypoints,
    box and model. A frame is written as soon as it is computed.

    Exit status: 1 when some lines of a JSON-lines file were bad (the
    others are done), 2 when nothing could be done.

    [bold]Examples[/bold]

      groundpose estimate frame.json

      groundpose estimate frame.json --draw poses.png --pitch-deg -1.5

      groundpose estimate drive.jsonl -o poses.jsonl

      groundpose estimate drive.jsonl --format kitti -o results/

      zcat drive.jsonl.gz | groundpose estimate - --refinement hre
    """
    typed = dict(locals())
    typed["tilt_sigma"] = None if tilt_sigma_deg is None else math.radians(tilt_sigma_deg)
    given = {name: typed[name] for name in _DEFAULT if typed[name] is not None}
    form = form or ("table" if out is None and sys.stdout.isatty() else "jsonl")
    if form not in FORMATS:
        refuse(f"--format: expected {', '.join(FORMATS)}, got {form!r}")
    with mistakes():
        options = Options(**given)
        job = _Job(options, threads, pitch_deg, roll_deg)
        with _open(frames, out) as source:
            pictures = Pictures(draw, source.several) if draw is not None else None
            status = job.run(source, Output(out, form, source.several), pictures)
    raise typer.Exit(status)


@contextlib.contextmanager
def _open(frames: Path, out: Path | None) -> Iterator[FrameSource]:
    if str(frames) == "-":
        yield FrameSource(sys.stdin.buffer, "standard input", Path())
        return
    if out is not None and out.exists() and frames.exists() and out.samefile(frames):
        refuse(f"-o {out}: is the input; give another name")
    with frames.open("rb") as stream:
        yield FrameSource(stream, str(frames), frames.parent)


@dataclasses.dataclass
class _Job:
    """One run over the frames of a source."""

    options: Options
    threads: int | None
    pitch_deg: float | None
    roll_deg: float | None

    def run(self, source: FrameSource, output: Output, pictures: Pictures | None) -> int:
        """Estimate, write, draw; returns the exit status."""
        done, errors = 0, []
        try:
            with _progress(output) as progress:
                task = progress.add_task("frames", total=None)
                for frame in source:
                    try:
                        if isinstance(frame, InputError):
                            raise frame
                        self._frame(frame, output, pictures)
                        done += 1
                    except InputError as error:
                        errors.append(error)
                    progress.advance(task)
        except KeyboardInterrupt:
            complain(f"interrupted; frames finished and written: {done}")
            return 130
        except BrokenPipeError:
            # The reader has enough. Keep Python from complaining when it flushes at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        finally:
            output.close()
        return _report(source, done, errors)

    def _frame(self, frame: Frame, output: Output, pictures: Pictures | None) -> None:
        view = frame.view
        if self.pitch_deg is not None or self.roll_deg is not None:
            pitch = view.pitch if self.pitch_deg is None else math.radians(self.pitch_deg)
            roll = view.roll if self.roll_deg is None else math.radians(self.roll_deg)
            frame = dataclasses.replace(frame, view=dataclasses.replace(view, pitch=pitch, roll=roll))
        poses = frame.estimate(self.options, self.threads)
        output.write(frame, poses)
        if pictures is not None:
            pictures.write(frame, poses)


def _progress(output: Output) -> Progress:
    """Frames done so far, on standard error, if that is a terminal and the results do not go there too."""
    err = console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.completed} frames"), TimeElapsedColumn())
    return Progress(*columns, console=err, disable=not err.is_terminal or output.on_terminal, transient=True)


def _report(source: FrameSource, done: int, errors: list[InputError]) -> int:
    for error in errors:
        complain(error)
    if not errors:
        return 0
    if source.several:
        complain(f"{source.name}: {len(errors)} of {len(errors) + done} frames left out")
    return 1 if done else 2
