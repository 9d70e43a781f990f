"""A progress bar and the extra that is missing, for the commands that make crops and networks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from groundpose.cli.output import console, refuse


@contextmanager
def extra() -> Iterator[None]:
    """Report an extra that is not installed in one line."""
    try:
        yield
    except ModuleNotFoundError as error:
        missing = (error.name or "").split(".")[0]
        if missing not in ("torch", "onnx", "onnxscript", "moderngl"):
            raise
        extra = "simulate" if missing == "moderngl" else "train"
        refuse(f"{missing} is not installed: pip install 'groundpose[{extra}]'")


def bar() -> Progress:
    """A progress bar on standard error, shown on a terminal."""
    screen = console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=screen, disable=not screen.is_terminal)
