"""Stored results as curves: what figures and page read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from groundpose.lab.evaluate.experiments.settings import EXPERIMENTS
from groundpose.lab.evaluate.experiments.store import Store

Array = npt.NDArray[np.float64]
MICROSECONDS = "microseconds"


@dataclass(frozen=True)
class Results:
    """Everything stored in a folder."""

    stores: dict[str, Store]

    @classmethod
    def read(cls, folder: Path) -> Results:
        """What is there of E1 to E4 and HRE."""
        paths = {name: folder / f"{name}.json" for name in EXPERIMENTS}
        return cls({name: Store.read(path) for name, path in paths.items() if path.exists()})

    def value(self, experiment: str, setting: str, method: str, quantity: str) -> float:
        """One number; NaN when it was not measured."""
        store = self.stores.get(experiment)
        if store is None:
            return float("nan")
        if quantity == MICROSECONDS:
            number: Any = store.microseconds.get(setting, {}).get(method)
        else:
            number = store.results.get(setting, {}).get(method, {}).get(quantity)
        return float("nan") if number is None else float(number)

    def curve(
        self, experiment: str, curve: str, outliers: str, method: str, quantity: str
    ) -> tuple[Array, Array]:
        """x and y of one method; NaN where nothing was measured."""
        settings = [s for s in EXPERIMENTS[experiment] if (s.curve, s.outliers) == (curve, outliers)]
        x = np.array([s.value for s in settings])
        return x, np.array([self.value(experiment, s.key, method, quantity) for s in settings])

    def methods(self, experiment: str) -> list[str]:
        """That have results."""
        store = self.stores.get(experiment)
        found = {name for cell in store.results.values() for name in cell} if store else set()
        return [name for name in store.methods if name in found] if store else []
