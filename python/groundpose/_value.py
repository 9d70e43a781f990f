"""What the frozen dataclasses of the public interface share."""

from __future__ import annotations

from dataclasses import fields
from typing import Any


class Value:
    """Base of frozen dataclasses: copied and pickled by their fields."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Rebuild from the fields, because the checked Rust object inside cannot be pickled."""
        return type(self), tuple(getattr(self, f.name) for f in fields(self) if f.init)  # type: ignore[arg-type]

    def _set(self, **values: object) -> None:
        """Store checked values while the object is being made."""
        for name, value in values.items():
            object.__setattr__(self, name, value)
