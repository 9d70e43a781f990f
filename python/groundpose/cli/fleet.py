"""`groundpose fleet`: folders of tables of frames to folders of tables of poses, by many workers."""

from __future__ import annotations

import time
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import Progress

from groundpose._checks import cores
from groundpose.cli.estimate import named_classes
from groundpose.cli.inputs import NetworkFile
from groundpose.cli.options import takes_options
from groundpose.cli.output import complain, mistakes, say, show
from groundpose.cli.progress import bar
from groundpose.cli.run import counted
from groundpose.frame import FramePriors
from groundpose.options import Options
from groundpose.sizes import REGIONS, SizePrior

if TYPE_CHECKING:
    from groundpose.fleet.parts import Part
    from groundpose.fleet.run import Plan, Report

app = typer.Typer(
    help="Millions of frames: tables in, tables out, by many workers.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


class Ray(str, Enum):
    """Which engine runs the workers."""

    NONE = "none"
    LOCAL = "local"
    AUTO = "auto"


@app.callback()
def _root() -> None:
    """Millions of frames: tables in, tables out, by many workers."""


@app.command()
@takes_options
def estimate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN", help="Parquet file of frames, or a folder of them (and of such folders)."
        ),
    ],
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="Folder of the poses: a new one, or one to go on with.")
    ],
    ray: Annotated[
        Ray,
        typer.Option(
            help="Who runs the workers: [bold]none[/bold], processes of this machine; [bold]local[/bold], Ray"
            " started here; [bold]auto[/bold], the Ray cluster that is running."
        ),
    ] = Ray.NONE,
    workers: Annotated[
        int | None, typer.Option(min=1, help="How many workers.", show_default="as many as cores here")
    ] = None,
    detector: Annotated[
        Path | None,
        typer.Option(help="For frames without boxes: a detector that was exported to ONNX.", metavar="FILE"),
    ] = None,
    detector_score: Annotated[
        float | None,
        typer.Option(min=0.0, max=1.0, help="Leave out what the detector is less sure of."),
    ] = None,
    network: NetworkFile = None,
    classes: Annotated[
        list[str] | None,
        typer.Option(
            help="What a name of the boxes' classes means.", metavar="NAME=CLASS", show_default=False
        ),
    ] = None,
    vehicle_threshold: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1.0,
            help="No pose for boxes whose probability to hold a vehicle is lower; 0: for all.",
            show_default="the network's",
        ),
    ] = None,
    region: Annotated[
        str | None,
        typer.Option(
            help=f"Where vehicles are as large as there: {', '.join(REGIONS)}; they then stand on one road.",
            metavar="NAME",
            show_default="every vehicle alone",
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say how much there is to do, and how long it takes.")
    ] = False,
    *,
    options: Options,
) -> None:
    """Estimate the poses of frames in Parquet files.

    A part is a row group of an input file; its output is written whole
    or not at all and is named by it, so that the same command goes on
    with what is missing. A frame that cannot be estimated is a row whose
    status says so.

    Exit status: 0 when all went well; 1 when a part failed or a frame
    was bad (the others are done); 2 when the call was wrong and nothing
    was done.

    [bold]Examples[/bold]

      groundpose fleet estimate frames/ poses/

      groundpose fleet estimate frames/ poses/ --ray local --workers 2

      groundpose fleet estimate frames/ poses/ --dry-run
    """
    with mistakes():
        from groundpose.fleet.run import engine_of, plan, run
        from groundpose.fleet.worker import EstimateFrames  # with the network and the vehicles' models

        worker = EstimateFrames(
            network=None if network is None else str(network),
            detector=None if detector is None else str(detector),
            detector_score=detector_score,
            options=options,
            vehicle_threshold=vehicle_threshold,
            classes=named_classes(classes or []),
            priors=None if region is None else FramePriors(size=SizePrior.region(region)),
            folder=str((source if source.is_dir() else source.parent).resolve()),
        )
        count = workers or cores()
        if network is not None or detector is not None:
            worker.load()  # what is wrong with them is said before any work
        if dry_run:
            _tell_plan(plan(worker, source, out), count)
            return
        try:
            with bar() as progress:
                report = run(worker, source, out, engine_of(ray.value, count), count, _Shown(progress))
        except KeyboardInterrupt:
            complain("interrupted; the same command goes on with the parts that are missing")
            raise typer.Exit(130) from None
    raise typer.Exit(_tell(report, out))


class _Shown:
    """Parts on a progress bar, with the throughput."""

    def __init__(self, progress: Progress) -> None:
        """Nothing is done yet."""
        self.progress, self.task = progress, progress.add_task("parts", total=None)
        self.begun, self.frames = time.monotonic(), 0

    def __call__(self, part: Part, done: int, parts: int) -> None:
        """One part more."""
        self.frames += part.frames
        rate = self.frames / (time.monotonic() - self.begun)
        said = f"parts, {rate:.1f} frames/s"
        self.progress.update(self.task, completed=done, total=parts, description=said)


def _tell_plan(found: Plan, workers: int) -> None:
    """What there is to do, in lines."""
    show(f"{counted(found.parts, 'parts')}, of which {found.done} are done")
    show(f"{counted(found.frames, 'frames')} to estimate, {found.bytes / 1e6:.1f} MB to read")
    each = f"{found.frame_seconds * 1e3:.2f} ms a frame, measured here"
    seconds = found.seconds(workers)
    show(f"{seconds:.0f} s with {counted(workers, 'workers')} like this machine's cores ({each})")


def _tell(report: Report, out: Path) -> int:
    """What was done, in a line; the exit status."""
    for line in report.failed:
        complain(line)
    counts = report.counts
    if counts["bad"]:
        bad = counted(counts["bad"], "frames")
        say(f"{bad} could not be estimated: rows with the status bad_frame in {out}")
    done = f"{report.parts - len(report.failed)} of {counted(report.parts, 'parts')}"
    if report.before:
        done += f" ({report.before} before)"
    rate = report.new_frames / report.seconds if report.seconds else 0.0
    words = [counted(counts[name], name) for name in ("frames", "objects", "poses")]
    say(", ".join([done, *words, str(out), f"{report.seconds:.1f} s", f"{rate:.1f} frames/s"]))
    return int(bool(report.failed or counts["bad"]))
