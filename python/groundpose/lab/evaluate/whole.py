"""Whether every file of a folder is whole, by what its ending says it is."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

_LAST = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9"}
"""With what a picture ends, as readers do without."""


def halves(folder: Path) -> list[str]:
    """What is wrong with the files of a folder, a line each. Hidden files are a run's own notes: they are no
    results, and the next run takes them away."""
    wrong = []
    for path in sorted(folder.rglob("*")):
        below = path.relative_to(folder)
        if path.is_file() and not any(part.startswith(".") for part in below.parts):
            try:
                _CHECKS.get(path.name, _CHECKS.get(path.suffix, _any))(path)
            except Exception as error:  # whatever a reader says of half a file
                wrong.append(f"{below}: {type(error).__name__}: {error}")
    return wrong


def _lines(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    if text and not text.endswith("\n"):
        raise ValueError("a line without its end")
    return text.splitlines()


def _json_lines(path: Path) -> None:
    for line in _lines(path):
        json.loads(line)


def _json(path: Path) -> None:
    json.loads(path.read_text(encoding="utf-8"))


def _csv(path: Path) -> None:
    rows = list(csv.reader(io.StringIO("\n".join(_lines(path)))))
    if not rows or len({len(row) for row in rows}) != 1:
        raise ValueError("no rows, or rows of different lengths")


def _text(path: Path) -> None:
    """KITTI's lines: words and numbers, as many in each; calibration has a name and a colon instead."""
    lines = [line.split() for line in _lines(path)]
    if any(len(words) < 15 for words in lines if not words[0].endswith(":") and len(words) > 3):
        raise ValueError("a line that is cut off")


def _parquet(path: Path) -> None:
    from pyarrow import parquet

    parquet.read_table(path)


def _picture(path: Path) -> None:
    from PIL import Image

    with Image.open(path) as picture:
        picture.load()
    if not path.read_bytes().endswith(_LAST[path.suffix]):
        raise ValueError("an end that is cut off")


def _array(path: Path) -> None:
    with path.open("rb") as stream:  # np.load leaves a damaged file open
        found = np.load(stream, allow_pickle=False)
        for name in getattr(found, "files", ()):
            found[name]


def _checkpoint(path: Path) -> None:
    import torch

    torch.load(path, map_location="cpu", weights_only=True)


def _network(path: Path) -> None:
    import onnx

    onnx.checker.check_model(onnx.load(str(path)))


def _any(path: Path) -> None:
    path.read_bytes()


_CHECKS: dict[str, Callable[[Path], object]] = {
    ".jsonl": _json_lines,
    ".json": _json,
    ".csv": _csv,
    "command.txt": _lines,
    ".txt": _text,
    ".parquet": _parquet,
    ".png": _picture,
    ".jpg": _picture,
    ".npy": _array,
    ".npz": _array,
    ".pt": _checkpoint,
    ".onnx": _network,
}
