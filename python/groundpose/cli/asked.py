"""What a run was asked, so that the same command goes on with it."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import groundpose
from groundpose.cli.journal import Settings

_UNASKED = ("out", "threads", "strict")  # which change no result


def asked(parameters: Mapping[str, Any]) -> Settings | None:
    """All that decides the results of a command: its parameters, and how the files among them look.

    None: nobody can tell whether it is the same again, as the input is a pipe, or the camera is learned from
    image to image.
    """
    source, learned = parameters.get("source"), parameters.get("learn_camera")
    if learned is not None or str(source) == "-" or _is_pipe(source):
        return None
    out = parameters.get("out")
    parameters = {name: value for name, value in parameters.items() if name not in _UNASKED}
    said = {name: repr(value) for name, value in parameters.items()}
    ours = {"poses"} if out is None else {"poses", out.stem}
    files = {name: _look(path, ours) for name, path in parameters.items() if isinstance(path, Path)}
    return {"version": groundpose.__version__, "said": said, "files": files}


def _is_pipe(path: Path | None) -> bool:
    return path is not None and path.exists() and not (path.is_file() or path.is_dir())


def _look(path: Path, ours: set[str]) -> str:
    """Changes with the size or time of a file, or of one in a folder, hidden ones and our own results left
    out; of a name that is none, with those beside it."""
    if path.is_file():
        return _stamp(path.name, path.stat())
    folder = path if path.is_dir() else path.parent
    if not folder.is_dir():
        return ""
    with os.scandir(folder) as entries:
        files = [entry for entry in entries if entry.is_file() and not entry.name.startswith(".")]
        stamps = sorted(_stamp(f.name, f.stat()) for f in files if Path(f.name).stem not in ours)
    return hashlib.sha256("\n".join(stamps).encode("utf-8", "surrogatepass")).hexdigest()


def _stamp(name: str, found: os.stat_result) -> str:
    return f"{name} {found.st_size} {found.st_mtime_ns}"
