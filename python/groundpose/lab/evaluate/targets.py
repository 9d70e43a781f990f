"""What the solver must show: `groundpose evaluate targets` measures every row of it.

Writes results/solver.json and, from it, docs/results.md. Numbers other than times depend on `--trials` and
`--seed` only. Times want a quiet machine.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from groundpose.lab.contenders.own import DEFAULT
from groundpose.lab.contenders.registry import described
from groundpose.lab.contenders.use import with_scores
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import accuracy, cost, guarantee, report
from groundpose.lab.evaluate.honesty import synthetic
from groundpose.lab.evaluate.real import line_of
from groundpose.lab.evaluate.real_data import kitti
from groundpose.lab.evaluate.rows import Context, Result, Row, to_json
from groundpose.lab.targets import TARGETS


def real_keypoints(context: Context) -> Result:
    """KITTI cars with a CNN's keypoints and scores."""
    context.advance("real keypoints")
    folder = data_folder()
    if not (folder / "kitti_cnn_keypoints14_dev.npz").exists():
        return Result([], missing="the folder of real data is not there (GROUNDPOSE_DATA)")
    measured = line_of(kitti(folder), with_scores(DEFAULT))
    checks = [
        TARGETS["real above 15 deg"].check(measured["above 15 deg %"]),
        TARGETS["real median e_r"].check(measured["median e_r deg"]),
    ]
    microseconds = measured.pop("us per object")
    return Result(checks, [measured], [{"method": measured["method"], "us per object": microseconds}])


ROWS = (
    Row("p1p", "exact data, all corner pairs: the truth is among the hypotheses", guarantee.p1p_exact),
    Row("e1", "E1, 10 to 70 % outliers, no priors", accuracy.e1_moderate),
    Row("e1-90", "E1, 90 % outliers, no priors", accuracy.e1_hard),
    Row("e1-tilt", "E1, tilt prior 0.1 deg", accuracy.e1_tilt_prior),
    Row("v1", "V1, priors of the default and tilt prior 1.5 deg alone", accuracy.v1),
    Row("flat", "E3 to 5 deg and E4 to 5 px are flat without priors", accuracy.flatness),
    Row("flat-prior", "E3 to 5 deg is nearly flat with the default priors", accuracy.flatness_with_prior),
    Row("real", "real CNN keypoints, KITTI", real_keypoints),
    Row("covariance", "stated covariances hold the truth (our own target)", synthetic.coverage),
    Row("chance", "chance is refused (our own target)", synthetic.chance),
    Row("time", "time, one thread, Python batch call", cost.time_one_thread),
    Row("threads", "two threads", cost.two_threads),
    Row("memory", "memory of a batch", cost.memory),
)


def run(rows: list[Row], trials: int, seed: int, console: Console) -> list[dict[str, Any]]:
    """Measure rows, with progress on a terminal only."""
    found = []
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("")
        context = Context(trials, seed, lambda text: progress.update(task, description=text))
        for row in rows:
            found.append(to_json(row, row.run(context), f"{_command(trials, seed)} --only {row.id}"))
            _show(console, found[-1])
    return found


def _show(console: Console, row: dict[str, Any]) -> None:
    table = Table(title=row["measure"], title_justify="left", show_header=False)
    for check in row["checks"]:
        value = "-" if check["value"] is None else f"{check['value']:.4g}{check['unit']}"
        mark = Text("met", "green") if check["met"] else Text("NOT met", "red")
        table.add_row(check["what"], value, check["target"], mark)
    if row["missing"]:
        table.add_row(f"not measured: {row['missing']}")
    console.print(table)


def measure(trials: int, seed: int, out: Path, only: str, console: Console) -> bool:
    """Measure rows (comma separated; "": all) and store them beside those that are there already.

    Whether every target was met. ValueError for a row that does not exist.
    """
    wanted = [name for name in only.split(",") if name] or [row.id for row in ROWS]
    if unknown := set(wanted) - {row.id for row in ROWS}:
        raise ValueError(f"--only: expected {', '.join(r.id for r in ROWS)}, got {sorted(unknown)}")
    measured = run([row for row in ROWS if row.id in wanted], trials, seed, console)
    by_id = {row["id"]: row for row in [*report.read_json(out).get("rows", []), *measured]}
    report.write_json(
        out,
        {
            "command": _command(trials, seed),
            "versions": report.versions(),
            "machine": report.machine(),
            "libraries": described("V1"),
            "rows": [by_id[row.id] for row in ROWS if row.id in by_id],
        },
    )
    return all(row["met"] is not False for row in measured)


def _command(trials: int, seed: int) -> str:
    return f"groundpose evaluate targets --trials {trials} --seed {seed}"
