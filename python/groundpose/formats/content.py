"""A text file as the readers of several formats look at it before one of them reads it."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

from groundpose._checks import read_text
from groundpose._core import InputError
from groundpose.formats.fields import Field, parse


@dataclass(frozen=True)
class Content:
    """A file's text.

    Attributes:
        place: its name, as errors begin.
        text: all of it.
        json: its JSON values: one, or one per line (JSON lines), or none when it is no JSON.
    """

    place: str
    text: str
    json: tuple[Field, ...]

    @property
    def lines(self) -> list[tuple[str, str]]:
        """The lines that are not blank, each with its place `file:number`, stripped."""
        numbered = enumerate(self.text.splitlines(), 1)
        return [(f"{self.place}:{number}", line.strip()) for number, line in numbered if line.strip()]


def read_content(path: str | PathLike[str]) -> Content:
    """The content of a file. Raises OSError (no such file), InputError (no text, broken JSON)."""
    text = read_text(path)
    return Content(str(path), text, _json(text, str(path)))


def _json(text: str, place: str) -> tuple[Field, ...]:
    if not text.lstrip().startswith(("{", "[")):
        return ()
    lines = Content(place, text, ()).lines
    try:
        if len(lines) > 1:  # each line a value of its own? The first says so.
            parse(lines[0][1], place)
            return tuple(parse(line, where) for where, line in lines)
    except InputError as error:
        if not str(error).startswith(f"{place}: "):
            raise  # a later line of JSON lines
    return (parse(text, place),)
