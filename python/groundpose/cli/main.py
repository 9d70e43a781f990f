"""The command line: `groundpose estimate | demo | simulate | experiment | train | bench ...`."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

import groundpose
from groundpose.cli.bench import bench
from groundpose.cli.calibrate import calibrate
from groundpose.cli.crops import crops
from groundpose.cli.estimate import estimate
from groundpose.cli.evaluate import app as evaluate
from groundpose.cli.experiment import experiment
from groundpose.cli.inputs import NetworkFile
from groundpose.cli.output import console, mistakes, on_any_terminal, show
from groundpose.cli.simulate import simulate
from groundpose.cli.track import track
from groundpose.cli.train import export, train

# Options whose former spelling still works, without a place in the help.
_FORMER = {"model": "network", "least-score": "min-score", "frame-tilt-deg": "frame-tilt-sigma-deg"}

app = typer.Typer(
    name="groundpose",
    help="From one calibrated image, the 6-DoF pose and shape of every vehicle on the ground.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={
        "help_option_names": ["-h", "--help"],
        "token_normalize_func": lambda name: _FORMER.get(name, name),
    },
)
app.command(rich_help_panel="Commands")(estimate)
app.command()(calibrate)
app.command()(track)
app.command()(simulate)
app.command()(experiment)
app.add_typer(evaluate, name="evaluate")
for command in (crops, train, export, bench):
    app.command()(command)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"groundpose {groundpose.__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", "-V", callback=_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    """From one calibrated image, the 6-DoF pose and shape of every vehicle on the ground."""


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Picture to write (.png, .svg, .pdf).")] = Path(
        "groundpose_demo.png"
    ),
    network: NetworkFile = None,
) -> None:
    """From a bundled image of a street to poses: print estimate and truth, write a picture.

    [bold]Examples[/bold]

      groundpose demo

      groundpose demo --network mine.onnx --out /tmp/street.png
    """
    from groundpose.demo import run
    from groundpose.draw import check_path

    with mistakes():
        check_path(out)
        result = run(network)
        console().print(result.table())
        result.write_picture(out)
    show(f"Picture: {out.resolve()}")


@app.command("help")
def show_help(
    command: Annotated[list[str] | None, typer.Argument(help="Of which command; none: all.")] = None,
) -> None:
    """Show how a command is used.

    [bold]Examples[/bold]

      groundpose help estimate

      groundpose help evaluate kitti
    """
    app([*(command or []), "--help"], prog_name="groundpose")


def main() -> None:
    """The `groundpose` command. SIGTERM ends it as Ctrl-C does: what is finished is put in its place."""
    on_any_terminal()
    signal.signal(signal.SIGTERM, _interrupt)
    app()


def _interrupt(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one shall not disturb the end
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
