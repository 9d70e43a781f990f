"""`groundpose evaluate apollo | tilt | speed`: sets of cars and made-up folders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from groundpose.cli import progress
from groundpose.cli.output import mistakes, refuse, show


@contextmanager
def bar(name: str) -> Iterator[Callable[[int, int], None]]:
    """Progress on a terminal."""
    with progress.bar() as shown:
        task = shown.add_task(name, total=None)
        yield lambda done, total: shown.update(task, completed=done, total=total)


def apollo(
    root: Annotated[Path | None, typer.Option(help="Folder with car_poses/ and keypoints/.")] = None,
    models: Annotated[
        Path | None, typer.Option(help="Keypoints of the 79 car models: keypoints_3d of an .npz.")
    ] = None,
    split: Annotated[Path | None, typer.Option(help="List of images; none: all.")] = None,
    data: Annotated[Path | None, typer.Option(help="Folder of apollo_cars_dev.npz instead of ROOT.")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="JSON file of the numbers.")] = None,
) -> None:
    """ApolloCar3D, hand-labelled keypoints: ours beside other libraries, and ways to use the nominal tilt.

    [bold]Examples[/bold]

      groundpose evaluate apollo --root 3d_car_instance/train --models apollo_models.npz -o apollo.json

      groundpose evaluate apollo --data data
    """
    from groundpose.lab.evaluate.apollo import run_folder, run_table

    with mistakes():
        if (root is None) == (data is None) or (root is not None and models is None):
            refuse("expected --root with --models, or --data")
        content = run_table(data) if data is not None else run_folder(root, models, split)  # type: ignore[arg-type]
        _show_sets(content, out)


def tilt(
    data: Annotated[Path | None, typer.Option(help="Folder of the .npz sets; none: GROUNDPOSE_DATA.")] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="Only so many frames of KITTI.")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="JSON file of the numbers.")] = None,
) -> None:
    """How much errors fall when a frame's tilt comes from all its objects.

    [bold]Examples[/bold]

      groundpose evaluate tilt --data data -o tilt.json
    """
    from groundpose.lab.data import data_folder
    from groundpose.lab.evaluate.apollo import run_tilt

    with mistakes():
        _show_sets(run_tilt(data_folder(data), limit), out)


def speed(
    frames: Annotated[int, typer.Option(min=1, help="Frames of the folder that is made.")] = 10_000,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="JSON file of time and memory.")] = None,
) -> None:
    """Time and memory of `evaluate kitti` on a folder of made-up labels without images.

    [bold]Examples[/bold]

      groundpose evaluate speed --frames 10000 --jobs 2
    """
    from groundpose.lab.evaluate.kitti.bench import bench

    with mistakes(), bar("frames") as advance:
        content = bench(frames, jobs, advance)
        if out is not None:
            from groundpose.lab.evaluate.report import write_json

            write_json(out, content)
    for name, value in content.items():
        show(f"{name}: {value}")


def _show_sets(content: dict[str, Any], out: Path | None) -> None:
    from groundpose.lab.evaluate.report import table as markdown
    from groundpose.lab.evaluate.report import write_json

    for group in content["sets"]:
        show(f"\n{group['name']}, {group['objects']} cars")
        for key in ("methods", "tilt"):
            if key in group:
                typer.echo(markdown(group[key]))
    for row in content.get("skipped", ()):
        show(f"left out: {row['count']} x {row['reason']}: {row['first'][0]}")
    if out is not None:
        write_json(out, content)
        show(f"Numbers: {out.resolve()}")
