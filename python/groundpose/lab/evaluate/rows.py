"""One line of a table of bars: what was measured, what it had to be, whether it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

Detail = dict[str, Any]


@dataclass(frozen=True)
class Context:
    """How much to run and whom to tell."""

    trials: int
    seed: int
    advance: Callable[[str], None] = lambda text: None


@dataclass(frozen=True)
class Check:
    """One number against its bar."""

    what: str
    value: float
    limit: float
    sense: str = "at most"
    unit: str = ""

    @property
    def met(self) -> bool:
        """A value that is not a number meets nothing."""
        if self.sense == "at least":
            return bool(self.value >= self.limit)
        return bool(self.value <= self.limit)

    def shortfall(self) -> str:
        """How far off, in words; empty when met."""
        if self.met:
            return ""
        if not math.isfinite(self.value):
            return f"{self.what}: no value"
        gap = abs(self.value - self.limit)
        relative = f" ({100 * gap / abs(self.limit):.1f} %)" if self.limit else ""
        bar = f"{self.sense} {self.limit:g}{self.unit}"
        return f"{self.what}: {self.value:.4g}{self.unit}, not {bar}; missed by {gap:.3g}{relative}"


@dataclass(frozen=True)
class Result:
    """What one row of the table found."""

    checks: list[Check]
    details: list[Detail] = field(default_factory=list)
    """Rows of a table with the same keys: everything measured on the way."""
    times: list[Detail] = field(default_factory=list)
    """Like details, but numbers that differ from run to run and machine to machine."""
    missing: str = ""
    """Why nothing was measured."""
    note: str = ""
    """What a reader of the details must know not to misread them."""


def to_json(identifier: str, measure: str, result: Result, command: str) -> dict[str, Any]:
    """A row as it is stored."""
    return {
        "id": identifier,
        "measure": measure,
        "command": command,
        "met": bool(result.checks) and all(c.met for c in result.checks) if not result.missing else None,
        "missing": result.missing,
        "checks": [
            {
                "what": c.what,
                "value": c.value,
                "bar": f"{c.sense} {c.limit:g}{c.unit}",
                "unit": c.unit,
                "met": c.met,
                "shortfall": c.shortfall(),
            }
            for c in result.checks
        ],
        "note": result.note,
        "details": result.details,
        "times": result.times,
    }
