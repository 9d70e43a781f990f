"""Results as JSON: one file an experiment, written atomically; times apart from what is deterministic."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from groundpose.lab.evaluate import report

FOLDER = Path("results/experiments")
Cells = dict[str, dict[str, Any]]
"""{setting: {method: ...}}"""


def environment() -> dict[str, Any]:
    """Versions and machine that numbers depend on, and how busy it is (running processes, over a minute)."""
    versions = report.versions()
    try:
        versions["pycolmap"] = version("pycolmap")
    except PackageNotFoundError:
        versions["pycolmap"] = "not installed"
    load = round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None
    return {"versions": versions, "machine": report.machine(), "load": load}


@dataclass
class Store:
    """Results of one experiment."""

    path: Path
    experiment: str
    trials: int
    seed: int
    methods: dict[str, str] = field(default_factory=dict)
    """{method: what it is}"""
    results: Cells = field(default_factory=dict)
    microseconds: Cells = field(default_factory=dict)
    environment: dict[str, Any] = field(default_factory=dict)
    """Versions and machine of the last run."""

    @classmethod
    def read(cls, path: Path) -> Store:
        """FileNotFoundError when there is none."""
        if not path.exists():
            raise FileNotFoundError(f"{path}: no results there")
        raw = report.read_json(path)
        head = {key: raw[key] for key in ("experiment", "trials", "seed", "methods", "results")}
        times = raw["times"]
        return cls(path, **head, microseconds=times["microseconds"], environment=times["environment"])

    @classmethod
    def open(cls, folder: Path, experiment: str, trials: int, seed: int) -> Store:
        """What is there already, to be continued. ValueError when it was made with other trials or seed."""
        path = folder / f"{experiment}.json"
        if not path.exists():
            return cls(path, experiment, trials, seed)
        store = cls.read(path)
        if (store.trials, store.seed) != (trials, seed):
            raise ValueError(
                f"{path}: expected results of {trials} trials and seed {seed}, got {store.trials} trials and "
                f"seed {store.seed}; remove it or use another --out"
            )
        return store

    def has(self, setting: str, method: str) -> bool:
        """Whether it is finished."""
        return method in self.results.get(setting, {})

    def add(self, setting: str, numbers: dict[str, Any], microseconds: dict[str, float]) -> None:
        """Finished methods of one setting."""
        self.results.setdefault(setting, {}).update(numbers)
        self.microseconds.setdefault(setting, {}).update(microseconds)

    def forget(self, methods: list[str]) -> None:
        """Measure these again."""
        for cells in (self.results, self.microseconds):
            for cell in cells.values():
                for name in methods:
                    cell.pop(name, None)

    def write(self, settings: list[str], methods: dict[str, str], order: Iterable[str] = ()) -> None:
        """Store in the order of settings and of `order`, whatever order methods were finished in."""
        self.methods = self.methods | methods
        rank = {name: k for k, name in enumerate(dict.fromkeys([*order, *self.methods]))}

        def ordered(cells: Cells) -> Cells:
            return {
                key: dict(sorted(cells[key].items(), key=lambda item: rank.get(item[0], len(rank))))
                for key in settings
                if key in cells
            }

        now = environment()
        now["busiest_load"] = max(
            filter(None, (now.pop("load"), self.environment.get("busiest_load"))), default=None
        )
        self.environment = now
        content = {
            "experiment": self.experiment,
            "trials": self.trials,
            "seed": self.seed,
            "methods": {name: self.methods[name] for name in sorted(self.methods, key=lambda n: rank[n])},
            "results": ordered(self.results),
            "times": {
                "environment": now,
                "microseconds": ordered(self.microseconds),
            },
        }
        report.write_json(self.path, content)
