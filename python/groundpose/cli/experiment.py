"""`groundpose experiment`: the paper's synthetic experiments, their figures and their comparison."""

from __future__ import annotations

import os
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress
from rich.table import Table

from groundpose.cli.output import console, mistakes, show
from groundpose.cli.progress import bar

RESULTS, PAGE, FIGURES = Path("results/experiments"), Path("docs/experiments.md"), Path("docs/experiments")
SIMULATED_PAGE = Path("docs/experiments_simulated.md")
TRIALS, QUICK_TRIALS = 1000, 100


class What(str, Enum):
    """What to do."""

    E1 = "E1"
    E2 = "E2"
    E3 = "E3"
    E4 = "E4"
    HRE = "HRE"
    G1 = "G1"
    G2 = "G2"
    ALL = "all"
    QUICK = "quick"
    FIGURES = "figures"
    COMPARE = "compare"


def experiment(
    what: Annotated[
        What,
        typer.Argument(
            help="An experiment, [bold]all[/bold] of E1 to HRE, [bold]quick[/bold] (a few settings), "
            "[bold]figures[/bold] (draw what is stored) or [bold]compare[/bold] (stored against a baseline)."
        ),
    ],
    trials: Annotated[
        int | None, typer.Option(min=1, help="Objects a setting; none: 1000, of the drive (G1, G2) 10000.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the scenes.")] = 0,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the results.")] = RESULTS,
    methods: Annotated[
        list[str] | None,
        typer.Option("-m", "--methods", help="A method; repeat for more. None: all installed."),
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; none: one a core. G1, G2: one.")] = None,
    fresh: Annotated[bool, typer.Option(help="Measure finished methods again.")] = False,
    baseline: Annotated[Path, typer.Option(help="Folder that `compare` compares with.")] = RESULTS,
    page: Annotated[
        Path | None, typer.Option(help="Page to write; its figures go to a folder beside it.")
    ] = None,
) -> None:
    """The paper's experiments with every contender: results, figures and a page.

    E1 to E4 and HRE are synthetic. G1 (known models) and G2 (shape models) are on vehicles of the virtual
    drive, with a simulated detector.

    A finished setting is not run again. [bold]compare[/bold] prints what changed and exits with 1 when
    accuracy or relative time is worse beyond noise.

    [bold]Examples[/bold]

      groundpose experiment all --trials 1000 --seed 0

      groundpose experiment E1 -m RNSC-P1P -m "ours, default" --trials 100 -o /tmp/e1

      groundpose experiment G2 --trials 2000 -o /tmp/g2

      groundpose experiment compare --baseline results/experiments -o /tmp/new
    """
    with mistakes():
        try:
            if what is What.COMPARE:
                _compare(baseline, out)
            elif what is What.FIGURES:
                _draw(out, page or PAGE)
            elif what in (What.G1, What.G2):
                _run_simulated(what.value, trials, seed, out, methods or None, fresh)
                _write_simulated(
                    out, page or (SIMULATED_PAGE if out == RESULTS else out / SIMULATED_PAGE.name)
                )
            else:
                _run(what, trials or TRIALS, seed, out, methods or None, jobs or os.cpu_count() or 1, fresh)
                if what is not What.QUICK:
                    _draw(out, page or (PAGE if out == RESULTS else out / PAGE.name))
        except ValueError as error:
            raise TypeError(str(error)) from error  # a usage error: one line and status 2


def _run(
    what: What, trials: int, seed: int, out: Path, wanted: list[str] | None, jobs: int, fresh: bool
) -> None:
    """With a bar on a terminal; a line an experiment elsewhere."""
    from groundpose.lab.evaluate.experiments.run import run
    from groundpose.lab.evaluate.experiments.settings import EXPERIMENTS

    names = list(EXPERIMENTS) if what is What.ALL else [what.value]
    trials = min(trials, QUICK_TRIALS) if what is What.QUICK else trials
    with bar() as progress:
        for name in names:
            store = run(name, trials, seed, out, wanted, jobs, fresh, _advance(progress, name))
            show(f"{name}: {store.path}")


def _run_simulated(
    name: str, trials: int | None, seed: int, out: Path, wanted: list[str] | None, fresh: bool
) -> None:
    """G1 or G2."""
    from groundpose.lab.evaluate.simulated.run import VEHICLES, run

    with bar() as progress:
        store = run(name, trials or VEHICLES, seed, out, wanted, fresh, _advance(progress, name))
        show(f"{name}: {store.path}")


def _write_simulated(out: Path, page: Path) -> None:
    """The page of G1 and G2."""
    from groundpose.lab.evaluate.simulated import page as writer

    show(f"Page: {writer.write(out, page)}")


def _advance(progress: Progress, name: str) -> Callable[[int, int, str], None]:
    """A bar for one experiment."""
    task = progress.add_task(name, total=None)

    def advance(done: int, total: int, text: str) -> None:
        description = f"{name} {text}" if done < total else name
        progress.update(task, completed=done, total=total, description=description)

    return advance


def _draw(out: Path, page: Path) -> None:
    """Figures and page of everything stored."""
    from groundpose.lab.evaluate.experiments import figures
    from groundpose.lab.evaluate.experiments import page as writer
    from groundpose.lab.evaluate.experiments.series import Results

    results = Results.read(out)
    folder = page.with_suffix("")
    written = figures.write(results, folder)
    show(f"{len(written)} figures: {folder}")
    show(f"Page: {writer.write(results, page, folder)}")


def _compare(baseline: Path, out: Path) -> None:
    """Print what changed; exit status 1 when something is worse."""
    from groundpose.lab.evaluate.experiments.compare import compare_folders

    if baseline.resolve() == out.resolve():
        raise ValueError("--baseline: expected another folder than --out, got the same")
    differences = compare_folders(baseline, out)
    beyond = [d for d in differences if d.beyond_noise]
    table = Table(title="Beyond noise", title_justify="left")
    for column in ("experiment", "setting", "method", "what", "before", "after", ""):
        table.add_column(column)
    for d in beyond:
        verdict = "worse" if d.worse else "better"
        numbers = (f"{d.before:.4g}", f"{d.after:.4g}")
        table.add_row(d.experiment, d.setting, d.method, d.what, *numbers, verdict)
    if beyond:
        console().print(table)
    worse = sum(d.worse for d in beyond)
    better = len(beyond) - worse
    show(f"{len(differences)} numbers changed; beyond noise {worse} worse, {better} better")
    if worse:
        raise typer.Exit(1)
