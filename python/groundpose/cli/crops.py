"""`groundpose crops`: training crops of the virtual drive or of one's own pictures."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from groundpose.cli.output import mistakes, say, show
from groundpose.cli.progress import bar, extra

if TYPE_CHECKING:
    from groundpose.keypoints.codec import Codec


def crops(
    out: Annotated[Path, typer.Argument(help="Folder of the crops.")],
    frames: Annotated[int, typer.Option(min=1, help="Frames of the drive.")] = 20_000,
    split: Annotated[
        str | None,
        typer.Option(
            help="train, validation or test. With --from-coco: all pictures there; none: by their ids.",
            show_default="train",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the drive.")] = 0,
    first: Annotated[int, typer.Option(min=0, help="First frame; a multiple of the frames per shard.")] = 0,
    jobs: Annotated[int, typer.Option(min=1, help="Processes that draw.")] = 1,
    source: Annotated[
        str,
        typer.Option(
            help="mixed: cameras of all kinds and places without a vehicle; car: the vehicles that one car "
            "sees; toy: painted substitutes."
        ),
    ] = "mixed",
    large: Annotated[
        bool, typer.Option(help="Twice the width and height, for networks of 256 x 192.")
    ] = False,
    from_coco: Annotated[
        Path | None, typer.Option(help="Cut crops of labelled pictures instead: a COCO keypoints file.")
    ] = None,
    keypoints: Annotated[
        Path | None,
        typer.Option(
            help="JSON file: the file's names of classes and keypoints and ours. None: they are ours."
        ),
    ] = None,
    images: Annotated[
        Path | None, typer.Option(help="Folder of the pictures; none: images/ beside the file, or beside it.")
    ] = None,
    device: Annotated[str, typer.Option(help="What draws: auto, cpu or cuda (a graphics card).")] = "auto",
) -> None:
    """Draw training crops of the virtual drive. Existing crops are not drawn again.

    [bold]Examples[/bold]

      groundpose crops data/crops --frames 60000 --jobs 2

      groundpose crops data/crops --frames 3000 --split validation

      groundpose crops data/held_out --frames 1000 --split test --source car

      groundpose crops data/own --from-coco labels.json --keypoints names.json
    """
    with mistakes(), extra():
        from groundpose.lab.drive import SPLITS
        from groundpose.lab.drive.render.device import choose
        from groundpose.lab.training.crops import STORED, write_crops
        from groundpose.lab.training.sources import source_named

        if split not in (None, *SPLITS):
            raise TypeError(f"--split: expected one of {', '.join(SPLITS)}, got {split!r}")
        choose(device)
        codec = (
            dataclasses.replace(STORED, width=2 * STORED.width, height=2 * STORED.height) if large else STORED
        )
        if from_coco is not None:
            _coco_crops(out, from_coco, keypoints, images, split, codec, jobs)
            return
        if keypoints is not None or images is not None:
            raise TypeError("--keypoints, --images: expected --from-coco with them, got none")
        split = split or "train"
        samples = source_named(source)
        with bar() as shown:
            task = shown.add_task(f"{split} shards", total=None)

            def advance(done: int, total: int) -> None:
                shown.update(task, completed=done, total=total)

            write_crops(
                out, samples, split, frames, seed=seed, first=first, codec=codec, jobs=jobs, advance=advance
            )
    show(f"Crops: {out.resolve()}")


def _coco_crops(
    out: Path,
    file: Path,
    keypoints: Path | None,
    images: Path | None,
    split: str | None,
    codec: Codec,
    jobs: int,
) -> None:
    """Cut the crops of a COCO file and say what was left out."""
    from groundpose.lab.training.coco_crops import read_coco
    from groundpose.lab.training.coco_map import CocoMap
    from groundpose.lab.training.crops import write_crops

    names = CocoMap.own() if keypoints is None else CocoMap.read(keypoints)
    sources, skips = read_coco(file, names, images, split)
    made = []
    for name, source in sources.items():
        write_crops(out, source, name, len(source.pictures), codec=codec, jobs=jobs)
        made.append(f"{sum(len(picture.vehicles) for picture in source.pictures)} {name}")
    show(f"Crops: {out.resolve()} ({', '.join(made)}; {skips.total} left out)")
    for line in skips.lines():
        say(f"left out: {line}")
