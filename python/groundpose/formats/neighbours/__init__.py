"""Poses in the formats that the next tool opens: `write_scenes`, and `groundpose convert`.

A format is a row of `NEIGHBOURS`, and a file here.
"""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from groundpose._checks import input_error
from groundpose.formats.neighbours.context import Context
from groundpose.formats.neighbours.table import NEIGHBOURS, Neighbour
from groundpose.formats.scenes import Scene

__all__ = ["NEIGHBOURS", "Context", "Neighbour", "neighbour", "write_scenes"]


def neighbour(path: str | PathLike[str], to: str | None = None) -> Neighbour:
    """The format `to`, or the one that the ending of `path` says. Raises InputError for none."""
    name = Path(path).name.lower()
    if to is not None:
        if to not in NEIGHBOURS:
            raise input_error("to", f"one of {', '.join(NEIGHBOURS)}", repr(to))
        return NEIGHBOURS[to]
    for row in NEIGHBOURS.values():
        if name.endswith(row.endings):
            return row
    known = "; ".join(f"{row.name} {' '.join(row.endings)}" for row in NEIGHBOURS.values())
    raise input_error(str(path), f"an ending of a format ({known}), or the format's name", "another name")


def write_scenes(
    path: str | PathLike[str], scenes: Iterable[Scene], to: str | None = None, context: Context | None = None
) -> None:
    """Write frames for another tool; whole or not at all.

    Args:
        path: the file, or the folder of formats that are folders, which must not be there yet.
        scenes: the frames, in order; they are taken one by one.
        to: a name of `NEIGHBOURS`; None: by the ending of `path`.
        context: what the format needs beside them; takes what was left out.

    Raises:
        InputError: no such format, its package is not installed, several frames for a format of one, what
            the format needs is missing. OSError: naming `path`.
    """
    neighbour(path, to).write(scenes, Path(path), context or Context())
