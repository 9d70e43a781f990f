"""What the solver must show: `python -m groundpose.lab.evaluate.bars` measures every row of it.

Writes results/solver.json and, from it, docs/results.md. Numbers other than times depend on `--trials` and
`--seed` only. Times want a quiet machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import accuracy, cost, guarantee, honesty, methods, report
from groundpose.lab.evaluate.real import RealMethod, our_line
from groundpose.lab.evaluate.real_data import kitti
from groundpose.lab.evaluate.rivals import described
from groundpose.lab.evaluate.rows import Check, Context, Result, to_json


@dataclass(frozen=True)
class Row:
    """One row: its name on the command line, its line in the table, and how it is measured."""

    id: str
    measure: str
    run: Callable[[Context], Result]


def real_keypoints(context: Context) -> Result:
    """KITTI cars with a CNN's keypoints and scores."""
    context.advance("real keypoints")
    folder = data_folder()
    if not (folder / "kitti_cnn_keypoints14_dev.npz").exists():
        return Result([], missing="the folder of real data is not there (GROUNDPOSE_DATA)")
    measured = our_line(kitti(folder), RealMethod(methods.DEFAULT, use_scores=True))
    checks = [
        Check("above 15 deg", measured["above 15 deg %"], 8.0, unit=" %"),
        Check("median e_r", measured["median e_r deg"], 2.3, unit=" deg"),
    ]
    microseconds = measured.pop("us an object")
    return Result(checks, [measured], [{"method": measured["method"], "us an object": microseconds}])


ROWS = (
    Row("p1p", "exact data, all corner pairs: the truth is among the hypotheses", guarantee.p1p_exact),
    Row("e1", "E1, 10 to 70 % outliers, no priors", accuracy.e1_moderate),
    Row("e1-90", "E1, 90 % outliers, no priors", accuracy.e1_hard),
    Row("e1-tilt", "E1, tilt prior 0.1 deg", accuracy.e1_tilt_prior),
    Row("v1", "V1, priors of the default and tilt prior 1.5 deg alone", accuracy.v1),
    Row("flat", "E3 to 5 deg and E4 to 5 px are flat without priors", accuracy.flatness),
    Row("flat-prior", "E3 to 5 deg is nearly flat with the default priors", accuracy.flatness_with_prior),
    Row("real", "real CNN keypoints, KITTI", real_keypoints),
    Row("covariance", "stated covariances hold the truth (our own bar)", honesty.coverage),
    Row("chance", "chance is refused (our own bar)", honesty.chance),
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
            command = (
                f"python -m groundpose.lab.evaluate.bars --trials {trials} --seed {seed} --only {row.id}"
            )
            found.append(to_json(row.id, row.measure, row.run(context), command))
            _show(console, found[-1])
    return found


def _show(console: Console, row: dict[str, Any]) -> None:
    table = Table(title=row["measure"], title_justify="left", show_header=False)
    for check in row["checks"]:
        value = "-" if check["value"] is None else f"{check['value']:.4g}{check['unit']}"
        mark = "[green]met[/]" if check["met"] else "[red]NOT met[/]"
        table.add_row(check["what"], value, check["bar"], mark)
    if row["missing"]:
        table.add_row(f"not measured: {row['missing']}")
    console.print(table)


def main(
    trials: Annotated[int, typer.Option(min=1, help="trials a setting")] = 1000,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    out: Annotated[Path, typer.Option(help="where the numbers go")] = report.SOLVER_JSON,
    only: Annotated[str, typer.Option(help="rows to measure, comma separated; others are kept")] = "",
) -> None:
    """Measure what the solver must show; write numbers and page. Exit code 1 when a bar is not met."""
    console = Console()
    wanted = [name for name in only.split(",") if name] or [row.id for row in ROWS]
    if unknown := set(wanted) - {row.id for row in ROWS}:
        raise typer.BadParameter(f"only: expected {', '.join(r.id for r in ROWS)}, got {sorted(unknown)}")
    measured = run([row for row in ROWS if row.id in wanted], trials, seed, console)
    by_id = {row["id"]: row for row in [*report.read_json(out).get("rows", []), *measured]}
    report.write_json(
        out,
        {
            "command": f"python -m groundpose.lab.evaluate.bars --trials {trials} --seed {seed}",
            "versions": report.versions(),
            "machine": report.machine(),
            "rivals": described(),
            "rows": [by_id[row.id] for row in ROWS if row.id in by_id],
        },
    )
    if out == report.SOLVER_JSON:
        console.print(f"wrote {out} and {report.write_page(Path())}")
    if not all(row["met"] is not False for row in measured):
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
