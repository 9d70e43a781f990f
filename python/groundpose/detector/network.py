"""An ONNX file as a network that takes pictures: its inputs, their size and what the file says of itself."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error, shape_text
from groundpose.detector.answers import Answer
from groundpose.detector.preparation import Size
from groundpose.keypoints.onnx import OnnxFile

DEFAULT_SIZE = (640, 640)
"""Of an input whose size the file leaves open."""
MOST_SIDE, MOST_PIXELS = 8192, 2**24
"""Of the input, in all pictures that it takes at a time: more is a damaged file."""
_TYPES: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
    "tensor(bool)": np.bool_,
}
_TASKS = ("detect", "segment", "pose")
"""What ultralytics calls networks that answer upright boxes."""


class PictureNetwork:
    """A network with one input of pictures (1, 3, height, width).

    Attributes:
        path: the file. size: width and height of the input. metadata: what the file says of itself.
        names: of its classes by number; empty if the file has none.
    """

    def __init__(self, path: str | PathLike[str], threads: int | None, size: Size | None) -> None:
        """Load it. Raises OSError, InputError: no network of pictures, or an input of another size."""
        self._file = OnnxFile(path, threads)
        self.path, self.metadata = self._file.path, self._file.metadata
        task = self.metadata.get("task", _TASKS[0])
        if task not in _TASKS:
            self._file.fail("a detector of upright boxes", f"a network for {task!r}")
        self.names = class_names_of(self.path, self.metadata.get("names"))
        inputs = self._file.inputs
        self._picture = next((name for name, shape in inputs.items() if len(shape) == 4), "")
        self._batch, self.size = self._shape(inputs.get(self._picture), size)
        self._types = {name: self._type(name, kind) for name, kind in self._file.types.items()}
        for name in inputs.keys() - {self._picture, *_OTHERS}:
            self._file.fail(f"no input but a picture and {' or '.join(_OTHERS)}", name)

    def _type(self, name: str, kind: str) -> type[np.generic]:
        if kind not in _TYPES:
            self._file.fail(" or ".join(_TYPES), kind, f"input {name}")
        return _TYPES[kind]

    def _shape(self, shape: tuple[Any, ...] | None, size: Size | None) -> tuple[int, Size]:
        """How many pictures it takes at a time, and their size."""
        if shape is None or (isinstance(shape[1], int) and shape[1] != 3):
            self._file.fail(
                "an input (1, 3, height, width)", "no picture" if shape is None else shape_text(shape)
            )
        batch, _, height, width = (side if isinstance(side, int) and side > 0 else None for side in shape)
        stated = size or _stated_size(self.metadata.get("imgsz")) or DEFAULT_SIZE
        own = (width or stated[0], height or stated[1])
        if max(own) > MOST_SIDE or own[0] * own[1] * (batch or 1) > MOST_PIXELS:
            expected = f"an input of at most {MOST_SIDE} pixels a side, {MOST_PIXELS} in all"
            self._file.fail(expected, shape_text(shape))
        if size is not None and own != size:
            raise input_error("size", f"{own} as in {self.path}", size)
        return batch or 1, own

    def answer(self, picture: NDArray[np.float32]) -> Answer:
        """What it says of a prepared picture (1, 3, height, width). Raises InputError."""
        feeds = {name: make(self.size, self._file.inputs.get(name, ())) for name, make in _OTHERS.items()}
        feeds[self._picture] = picture
        typed = {
            name: np.repeat(feeds[name], self._batch, axis=0).astype(kind)
            for name, kind in self._types.items()
        }
        names = list(self._file.outputs)
        outputs = dict(zip(names, map(np.asarray, self._file.run(names, **typed)), strict=True))
        return Answer(outputs, self.size, len(self.names) or None)


def _target_sizes(size: Size, shape: tuple[Any, ...]) -> NDArray[Any]:
    """In which boxes are answered."""
    return np.array([size])


def _pixel_mask(size: Size, shape: tuple[Any, ...]) -> NDArray[Any]:
    """Where in the input the picture is; some files have it smaller."""
    sides = zip(shape[1:], (size[1], size[0]), strict=False)
    return np.ones((1, *(stated if isinstance(stated, int) else own for stated, own in sides)))


_OTHERS = {"orig_target_sizes": _target_sizes, "pixel_mask": _pixel_mask}
"""Inputs beside the picture."""


def class_names_of(path: Path, stated: str | None) -> dict[int, str]:
    """Names of classes as ultralytics writes them into files: a dictionary or a list as Python prints it.

    Raises InputError.
    """
    given = _literal(stated)
    if given is None:
        return {}
    if isinstance(given, (list, tuple)):
        given = dict(enumerate(given))
    if not isinstance(given, Mapping) or set(given) != set(range(len(given))):
        raise input_error(str(path), "names of classes by number in its metadata", repr(stated)[:80])
    return {number: str(given[number]) for number in range(len(given))}


def _stated_size(stated: str | None) -> Size | None:
    """Width and height of the metadata's `imgsz`, a number or height and width."""
    given = _literal(stated)
    sides = [given, given] if isinstance(given, int) else given
    if isinstance(sides, (list, tuple)) and len(sides) == 2 and all(isinstance(s, int) for s in sides):
        return (sides[1], sides[0]) if min(sides) > 0 else None
    return None


def _literal(text: str | None) -> Any:
    """What Python or JSON printed; text that is neither as it is."""
    try:
        return None if text is None else ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
        return text
