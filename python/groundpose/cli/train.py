"""`groundpose train | export`: from crops to an exported network."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from groundpose._core import InputError
from groundpose._writing import write_text
from groundpose.cli.output import console, mistakes, show
from groundpose.cli.progress import bar, extra

if TYPE_CHECKING:
    from groundpose.lab.training.loop import Trainer

_SHOWN = ("within_visible", "within_hidden", "error_px_visible", "class_accuracy", "score_auc")
_DEVICE = "Where to compute: auto (a GPU where there is one), cpu or cuda."
_SMOKE_FRAMES = {"train": 320, "validation": 96, "test": 96}


def train(
    config: Annotated[
        str, typer.Argument(help="Name of a configuration; [bold]list[/bold] prints the names.")
    ],
    data: Annotated[Path, typer.Option(help="Folder of crops.")] = Path("data/crops"),
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder of the run.", show_default="runs/CONFIG")
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Change a value of the configuration; repeatable."),
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(help="Stop after this time; the same command goes on.")
    ] = None,
    initial: Annotated[
        str | None,
        typer.Option(
            help="Start from these weights of the same network: the folder of a run, or the name of a "
            "bundled network."
        ),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads for training on a CPU.")] = 1,
    workers: Annotated[int, typer.Option(min=0, help="Threads that prepare batches.")] = 1,
    device: Annotated[str, typer.Option(help=_DEVICE)] = "auto",
    fit: Annotated[
        float | None,
        typer.Option(
            "--fit-minutes", help="Choose the number of steps so that the run ends after this time."
        ),
    ] = None,
    render: Annotated[
        bool,
        typer.Option(
            "--render", help="First render crops into the data folder, in half of [bold]--minutes[/bold]."
        ),
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes that render; default: one per core.")
    ] = None,
) -> None:
    """Train a keypoint network, or resume from the folder's checkpoint.

    With [bold]--render --minutes M[/bold] it renders crops and trains in one go that ends after M minutes;
    the same command resumes it. [bold]smoke[/bold] needs no data: it paints its own crops, trains, exports
    and prints the accuracy. At the end the weights are kept in RUN/weights-*.npz, at most 16 MB each.

    [bold]Examples[/bold]

      groundpose train smoke -o /tmp/smoke

      groundpose train lite48 --device cuda --render --minutes 9.5 -o runs/lite48

      groundpose train lite32 --data data/crops --set epochs=40 --set seed=1 --threads 2

      groundpose train lite48 --initial default --data data/own -o runs/own --set epochs=5
    """
    with mistakes(), extra():
        from groundpose.lab.training.configs import CONFIGS, NETWORKS, changed, train_config

        if config == "list":
            for name, row in CONFIGS.items():
                size = NETWORKS[row.network]
                recipe = f"{row.epochs:g} epochs, {row.optimizer}, {row.schedule}"
                show(f"{name:20} {size.width} x {size.height}, {recipe}")
            return
        wanted = changed(train_config(config), **_values(changes or []))
        folder = out or Path("runs") / config
        if config == "smoke":
            data = _toy_crops(folder / "crops")
        if render:
            if minutes is None:
                raise InputError("--render: expected --minutes M with it, got none")
            fit, minutes = _render(data, minutes, jobs, device), None
        import torch

        from groundpose.lab.training.device import device as device_named
        from groundpose.lab.training.loop import Trainer
        from groundpose.lab.training.weights import initial_folder

        torch.set_num_threads(threads)
        trainer = Trainer(
            wanted,
            data,
            folder,
            workers=workers,
            initial=None if initial is None else initial_folder(initial),
            device=device_named(device),
            fit_minutes=fit,
        )
        ended = _train(trainer, minutes)
        if ended and config == "smoke":
            export(folder, folder / "smoke.onnx", data, folder / "smoke_int8.onnx")
    show(f"Run: {folder.resolve()}" + ("" if ended else " (not finished: the same command goes on)"))


def export(
    run: Annotated[Path, typer.Argument(help="Folder of a run.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="ONNX file to write.")],
    data: Annotated[Path, typer.Option(help="Folder of crops: calibrates scores and int8.")] = Path(
        "data/crops"
    ),
    int8: Annotated[Path | None, typer.Option(help="Also write an int8 version.")] = None,
    others: Annotated[
        list[Path] | None,
        typer.Option("--with", help="Folder of a run whose network is asked too; the answer is the mean."),
    ] = None,
    mirrored: Annotated[
        bool, typer.Option(help="Average with the mirror image: twice the time, fewer wrong keypoints.")
    ] = False,
    stored: Annotated[
        str,
        typer.Option(
            help="Type of the weights in the file: float32, float16 or int8; arithmetic is float32."
        ),
    ] = "float16",
    limit: Annotated[int | None, typer.Option(min=1, help="Largest number of crops to evaluate.")] = None,
    device: Annotated[str, typer.Option(help=_DEVICE)] = "auto",
) -> None:
    """Write a trained network as ONNX with calibrated scores and metadata; print its metrics.

    [bold]Example[/bold]

      groundpose export runs/lite32 -o lite32.onnx --int8 lite32_int8.onnx

      groundpose export runs/lite48 --with runs/lite32 -o both.onnx --int8 both_int8.onnx
    """
    with mistakes(), extra():
        from groundpose.lab.training.device import device as device_named
        from groundpose.lab.training.release import release

        record = run / "command.txt"
        command = record.read_text().strip() if record.exists() else ""
        done = release(
            run,
            data,
            out,
            int8=int8,
            others=others or (),
            mirrored=mirrored,
            stored=stored,
            command=command,
            limit=limit,
            device=device_named(device),
        )
        table = Table(title="Held-out crops", title_justify="left")
        files = [(done.path, done.metrics)] + ([(done.int8, done.int8_metrics)] if done.int8 else [])
        for column in ("", *(f"{path.name} ({path.stat().st_size / 1e6:.1f} MB)" for path, _ in files)):
            table.add_column(column, justify="right" if column else "left")
        for name in done.metrics:
            table.add_row(name, *(f"{metrics[name]:.4g}" for _, metrics in files))
        console().print(table)


def _train(trainer: Trainer, minutes: float | None) -> bool:
    """Train with a progress bar on a terminal and a line per evaluation."""
    from groundpose.lab.training.log import Progress as State
    from groundpose.lab.training.loop import Limits

    name = trainer.config.network
    record = trainer.folder / "command.txt"
    if not record.exists():
        write_text(record, " ".join(["groundpose", *sys.argv[1:]]) + "\n")
    with bar() as shown:
        task = shown.add_task(name, total=trainer.steps, completed=trainer.step)

        def tell(now: State) -> None:
            text = f"{name} loss {now.losses['total']:.3f}, {now.crops_per_second:.0f} crops/s"
            shown.update(task, completed=now.step, description=text)
            if now.metrics:
                numbers = ", ".join(
                    f"{name} {now.metrics[name]:.3f}" for name in _SHOWN if name in now.metrics
                )
                shown.console.print(f"{now.step}/{now.steps} loss {now.losses['total']:.3f}, {numbers}")

        try:
            return trainer.run(Limits(minutes=minutes, evaluations=5 if name == "toy" else 20), tell)
        except KeyboardInterrupt:
            return False


def _render(data: Path, minutes: float, jobs: int | None, device: str) -> float:
    """Render crops in a part of the time; the minutes left."""
    from groundpose.lab.drive.render.device import choose
    from groundpose.lab.training.device import cores
    from groundpose.lab.training.in_time import Plan, render
    from groundpose.lab.training.mixed import DriveSamples

    choose(device)
    with bar() as shown:
        task = shown.add_task("rendering", total=None)

        def advance(split: str, shards: int) -> None:
            shown.update(task, completed=shards, description=f"rendering, shards of {split}")

        return render(Plan(data, DriveSamples(), minutes, jobs or cores()), advance)


def _toy_crops(folder: Path) -> Path:
    from groundpose.lab.training.crops import write_crops
    from groundpose.lab.training.toy import toy_samples

    for split, frames in _SMOKE_FRAMES.items():
        write_crops(folder, toy_samples, split, frames)
    return folder


def _values(changes: list[str]) -> dict[str, object]:
    """NAME=VALUE as Python values; anything but a number, true or false is a string."""
    made: dict[str, object] = {}
    for change in changes:
        name, equals, value = change.partition("=")
        if not equals:
            raise InputError(f"--set: expected NAME=VALUE, got {change!r}")
        try:
            made[name] = json.loads(value)
        except json.JSONDecodeError:
            made[name] = value
    return made
