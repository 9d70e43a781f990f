"""Log of losses and metrics of a run: a CSV file, and TensorBoard if it is installed."""

from __future__ import annotations

import contextlib
import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from groundpose._writing import whole_file

METRICS = "metrics.csv"
_END = "\r\n"


@dataclass(frozen=True)
class Progress:
    """State of a run after a step.

    Args:
        step, steps: number done, and number in all.
        losses: by name.
        crops_per_second: of this step, data included.
        metrics: of the validation crops; empty if they were not evaluated at this step.
    """

    step: int
    steps: int
    losses: dict[str, float]
    crops_per_second: float
    metrics: dict[str, float]


class MetricsLog:
    """Rows `step, name, value`: losses about 1000 times in a run, metrics always."""

    def __init__(self, folder: Path, step: int) -> None:
        """Continue after `step`; rows of later steps, which will be repeated, are removed."""
        path = folder / METRICS
        kept = [["step", "name", "value"], *_rows_until(path, step)]
        with whole_file(path) as file:
            csv.writer(file, lineterminator=_END).writerows(kept)
        self._file = path.open("a", newline="")
        self._rows = csv.writer(self._file, lineterminator=_END)
        self._board: Any = None
        with contextlib.suppress(ImportError):
            from torch.utils.tensorboard import SummaryWriter

            self._board = SummaryWriter(str(folder / "tensorboard"), purge_step=step)

    def __enter__(self) -> MetricsLog:
        """Enter a `with` block, which closes the files."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the files."""
        self._file.close()
        if self._board is not None:
            self._board.close()

    def write(self, now: Progress) -> None:
        """Write the rows of a step."""
        values = dict(now.metrics)
        if now.step % max(1, now.steps // 1000) == 0:
            values |= {f"loss_{name}": value for name, value in now.losses.items()}
            values["crops_per_second"] = now.crops_per_second
        for name, value in values.items():
            self._rows.writerow([now.step, name, f"{value:.6g}"])
            if self._board is not None:
                self._board.add_scalar(name, value, now.step)
        if now.metrics:
            self._file.flush()


def _rows_until(path: Path, step: int) -> list[list[str]]:
    """The whole rows of a log up to a step: a kill may have cut off the last one."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        lines = [line for line in file if line.endswith("\n")]
    return [row for row in csv.reader(lines[1:]) if len(row) == 3 and int(row[0]) <= step]
