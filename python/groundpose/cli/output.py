"""What the command line says, on whatever terminal or pipe."""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, NoReturn

import typer
from rich.console import Console

from groundpose._core import InputError

_UNSAFE = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Classes of characters that move the cursor, change colours or the direction of writing, or are none."""


_SPELLED = {"°": " deg", "±": "+-", "µ": "u", "×": "x", "–": "-", "…": "..."}
_PLAIN = "groundpose.plain"


def _spelled(error: UnicodeError) -> tuple[str | bytes, int]:
    """A character that the terminal's encoding lacks: in words if we use it, else as `\\xb0`."""
    if isinstance(error, UnicodeEncodeError) and (said := _SPELLED.get(error.object[error.start])):
        return said, error.start + 1
    return codecs.backslashreplace_errors(error)


codecs.register_error(_PLAIN, _spelled)


def on_any_terminal() -> None:
    """Make standard output and errors take every character, whatever the locale."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # None: closed by the caller
            stream.reconfigure(errors=_PLAIN)


def console(stderr: bool = False, file: IO[str] | None = None) -> Console:
    """A console for now: streams may be redirected between two commands (as tests do).

    Files and pipes have no width: tables are as wide there as they need to be.
    """
    made = Console(stderr=stderr, file=file, highlight=False, markup=False, soft_wrap=stderr)
    return (
        made
        if made.is_terminal
        else Console(stderr=stderr, file=file, highlight=False, markup=False, soft_wrap=stderr, width=160)
    )


def harmless(text: object, keep: str = "") -> str:
    """A text of whatever origin with its control characters, but those in `keep`, as `\\x1b` and the like."""
    said = str(text)
    if said.isascii() and said.isprintable():
        return said
    return "".join(
        c.encode("unicode_escape").decode() if unicodedata.category(c) in _UNSAFE and c not in keep else c
        for c in said
    )


def say(message: object) -> None:
    """A remark in one line on standard error."""
    console(stderr=True).print(harmless(message), style="dim")


def complain(message: object) -> None:
    """One line on standard error."""
    console(stderr=True).print(f"error: {harmless(message)}", style="red")


def show(message: object) -> None:
    """One line of what a command made on standard output."""
    typer.echo(harmless(message))


def refuse(message: object) -> NoReturn:
    """A mistake of the user: one line, exit status 2."""
    complain(message)
    raise typer.Exit(2)


@contextmanager
def mistakes() -> Iterator[None]:
    """Errors that are the user's to solve become one line and exit status 2, never a traceback."""
    try:
        yield
    except BrokenPipeError:
        raise  # the reader of our output has enough; see `main`
    except OSError as error:
        refuse(f"{error.filename or 'standard output'}: {error.strerror or error}")
    except (InputError, TypeError) as error:
        refuse(error)


def standard_output() -> IO[str]:
    """The stream of results. Refused when the caller has closed it."""
    if sys.stdout is None or sys.stdout.closed:
        refuse("standard output is closed; give a file, -o FILE")
    return sys.stdout
