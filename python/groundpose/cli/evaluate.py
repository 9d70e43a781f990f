"""`groundpose evaluate`: how well it works on real data, from a folder to numbers and a page."""

from __future__ import annotations

import os
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from groundpose.cli.destination import Inputs
from groundpose.cli.evaluate_lab import (
    detector,
    distance,
    honesty,
    networks,
    pages,
    real,
    shapes,
    silent,
    targets,
    tracks,
)
from groundpose.cli.evaluate_sets import apollo, bar, speed, tilt
from groundpose.cli.inputs import NetworkFile
from groundpose.cli.output import complain, console, mistakes, show

if TYPE_CHECKING:
    from groundpose.lab.evaluate.kitti.keypoints import KeypointSource

app = typer.Typer(
    help="How well it works on real data: a folder in, numbers, a page and pictures out.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


class Boxes(str, Enum):
    """Where 2D boxes come from."""

    LABELS = "labels"
    DETECTIONS = "detections"


class Keypoints(str, Enum):
    """Where keypoints come from."""

    NETWORK = "network"
    SIMULATED = "simulated"


class Models(str, Enum):
    """What is known of a vehicle's shape."""

    CLASS = "class"
    SIZED = "sized"
    RIGID = "rigid"


@app.command()
def kitti(
    root: Annotated[
        Path, typer.Option(help="Folder that holds training/ as KITTI unpacks it, or a table (.npz).")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="JSON file of the numbers.")],
    split: Annotated[
        Path | None, typer.Option(help="ImageSets file, an id a line; none: all labelled.")
    ] = None,
    boxes: Annotated[
        Boxes, typer.Option(help="2D boxes: those labelled or those of a detector.")
    ] = Boxes.LABELS,
    detections: Annotated[
        Path | None,
        typer.Option(help="Folder of a detector's KITTI result files; none: ROOT/training/detections."),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "-m",
            "--method",
            help="default, p1p+re, p1p+hre, p3p+re, p3p+hre ([bold]all[/bold]: these), default-cut, "
            "poselib or poselib-x4; repeat for more. A wrong name lists all.",
        ),
    ] = None,
    keypoints: Annotated[
        Keypoints,
        typer.Option(help="The network on the images, or simulated with a CNN's errors (needs no image)."),
    ] = Keypoints.NETWORK,
    network: NetworkFile = None,
    models: Annotated[
        Models,
        typer.Option(
            help="Known of simulated ones: the class, with its labelled size, or the rigid mean of that size."
        ),
    ] = Models.CLASS,
    class_name: Annotated[
        list[str] | None,
        typer.Option("--class", help="Car, Van or Truck; repeat for more. None: all three."),
    ] = None,
    pitch_deg: Annotated[float, typer.Option(help="Nominal pitch of the camera.")] = 0.0,
    frame_tilt_sigma_deg: Annotated[
        float | None,
        typer.Option(help="Standard deviation of a frame's tilt about the nominal one, to estimate it."),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            help="Height of the camera (1.65 for KITTI); all vehicles of a frame then stand on one road.",
            metavar="METRES",
        ),
    ] = None,
    region: Annotated[
        str | None,
        typer.Option(help="Where vehicles are as large as there: world, europe, ...; the same."),
    ] = None,
    min_score: Annotated[float, typer.Option(help="Leave out detections whose score is lower.")] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Of simulated keypoints.")] = 0,
    limit: Annotated[int | None, typer.Option(min=1, help="Only the first frames.")] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes; none: one a core, network: one.")
    ] = None,
    export: Annotated[
        Path | None, typer.Option(help="Write results for KITTI's evaluator: DIR/METHOD/data/ID.txt.")
    ] = None,
    page: Annotated[
        Path | None, typer.Option("--report", help="Write a page with tables, curves and pictures.")
    ] = None,
    rerun: Annotated[
        Path | None, typer.Option(help="Record the frames for the Rerun viewer: OUT.rrd (extra rerun).")
    ] = None,
    fresh: Annotated[bool, typer.Option(help="Begin anew; else finished frames are kept.")] = False,
) -> None:
    """KITTI's object or tracking set: errors, average precision, speed.

    Finished frames are kept beside the numbers (.frames.jsonl); the same
    command goes on where it was stopped. What cannot be used is left out,
    counted and named at the end.

    [bold]Examples[/bold]

      groundpose evaluate kitti --root KITTI --split val.txt -o kitti.json --report page

      groundpose evaluate kitti --root KITTI --boxes detections -m all -o kitti.json

      groundpose evaluate kitti --root KITTI --keypoints simulated -o kitti.json

      groundpose evaluate kitti --root KITTI --height 1.65 --region europe -o kitti.json
    """
    from groundpose.formats.kitti.dataset import KittiSet
    from groundpose.formats.kitti.table import KittiTable
    from groundpose.formats.rerun_log import package
    from groundpose.lab.evaluate.kitti.frame import Task
    from groundpose.lab.evaluate.kitti.run import Worker, run

    with mistakes():
        if rerun is not None:
            package()  # before the work, not after it
        task = Task(
            methods=_methods(method or ["default"]),
            boxes=boxes.value,
            **({"classes": tuple(class_name)} if class_name else {}),
            keypoints=keypoints.value,
            pitch_deg=pitch_deg,
            frame_tilt_sigma_deg=frame_tilt_sigma_deg,
            height=height,
            region=region,
            least_score=min_score,
        )
        Inputs(root, tuple(path for path in (split, detections, network) if path)).refuse(out, f"-o {out}: ")
        found = None
        if boxes is Boxes.DETECTIONS:
            found = detections or root / "training" / "detections"
        jobs = jobs or (1 if keypoints is Keypoints.NETWORK else os.cpu_count() or 1)
        source, settings = _source(keypoints, network, models.value, seed)
        frames = KittiTable(root, found is not None) if root.suffix == ".npz" else KittiSet(root, found)
        worker = Worker(frames, task, source, export)
        settings |= {"split": str(split) if split else None, "detections": str(found) if found else None}
        more: dict[str, Any] = {"settings": settings, "jobs": jobs, "fresh": fresh, "limit": limit}
        try:
            with bar("frames") as advance:
                content, _ = run(worker, out, split, **more, advance=advance)
        except KeyboardInterrupt:
            complain("interrupted; finished frames are kept, the same command goes on")
            raise typer.Exit(130) from None
        _tell(content)
        show(f"Numbers: {out.resolve()}")
        if page is not None:
            from groundpose.lab.evaluate.kitti.page import write

            show(f"Page: {write(content, worker, page).resolve()}")
        if rerun is not None:
            from groundpose.lab.evaluate.kitti.show import record

            with bar("recording") as advance:
                count = record(worker, frames.ids(split)[:limit], rerun, advance)
            show(f"Recording: {rerun.resolve()}, {count} frames")
    if not content["frames"]["done"]:
        complain("no frame could be used")
        raise typer.Exit(2)


