"""The commands and where each is: only the one that runs is imported, all of them take twice the time."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import Annotated

import typer

COMMANDS = {
    "estimate": "estimate:estimate",
    "convert": "convert:convert",
    "calibrate": "calibrate:calibrate",
    "track": "track:track",
    "simulate": "simulate:simulate",
    "experiment": "experiment:experiment",
    "crops": "crops:crops",
    "train": "train:train",
    "export": "train:export",
    "bench": "bench:bench",
    "demo": "demo:demo",
    "help": "help:show_help",
    "evaluate": "evaluate:app",
    "fleet": "fleet:app",
}
"""File and name in it of each command, in the order of the help; an app has commands of its own."""

# Options whose former spelling still works, without a place in the help.
_FORMER = {"model": "network", "least-score": "min-score", "frame-tilt-deg": "frame-tilt-sigma-deg"}


def app_of(names: Iterable[str]) -> typer.Typer:
    """`groundpose` with these commands alone."""
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
    app.callback()(_root)
    for name in names:
        file, _, member = COMMANDS[name].partition(":")
        found = getattr(import_module(f"groundpose.cli.{file}"), member)
        if isinstance(found, typer.Typer):
            app.add_typer(found, name=name)
        else:
            app.command(name)(found)
    return app


def _version(wanted: bool) -> None:
    if wanted:
        import groundpose

        typer.echo(f"groundpose {groundpose.__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool,
        typer.Option("--version", "-V", callback=_version, is_eager=True, help="Print the version and exit."),
    ] = False,
) -> None:
    """From one calibrated image, the 6-DoF pose and shape of every vehicle on the ground."""
