"""What a reader left out: counted by reason, with the first places of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

PLACES_KEPT = 20
"""Of each reason; a large folder may be bad throughout, and memory is bounded."""


@dataclass
class Skips:
    """Counts by reason, and where the first ones stand."""

    counts: Counter[str] = field(default_factory=Counter)
    places: dict[str, list[str]] = field(default_factory=dict)

    def add(self, reason: str, place: str) -> None:
        """One thing left out; `place` as file and line, with what stands there if that helps."""
        self.counts[reason] += 1
        kept = self.places.setdefault(reason, [])
        if len(kept) < PLACES_KEPT:
            kept.append(place)

    def merge(self, other: Skips) -> None:
        """Those of another reader."""
        self.counts.update(other.counts)
        for reason, places in other.places.items():
            kept = self.places.setdefault(reason, [])
            kept += places[: PLACES_KEPT - len(kept)]

    @property
    def total(self) -> int:
        """All of them."""
        return self.counts.total()

    def lines(self) -> list[str]:
        """One line per reason for a reader, the most frequent first."""
        return [
            f"{count} x {reason}: {self.places[reason][0]}" + (", ..." if count > 1 else "")
            for reason, count in self.counts.most_common()
        ]

    def record(self) -> list[dict[str, Any]]:
        """For JSON."""
        return [
            {"reason": reason, "count": count, "first": self.places[reason]}
            for reason, count in self.counts.most_common()
        ]

    @classmethod
    def from_record(cls, record: Iterable[dict[str, Any]]) -> Skips:
        """The inverse of `record`."""
        rows = list(record)
        counts = Counter({row["reason"]: row["count"] for row in rows})
        return cls(counts, {row["reason"]: row["first"] for row in rows})
