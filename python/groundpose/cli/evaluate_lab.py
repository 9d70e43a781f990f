"""`groundpose evaluate targets | real | networks | honesty | silent | shapes | detector | ...`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from groundpose.cli.inputs import NetworkFile
from groundpose.cli.output import console, mistakes, show

SOLVER, REAL = Path("results/solver.json"), Path("results/real.json")
Data = Annotated[Path | None, typer.Option(help="Folder of the real data; none: GROUNDPOSE_DATA.")]


def targets(
    trials: Annotated[int, typer.Option(min=1, help="Trials per setting.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the scenes.")] = 0,
    out: Annotated[Path, typer.Option("-o", "--out", help="JSON file of the numbers.")] = SOLVER,
    only: Annotated[str, typer.Option(metavar="ROW,...", help="Some rows; the others are kept.")] = "",
) -> None:
    """What the solver must show, measured: exit status 1 when a target is not met.

    Numbers other than times depend on trials and seed only. Times want a quiet machine.

    [bold]Examples[/bold]

      groundpose evaluate targets --only v1,time -o /tmp/targets.json
    """
    from groundpose.lab.evaluate.targets import measure

    with mistakes():
        try:
            met = measure(trials, seed, out, only, console())
        except ValueError as error:
            raise TypeError(str(error)) from error  # a usage error: one line and status 2
        show(f"Numbers: {out.resolve()}")
        if out == SOLVER:
            _results_page()
    if not met:
        raise typer.Exit(1)


def real(
    data: Data = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="JSON file of the numbers.")] = REAL,
) -> None:
    """Ours beside other contenders on keypoints of a real CNN (KITTI) and hand-labelled ones (ApolloCar3D).

    [bold]Examples[/bold]

      groundpose evaluate real --data data -o real.json
    """
    from groundpose.lab.data import data_folder
    from groundpose.lab.evaluate.real import measure
    from groundpose.lab.evaluate.report import write_json

    with mistakes():
        write_json(out, measure(data_folder(data), typer.echo))
        show(f"Numbers: {out.resolve()}")
        if out == REAL:
            _results_page()


def networks(
    network: Annotated[list[str] | None, typer.Argument(help="NAME=FILE of trained networks.")] = None,
    crops: Annotated[Path, typer.Option(help="Folder of crops with a test split.")] = Path("data/crops"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of detected boxes.")] = 0,
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure everything again.")] = False,
    only: Annotated[str, typer.Option(metavar="PART,...", help="Some parts; the others are kept.")] = "",
) -> None:
    """Accuracy and cost of keypoint networks, for docs/model.md (extra train).

    [bold]Examples[/bold]

      groundpose evaluate networks default=python/groundpose/keypoints/models/default.onnx

      groundpose evaluate networks default=default.onnx --crops data/crops --only streets,road-side
    """
    from groundpose.lab.evaluate.networks.measure import measure

    with mistakes():
        out = measure(Path(), network or [], crops, seed, fresh, typer.echo, only)
        show(f"Numbers: {out.resolve()}")


def honesty(
    network: Annotated[list[str] | None, typer.Argument(help="NAME=FILE of trained networks.")] = None,
    crops: Annotated[Path, typer.Option(help="Folder of crops with a test split.")] = Path("data/crops"),
    fit: Annotated[
        Path | None,
        typer.Option(
            help="First fit how sure each network is on the validation split of this folder of crops; the "
            "numbers are stored in the network's file."
        ),
    ] = None,
) -> None:
    """Do stated regions and probabilities hold? For docs/honesty.md (extra train).

    What a network says of crops is kept in CROPS/evaluated/honesty: the same
    command goes on where it was stopped.

    [bold]Examples[/bold]

      groundpose evaluate honesty default=default.onnx --crops data/held_out --fit data/crops

      groundpose evaluate honesty default=default.onnx int8=int8.onnx --crops data/held_out
    """
    from groundpose.lab.evaluate.honesty.measure import measure

    with mistakes():
        out = measure(Path(), network or [], crops, fit, typer.echo)
        show(f"Numbers: {out.resolve()}")


def silent(
    trials: Annotated[int, typer.Option(min=1, help="Scenes per case.")] = 1500,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the scenes.")] = 0,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="JSON file of the numbers.")] = None,
) -> None:
    """How often is the solver wrong and sure of it, when it is told something wrong? For docs/silent.md.

    Numbers depend on trials and seed only.

    [bold]Examples[/bold]

      groundpose evaluate silent --trials 300 -o /tmp/silent.json
    """
    from groundpose.lab.evaluate import report
    from groundpose.lab.evaluate import silent as lab

    with mistakes():
        path = out or lab.JSON
        report.write_json(path, lab.measure(trials, seed, typer.echo))
        show(f"Numbers: {path.resolve()}")
        if out is None:
            show(f"Page: {lab.write_stored(Path())}")


def shapes(data: Data = None) -> None:
    """What the shape models hold and which real cars they reach, for docs/vehicles.md."""
    from groundpose.lab.evaluate.shape_check import measure

    with mistakes():
        for path in measure(Path(), data):
            show(f"Written: {path.resolve()}")


def detector(data: Data = None) -> None:
    """The numbers of the simulated detector, fitted to real detections, and how well they agree."""
    from groundpose.lab.data import data_folder
    from groundpose.lab.evaluate.simulated.fit import measure

    with mistakes():
        measure(data_folder(data))


def distance(
    data: Data = None,
    network: NetworkFile = None,
    crops: Annotated[Path | None, typer.Option(help="Folder of crops whose renders are used.")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="JSON file of the numbers.")] = Path(
        "results/distance.json"
    ),
) -> None:
    """What region, height of the camera and more frames are worth for distances, for docs/distance.md.

    Renders of cameras above a road are those in `CROPS/evaluated` (extra
    train); without a folder they are left out.

    [bold]Examples[/bold]

      groundpose evaluate distance --data data

      groundpose evaluate distance --data data --crops data/held_out
    """
    from groundpose.cli.evaluate_sets import bar
    from groundpose.lab.data import data_folder
    from groundpose.lab.evaluate.kitti import distance
    from groundpose.lab.evaluate.report import write_json

    with mistakes():
        with bar("settings") as advance:
            path = None if network is None else str(network)
            content = distance.run(data_folder(data), path, crops, advance)
        write_json(out, content)
        show(f"Numbers: {out.resolve()}")
        if out == distance.JSON:
            show(f"Page: {distance.write_page(content, distance.PAGE).resolve()}")


def tracks(
    data: Data = None,
    video: Annotated[
        list[Path] | None,
        typer.Option(help="Folder of groundpose simulate --video; repeat for more.", metavar="FOLDER"),
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="JSON file of the numbers.")] = Path(
        "results/tracks.json"
    ),
) -> None:
    """How well vehicles are followed over time, beside others, for docs/tracks.md (extra tracks).

    [bold]Examples[/bold]

      groundpose simulate --video --static --camera-height 8 --pitch-deg -20 --frames 300 --out mast --split
      test

      groundpose evaluate tracks --data data --video mast
    """
    from groundpose.lab.data import data_folder
    from groundpose.lab.evaluate.report import write_json
    from groundpose.lab.evaluate.tracks import measure, page

    with mistakes():
        content = measure.run(data_folder(data), video or [], show)
        write_json(out, content)
        show(f"Numbers: {out.resolve()}")
        if out == measure.JSON:
            show(f"Page: {page.write_page(content, page.PAGE).resolve()}")


def pages() -> None:
    """Write the pages of docs/ again from the stored results; nothing is measured."""
    from groundpose.lab.bench import page as performance
    from groundpose.lab.evaluate import real_page, report, silent
    from groundpose.lab.evaluate.experiments import page as experiments
    from groundpose.lab.evaluate.honesty import page as honesty_page
    from groundpose.lab.evaluate.kitti import distance as distance_page
    from groundpose.lab.evaluate.networks import page as network_page
    from groundpose.lab.evaluate.simulated import page as simulated
    from groundpose.lab.evaluate.tracks import page as tracks_page

    with mistakes():
        root = Path()
        written = [report.write_page(root), real_page.write_page(root), performance.write_page(root)]
        written += [network_page.write_stored(root), simulated.write_stored(root)]
        written += [experiments.write_stored(root), distance_page.write_stored(root)]
        written += [honesty_page.write_stored(root), silent.write_stored(root)]
        written += [tracks_page.write_stored(root)]
        for path in filter(None, written):
            show(f"Page: {path.resolve()}")


def _results_page() -> None:
    from groundpose.lab.evaluate.report import write_page

    show(f"Page: {write_page(Path()).resolve()}")
