"""Records of `LABEL` by the names of their fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from groundpose.lab.training.crops import LABEL, Records

UNKNOWN: Mapping[str, Any] = {"alpha": np.nan, "size": np.nan, "camera": np.nan}
"""Fields that mean nothing without a labelled vehicle and camera."""


def record_of(values: Mapping[str, Any]) -> Records:
    """A record with these values; the other fields are `UNKNOWN` or 0. Fields that `LABEL` lacks are left."""
    made = np.zeros((), dtype=LABEL)
    for name, value in {**UNKNOWN, **values}.items():
        if name in (LABEL.names or ()):
            made[name] = value
    return made
