"""Checks of the caller's arguments. The text of every error is built here and nowhere else."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._core import InputError

FloatArray = NDArray[np.float64]
_SHOWN = 400
"""Characters of what was got in an error: files may hold a line of a megabyte."""
_TOO_LARGE = "a number too large for a float"


def input_error(argument: str, expected: str, got: object) -> InputError:
    """The error for a value that an argument does not take."""
    said = _said(got, str)
    shown = said if len(said) <= _SHOWN else f"{said[:_SHOWN]}..."
    return InputError(f"{argument}: expected {expected}, got {shown}")


def type_error(argument: str, expected: str, value: object) -> TypeError:
    """The error for a value of a type that an argument does not take."""
    return TypeError(f"{argument}: expected {expected}, got {describe(value)}")


@contextmanager
def blamed(item: object, *, files: bool = True) -> Iterator[None]:
    """Whatever is raised inside becomes the InputError of one item of many, so that the others go on.

    Args:
        item: how it is called: a file, a line of one.
        files: whether errors of the system count too; else they pass, where they concern all items.
    """
    try:
        yield
    except InputError:
        raise
    except OSError as error:
        if not files:
            raise
        raise InputError(f"{error.filename or item}: {error.strerror or error}") from error
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        said = (_said(error, str).splitlines() or [""])[0][:_SHOWN]
        raise InputError(f"{item}: {type(error).__name__}{': ' * bool(said)}{said}") from error


def describe(value: object) -> str:
    """A value in a few words: small ones as they are, arrays by shape and dtype, lists by length."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and dtype {value.dtype}"
    if isinstance(value, (list, tuple)) and len(value) > 6:
        return f"a {type(value).__name__} of length {len(value)}"
    text = _said(value, repr)
    return f"{type(value).__name__} {text if len(text) <= 60 else text[:57] + '...'}"


def _said(value: object, in_words: Callable[[object], str]) -> str:
    """A value in the words of its own type, which may have none: Python prints no int of 5000 digits."""
    try:
        return in_words(value)
    except Exception:
        return f"({type(value).__name__} that cannot be printed)"


def number(argument: str, value: object) -> float:
    """A real number (Python's or numpy's, not a bool) as a float."""
    if isinstance(value, float):
        return value
    if isinstance(value, (int, np.integer, np.floating)) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            raise input_error(argument, "a number", _TOO_LARGE) from None
    raise type_error(argument, "a number", value)


def integer(argument: str, value: object) -> int:
    """A whole number (Python's or numpy's, not a bool) as an int."""
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return int(value)
    raise type_error(argument, "a whole number", value)


def count(argument: str, value: object) -> int:
    """A whole number from 0 that fits the core's integers."""
    n = integer(argument, value)
    if not 0 <= n < 2**63:
        raise input_error(argument, "a whole number from 0 to 2**63 - 1", n)
    return n


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads(value: object) -> int | None:
    """The argument `threads`: 1 or more, at most one for each core (more only wait for each other); None: it
    was left open."""
    if value is None:
        return None
    given = integer("threads", value)
    if given < 1:
        raise input_error("threads", "1 or more, or None for all cores", describe(value))
    return 1 if given == 1 else min(given, cores())


