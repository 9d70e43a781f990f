"""JSON values that know where they stand, so that every error names file, line and field."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from groundpose._checks import input_error
from groundpose._core import InputError

_MOST = 2**53
"""Whole numbers below it are the same as floats."""


_SHOWN = 200
"""Characters of a path in an error."""


class Field:
    """A JSON value, the place it comes from (`frames.jsonl:3`) and its path there (`objects[2].bbox`)."""

    def __init__(self, value: Any, place: str, path: str = "") -> None:
        """A value; `path` is empty for the whole text."""
        self.value, self.place, self.path = value, place, path

    @property
    def where(self) -> str:
        """Place and path, as errors begin."""
        path = self.path if len(self.path) <= _SHOWN else f"{self.path[:_SHOWN]}..."
        return f"{self.place}: {path}" if path else self.place

    def fail(self, expected: str, got: str | None = None) -> NoReturn:
        """Raise the error of this field."""
        raise input_error(self.where, expected, _in_words(self.value) if got is None else got)

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Errors of the library raised inside are errors of this field."""
        try:
            yield
        except (InputError, TypeError) as error:
            raise InputError(f"{self.where}: {error}") from None

    def with_value(self, value: Any) -> Field:
        """Another value at the same place."""
        return Field(value, self.place, self.path)

    def child(self, value: Any, step: str) -> Field:
        """A value one step further: `.name` or `[3]`."""
        return Field(value, self.place, (self.path + step).removeprefix("."))

    def members(self, allowed: Collection[str]) -> None:
        """Refuse anything but an object with these members; `_names` are free for notes."""
        if not isinstance(self.value, dict):
            self.fail("an object {...}")
        for key in self.value:
            if key not in allowed and not key.startswith("_"):
                close = difflib.get_close_matches(key, allowed, 1)
                expected = f"{close[0]!r}" if close else f"one of {', '.join(sorted(allowed))}"
                self.child(None, f".{key}").fail(expected, "an unknown field")

    def get(self, key: str) -> Field | None:
        """A member, or None when it is absent or null. Raises InputError where there are no members."""
        if not isinstance(self.value, dict):
            self.fail("an object {...}")
        value = self.value.get(key)
        return None if value is None else self.child(value, f".{key}")

    def need(self, key: str) -> Field:
        """A member that must be there."""
        return self.get(key) or self.child(None, f".{key}").fail("a value", "none")

    def entries(self) -> list[tuple[str, Field]]:
        """All members of an object of free names."""
        if not isinstance(self.value, dict):
            self.fail("an object {...}")
        return [(key, self.child(value, f".{key}")) for key, value in self.value.items()]

    def items(self) -> list[Field]:
        """The entries of a list."""
        if not isinstance(self.value, list):
            self.fail("a list [...]")
        return [self.child(value, f"[{i}]") for i, value in enumerate(self.value)]

    def text(self) -> str:
        """A string."""
        return self.value if isinstance(self.value, str) else self.fail("a string")

    def label(self) -> str | int:
        """A string or a whole number (3.0 is one: tools that work with floats write it)."""
        if isinstance(self.value, (str, int)) and not isinstance(self.value, bool):
            return self.value
        if isinstance(self.value, float) and self.value.is_integer():
            return int(self.value)
        self.fail("a string or a whole number")

    def number(self) -> float:
        """A finite number."""
        value = self.value
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            try:
                if math.isfinite(value):
                    return float(value)
            except OverflowError:
                pass
        self.fail("a finite number")

    def number_or_nan(self) -> float:
        """A number; null, NaN and infinities are passed on (null as NaN) for the core to judge."""
        if self.value is None:
            return math.nan
        return float(self.value) if isinstance(self.value, float) else self.number()

    def numbers(self, count: int | tuple[int, ...], unknown: bool = False) -> list[float]:
        """A list of `count` numbers, or of one of these counts; with `unknown`, null and NaN are allowed and
        become NaN."""
        counts = (count,) if isinstance(count, int) else count
        if not isinstance(self.value, list) or len(self.value) not in counts:
            self.fail(f"a list of {' or '.join(map(str, counts))} numbers")
        given = self.value
        if all((type(x) is float and x - x == 0.0) or (type(x) is int and -_MOST < x < _MOST) for x in given):
            return [float(x) for x in given]  # the usual case, quickly
        return [item.number_or_nan() if unknown else item.number() for item in self.items()]

    def array(self, shape: Sequence[int | str]) -> list[Any]:
        """Nested lists of numbers, as deep as `shape` is long; its last length, if a number, is checked."""
        length, *deeper = shape[::-1]
        if deeper:
            return [item.array(shape[1:]) for item in self.items()]
        return self.numbers(length) if isinstance(length, int) else [item.number() for item in self.items()]

    def rows(self, count: int) -> list[list[float]]:
        """A list of lists of `count` numbers."""
        return [item.numbers(count) for item in self.items()]


def parse(text: str, place: str) -> Field:
    """A JSON text. Raises InputError with the place and what is wrong with it."""
    try:
        return Field(json.loads(text), place)
    except json.JSONDecodeError as error:
        at = f"line {error.lineno}, column {error.colno}" if "\n" in text.strip() else f"column {error.colno}"
        raise input_error(place, "JSON", f"{error.msg} at {at}") from None
    except (ValueError, RecursionError) as error:
        raise input_error(place, "JSON", str(error)) from None


def _in_words(value: Any) -> str:
    if isinstance(value, list):
        return f"a list of {len(value)}" if len(value) > 4 or len(repr(value)) > 60 else json.dumps(value)
    if isinstance(value, dict):
        return f"an object of {', '.join(value) or 'nothing'}"[:80]
    return json.dumps(value)[:60]
