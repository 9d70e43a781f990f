"""One row of `evaluate targets`: how it is measured, what was found, how that is stored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from groundpose.lab.targets import Check

Detail = dict[str, Any]


@dataclass(frozen=True)
class Context:
    """How much to run and whom to tell."""

    trials: int
    seed: int
    advance: Callable[[str], None] = lambda text: None


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


@dataclass(frozen=True)
class Row:
    """One row: its name on the command line, its line in the table, and how it is measured."""

    id: str
    measure: str
    run: Callable[[Context], Result]


def to_json(row: Row, result: Result, command: str) -> dict[str, Any]:
    """A row as it is stored."""
    return {
        "id": row.id,
        "measure": row.measure,
        "command": command,
        "met": bool(result.checks) and all(c.met for c in result.checks) if not result.missing else None,
        "missing": result.missing,
        "checks": [
            {
                "what": c.what,
                "value": c.value,
                "target": c.target.text(),
                "unit": c.target.unit,
                "met": c.met,
                "shortfall": c.shortfall(),
            }
            for c in result.checks
        ],
        "note": result.note,
        "details": result.details,
        "times": result.times,
    }
