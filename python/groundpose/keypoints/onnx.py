"""ONNX files, foreign and damaged ones too: onnxruntime, its sessions, and what a file says of itself."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from os import PathLike
from types import ModuleType
from typing import Any, NoReturn

from numpy.typing import NDArray

from groundpose._checks import input_error, regular_file
from groundpose._checks import threads as checked_threads

_NO_TELEMETRY = "ORT_DISABLE_TELEMETRY"
"""onnxruntime reads this variable when it is loaded; without it, it writes an identifier of the machine and a
database to the home folder."""


def runtime() -> ModuleType:
    """onnxruntime, loaded so that it records and sends nothing unless the caller's environment says so."""
    os.environ.setdefault(_NO_TELEMETRY, "1")
    import onnxruntime

    module: ModuleType = onnxruntime
    return module


class OnnxFile:
    """An ONNX file that is loaded, and its errors, which name it.

    Attributes:
        path: the file.
        metadata: what it says of itself, str to str.
        inputs, outputs: the shapes by name; a length that is not fixed is a str or None.
        types: onnxruntime's of the inputs, "tensor(float)".
    """

    def __init__(self, path: str | PathLike[str], threads: int | None = None) -> None:
        """Load a file for `threads` threads (None: all cores).

        Raises:
            OSError: no such file. InputError: not an ONNX file, a damaged one.
        """
        self.path = regular_file(path)
        wanted = checked_threads(threads)
        self.path.open("rb").close()  # OSError in Python's own words
        ort = runtime()
        options = ort.SessionOptions()
        options.log_severity_level = 4
        if wanted is not None:
            options.intra_op_num_threads = wanted
        try:
            self._session = ort.InferenceSession(  # without a second try, which it would print
                str(self.path), options, providers=["CPUExecutionProvider"], enable_fallback=0
            )
            self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
            self.inputs, self.outputs = (
                {node.name: tuple(node.shape) for node in nodes}
                for nodes in (self._session.get_inputs(), self._session.get_outputs())
            )
            self.types = {node.name: str(node.type) for node in self._session.get_inputs()}
        except Exception as error:  # onnxruntime has its own class for each of a dozen kinds of damage
            self.fail("an ONNX network", _first_line(error))

    def fail(self, expected: str, got: object, where: str = "") -> NoReturn:
        """Raise the error of this file; `where` in it."""
        raise input_error(f"{self.path}: {where}" if where else str(self.path), expected, got)

    def run(self, outputs: Sequence[str], /, **inputs: NDArray[Any]) -> list[NDArray[Any]]:
        """The outputs. Raises InputError where the network cannot be run on these inputs."""
        try:
            answers: list[NDArray[Any]] = self._session.run(list(outputs), inputs)
        except Exception as error:
            self.fail("a network that runs", _first_line(error))
        return answers

    def text(self, key: str) -> str:
        """A member of the metadata that must be there."""
        if key not in self.metadata:
            self.fail("a value", "none", f"metadata {key!r}")
        return self.metadata[key]

    def json(self, key: str) -> Any:
        """A member of the metadata that must be JSON."""
        text = self.text(key)
        try:
            return json.loads(text)
        except (ValueError, RecursionError):
            self.fail("JSON", repr(text[:60]), f"metadata {key!r}")

    def number(self, key: str, low: float, high: float) -> float:
        """A member of the metadata that must be a number in this range."""
        text = self.text(key)
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            self.fail(f"a number from {low:g} to {high:g}", repr(text[:60]), f"metadata {key!r}")
        return value

    def whole(self, key: str, low: int, high: int) -> int:
        """A whole number of the metadata."""
        value = self.number(key, low, high)
        if value != int(value):
            self.fail("a whole number", repr(self.text(key)), f"metadata {key!r}")
        return int(value)

    def numbers(self, key: str, counts: Sequence[int]) -> list[float]:
        """A list of so many finite numbers of the metadata, as JSON."""
        found = self.json(key)
        good = isinstance(found, list) and len(found) in counts
        if not good or not all(type(x) in (int, float) and abs(x) < _LARGEST for x in found):
            expected = f"a list of {' or '.join(map(str, counts))} numbers"
            self.fail(expected, repr(self.text(key)[:60]), f"metadata {key!r}")
        return [float(x) for x in found]

    def shaped(self, name: str, kind: str, shape: tuple[int | None, ...]) -> None:
        """That an input or output (`kind`) is there, of this shape as far as both say; None: any length."""
        known = getattr(self, f"{kind}s")
        if name not in known:
            self.fail(f"an {kind} {name!r}", f"{', '.join(map(repr, known)) or 'none'}")
        found = known[name]
        pairs = zip(found, shape, strict=False)
        differ = any(isinstance(a, int) and b is not None and a != b for a, b in pairs)
        if found and (len(found) != len(shape) or differ):
            wanted = ", ".join("N" if n is None else str(n) for n in shape)
            self.fail(f"an {kind} {name!r} of shape ({wanted})", f"{found}")


_LARGEST = 1e30
"""Of a number of the metadata."""


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
