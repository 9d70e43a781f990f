"""An ONNX file as a network that takes pictures: its inputs, their size and what the file says of itself."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error, shape_text
from groundpose.detector.answers import Answer
from groundpose.detector.preparation import Size
from groundpose.keypoints.network import _session

DEFAULT_SIZE = (640, 640)
"""Of an input whose size the file leaves open."""
_TYPES: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(int64)": np.int64,
}
_TASKS = ("detect", "segment", "pose")
"""What ultralytics calls networks that answer upright boxes."""


class PictureNetwork:
    """A network with one input of pictures (1, 3, height, width), run by onnxruntime.

    Attributes:
        path: the file. size: width and height of the input. metadata: what the file says of itself.
        names: of its classes by number; empty if the file has none.
    """

    def __init__(self, path: Path, threads: int | None, size: Size | None) -> None:
        """Load it. Raises OSError, InputError: no network of pictures, or an input of another size."""
        self.path = path
        self._session = _session(path, threads)
        self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        task = self.metadata.get("task", _TASKS[0])
        if task not in _TASKS:
            raise input_error(str(path), "a detector of upright boxes", f"a network for {task!r}")
        self.names = class_names_of(path, self.metadata.get("names"))
        inputs = {given.name: given for given in self._session.get_inputs()}
        self._picture = next((name for name, given in inputs.items() if len(given.shape) == 4), "")
        self._batch, self.size = self._shape(inputs.get(self._picture), size)
        self._types = {name: self._type(given) for name, given in inputs.items()}
        for name in inputs.keys() - {self._picture, *_OTHERS}:
            raise input_error(str(path), f"no input but a picture and {' or '.join(_OTHERS)}", name)

    def _type(self, given: Any) -> type[np.generic]:
        if given.type not in _TYPES:
            raise input_error(f"{self.path}: input {given.name}", " or ".join(_TYPES), given.type)
        return _TYPES[given.type]

    def _shape(self, given: Any, size: Size | None) -> tuple[int, Size]:
        """How many pictures it takes at a time, and their size."""
        shape = [] if given is None else list(given.shape)
        if not shape or (isinstance(shape[1], int) and shape[1] != 3):
            got = "no picture" if given is None else shape_text(shape)
            raise input_error(str(self.path), "an input (1, 3, height, width)", got)
        batch, _, height, width = (side if isinstance(side, int) and side > 0 else None for side in shape)
        stated = size or _stated_size(self.metadata.get("imgsz")) or DEFAULT_SIZE
        own = (width or stated[0], height or stated[1])
        if size is not None and own != size:
            raise input_error("size", f"{own} as in {self.path}", size)
        return batch or 1, own

    def answer(self, picture: NDArray[np.float32]) -> Answer:
        """What it says of a prepared picture (1, 3, height, width). Raises InputError."""
        pictures = np.repeat(picture, self._batch, axis=0)
        feeds: dict[str, NDArray[Any]] = {self._picture: pictures.astype(self._types[self._picture])}
        for name, make in _OTHERS.items():
            if name in self._types:
                feeds[name] = np.repeat(make(self.size), self._batch, axis=0).astype(self._types[name])
        names = [output.name for output in self._session.get_outputs()]
        try:
            values = self._session.run(names, feeds)
        except Exception as error:  # onnxruntime has its own class for each of a dozen kinds of failure
            size = f"a picture of {self.size[0]} x {self.size[1]}"
            raise input_error(str(self.path), f"a network that takes {size}", _first_line(error)) from None
        outputs = {name: np.asarray(value) for name, value in zip(names, values, strict=True)}
        return Answer(outputs, self.size, len(self.names) or None)


def _target_sizes(size: Size) -> NDArray[Any]:
    """In which boxes are answered."""
    return np.array([size])


def _pixel_mask(size: Size) -> NDArray[Any]:
    """Where in the input the picture is."""
    return np.ones((1, size[1], size[0]))


_OTHERS = {"orig_target_sizes": _target_sizes, "pixel_mask": _pixel_mask}
"""Inputs beside the picture."""


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]


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