def _methods(given: list[str]) -> tuple[str, ...]:
    """Each name once, `all` for all of our core."""
    from groundpose.lab.contenders.own import Own
    from groundpose.lab.contenders.registry import by_option

    own = [name for name, contender in by_option("kitti").items() if isinstance(contender, Own)]
    return tuple(dict.fromkeys(name for each in given for name in (own if each == "all" else (each,))))


def _source(
    keypoints: Keypoints, network: Path | None, models: str, seed: int
) -> tuple[KeypointSource, dict[str, Any]]:
    from groundpose.lab.evaluate.kitti.keypoints import Network, Simulated

    if keypoints is Keypoints.SIMULATED:
        return Simulated(seed, models=models), {"seed": seed, "models": models}
    return Network(None if network is None else str(network)), {"network": str(network) if network else None}


_SHOWN = (
    *("objects", "no answer %", "failures %", "mean e_r deg", "mean e_a deg", "median e_r deg"),
    *("yaw above 15 deg %", "yaw above 30 deg %", "median distance error %", "distance bias %"),
    *("distance beyond 10 %", "95 % interval of distance holds %", "mean overlap in space"),
)


_PLACES = 3


def _tell(content: dict[str, Any]) -> None:
    """The table of difficulties on the terminal, and what was left out."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for name in ("method", "", *_SHOWN):
        words = name in ("method", "")
        table.add_column(name, justify="left" if words else "right", no_wrap=words)
    for method in content["methods"]:
        for group in method["by difficulty"]:
            values = (group[name] for name in _SHOWN)
            table.add_row(
                method["method"], group["group"], *("-" if v is None else f"{v:.4g}" for v in values)
            )
    console().print(table)
    frames = content["frames"]
    show(f"{frames['done']} frames, {content['objects']} objects; frames left out: {frames['left out']}")
    for row in content["skipped"]:
        more = ", ..." if row["count"] > _PLACES else ""
        show(f"left out: {row['count']} x {row['reason']}: {'; '.join(row['first'][:_PLACES])}{more}")


@app.command()
def figure6(
    root: Annotated[Path, typer.Option(help="Folder that holds training/ as KITTI unpacks it.")],
    frame: Annotated[str, typer.Option(help="Its id: 000008.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Picture to write (.png, .svg, .pdf).")],
    keypoints: Annotated[Keypoints, typer.Option(help="See evaluate kitti.")] = Keypoints.NETWORK,
    network: NetworkFile = None,
    seed: Annotated[int, typer.Option(min=0, help="Of simulated keypoints.")] = 0,
) -> None:
    """The paper's Fig. 6 on a frame: RE beside HRE; inlier keypoints, 3D boxes, shapes.

    [bold]Examples[/bold]

      groundpose evaluate figure6 --root KITTI --frame 000008 -o figure6.png
    """
    from groundpose.draw import check_path
    from groundpose.draw.save import save_figure
    from groundpose.formats.kitti.dataset import KittiSet
    from groundpose.lab.evaluate.kitti.frame import Task
    from groundpose.lab.evaluate.kitti.run import Worker
    from groundpose.lab.evaluate.kitti.show import figure6 as draw

    with mistakes():
        check_path(out)
        source, _ = _source(keypoints, network, Models.CLASS.value, seed)
        worker = Worker(KittiSet(root), Task(keypoints=keypoints.value), source)
        save_figure(draw(worker, frame), out, 110)
    show(f"Picture: {out.resolve()}")


for command in (
    tracks,
    apollo,
    tilt,
    speed,
    targets,
    real,
    networks,
    honesty,
    silent,
    shapes,
    detector,
    distance,
    pages,
):
    app.command()(command)