def flag(argument: str, value: object) -> bool:
    """True or False (Python's or numpy's)."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise type_error(argument, "True or False", value)


def text(argument: str, value: object) -> str:
    """A str."""
    if isinstance(value, str):
        return value
    raise type_error(argument, "a str", value)


def float_array(argument: str, value: Any, expected: str) -> FloatArray:
    """An array, masked array or nested list of numbers as float64 in C order.

    `None` inside a list and masked entries become NaN. No copy when nothing has to change.
    """
    if _is_plain(value):
        return value  # type: ignore[no-any-return]
    if type(value) is not np.ndarray:
        value = _as_array(argument, value, expected)
    if value.dtype.kind not in "fiu":
        raise type_error(argument, expected, value)
    with np.errstate(over="ignore"):  # of a longer float: infinity, as any other is judged
        return np.require(value, np.float64, ("C", "A"))


def _is_plain(value: Any) -> bool:
    """Whether there is nothing to change: what callers in a hurry hand in."""
    return (
        type(value) is np.ndarray
        and value.dtype.char == "d"
        and value.dtype.isnative
        and value.flags.c_contiguous
        and value.flags.aligned
    )


def _as_array(argument: str, value: Any, expected: str) -> NDArray[Any]:
    if isinstance(value, np.ma.MaskedArray):
        if value.dtype.kind not in "fiu":
            raise type_error(argument, expected, value)
        return np.ma.filled(value.astype(np.float64), np.nan)
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        raise input_error(argument, expected, f"{describe(value)} with rows of different lengths") from None
    except Exception as error:  # what other libraries raise for their arrays
        raise TypeError(f"{argument}: expected {expected}, got {type(value).__name__}: {error}") from None
    if array.dtype.kind == "O" and isinstance(value, (list, tuple)):
        flat = array.ravel().tolist()
        if all(x is None or (isinstance(x, (int, float)) and not isinstance(x, bool)) for x in flat):
            try:
                return array.astype(np.float64)
            except OverflowError:
                raise input_error(argument, expected, _TOO_LARGE) from None
    if array.size == 0 and isinstance(value, (list, tuple)):
        return array.astype(np.float64)
    if array.dtype.kind not in "fiu":
        raise type_error(argument, expected, value)
    return array


def shaped(argument: str, value: Any, *shapes: tuple[int | str, ...]) -> FloatArray:
    """`float_array` of one of `shapes`; a letter in a shape stands for any length."""
    if _is_plain(value) and any(_fits(value.shape, shape) for shape in shapes):
        return value  # type: ignore[no-any-return]
    expected = " or ".join(shape_text(shape) for shape in shapes)
    array = float_array(argument, value, f"numbers of shape {expected}")
    if not any(_fits(array.shape, shape) for shape in shapes):
        raise input_error(argument, f"shape {expected}", f"shape {shape_text(array.shape)}")
    return array


def _fits(actual: tuple[int, ...], wanted: tuple[int | str, ...]) -> bool:
    if len(actual) != len(wanted):
        return False
    for a, w in zip(actual, wanted, strict=True):  # noqa: SIM110 - a third of the time of all(...)
        if a != w and type(w) is int:
            return False
    return True


def shape_text(shape: Sequence[int | str]) -> str:
    """A shape as Python writes it: (4,), (N, 2)."""
    inside = ", ".join(str(n) for n in shape)
    return f"({inside},)" if len(shape) == 1 else f"({inside})"


def finite(argument: str, array: FloatArray) -> FloatArray:
    """The array, refused when it holds NaN or infinity."""
    bad = ~np.isfinite(array)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        raise input_error(argument, "finite numbers", f"{array[index]} at {list(index)}")
    return array


def radians(argument: str, degrees: float, limit: float) -> float:
    """An angle in radians. Raises InputError, in degrees as it was given, from the limit on."""
    if not -limit < degrees < limit:
        raise input_error(argument, f"degrees between {-limit:g} and {limit:g}", f"{degrees:g}")
    return math.radians(degrees)


def existing(path: str | PathLike[str]) -> Path:
    """A path that is there. Raises OSError (no such file), InputError (what no file can be called)."""
    found = Path(path)
    try:
        found.stat()  # OSError in Python's own words
    except ValueError as error:  # a null byte, half a character
        raise input_error(ascii(str(path)), "a name of a file", error) from None
    return found


def read_text(path: str | PathLike[str]) -> str:
    """The text of a file, without a byte order mark. Raises OSError (no such file), InputError (no text)."""
    try:
        return existing(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise input_error(str(path), "a text file", "bytes that are not UTF-8") from None


def regular_file(path: str | PathLike[str]) -> Path:
    """A path that is a file, as nothing else ends by itself. Raises OSError (no such file), InputError."""
    found = existing(path)
    if not found.is_file():
        raise input_error(str(path), "a file", "a folder" if found.is_dir() else "a pipe or a device")
    return found
