"""`groundpose bench`: our time beside other libraries', and against a baseline."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from groundpose._writing import only_writer
from groundpose.cli.destination import Inputs
from groundpose.cli.output import complain, console, mistakes, show

OUT = Path("groundpose_bench.json")


def bench(
    only: Annotated[
        str,
        typer.Option(
            metavar="NAME,...",
            help="Some of machine, vehicles, keypoints, outliers, shape, batch, stages, overhead, "
            "instructions, native, or cases like outliers/50.",
            show_default="all but instructions and native",
        ),
    ] = "",
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Few objects, few turns: whether it runs, not how fast; half a minute."),
    ] = False,
    instructions: Annotated[
        bool,
        typer.Option("--instructions", help="Count instructions too: needs the repository, cargo, valgrind."),
    ] = False,
    native: Annotated[
        bool,
        typer.Option(
            "--native", help="Compare with a build for this very processor too: the repository, cargo."
        ),
    ] = False,
    compare: Annotated[
        Path | None, typer.Option(metavar="BASELINE", help="Exit with 1 where something is worse than there.")
    ] = None,
    save_baseline: Annotated[Path | None, typer.Option(help="Keep the run to compare with later.")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Where the numbers go (JSON).")] = OUT,
    figure: Annotated[
        Path | None, typer.Option(help="Picture to draw (.png, .svg, .pdf).", show_default="beside --out")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the objects.")] = 0,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what --out holds.")] = False,
) -> None:
    """Our time beside that of the libraries that are installed, in turns on the same objects.

    Poses are checked against the truth before anything is timed. Ours is the whole batch call, theirs are
    their own calls alone. An interrupted run goes on with the same command.

    [bold]Examples[/bold]

      groundpose bench

      groundpose bench --only vehicles,outliers/50 -o /tmp/bench.json

      groundpose bench --instructions --native -o results/bench.json --figure docs/performance.png

      groundpose bench --compare results/bench_baseline.json
    """
    with mistakes():
        _bench(only, quick, instructions, native, compare, save_baseline, out, figure, seed, fresh)


def _bench(
    only: str,
    quick: bool,
    instructions: bool,
    native: bool,
    compare: Path | None,
    save_baseline: Path | None,
    out: Path,
    figure: Path | None,
    seed: int,
    fresh: bool,
) -> None:
    from groundpose.draw import check_path
    from groundpose.lab.bench import baseline, tell
    from groundpose.lab.bench import figure as drawing
    from groundpose.lab.bench.cases import chosen
    from groundpose.lab.bench.races import QUICK, Effort, quick_seconds

    picture = figure or out.with_suffix(".png")
    check_path(picture)
    before = None if compare is None else baseline.read(compare)  # a wrong name is refused before the wait
    if compare is not None:
        Inputs(compare).refuse(out, f"-o {out}: ")
    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        cases = chosen(only, instructions, native)
    except ValueError as error:
        raise TypeError(str(error)) from error  # a usage error: one line and status 2
    if quick:
        show(f"{len(cases)} cases, a few turns of each: about {quick_seconds(c.group for c in cases):.0f} s")
    content = _measured(out, cases, replace(QUICK if quick else Effort(), seed=seed), fresh)
    if (table := tell.target_table(content["cases"])).row_count and not quick:
        console().print(table)
    drawing.write(content["cases"], picture)
    show(f"Numbers: {out.resolve()}")
    show(f"Picture: {picture.resolve()}")
    if save_baseline is not None:
        baseline.save(content, save_baseline)
        show(f"Baseline: {save_baseline.resolve()}")
    if before is not None:
        if before["machine"] != content["machine"]:
            show(f"The baseline is of another machine ({before['machine']}): ratios may differ")
        _compared(baseline.compare(content, before, {case.id for case in cases}))


def _measured(out: Path, cases: list[Any], effort: Any, fresh: bool) -> dict[str, Any]:
    """With a bar on a terminal; a table after every case."""
    from groundpose.lab.bench import tell
    from groundpose.lab.bench.races import WrongAnswer
    from groundpose.lab.bench.run import run

    screen = console(stderr=True)
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=screen, disable=not screen.is_terminal, transient=True) as progress:
        bar = progress.add_task("", total=len(cases))

        def advance(done: int, total: int, text: str) -> None:
            progress.update(bar, completed=done, total=total, description=text)

        try:
            with only_writer(out):
                return run(
                    out,
                    cases,
                    effort,
                    fresh=fresh,
                    advance=advance,
                    finished=lambda name, result: console().print(tell.result(name, result)),
                )
        except KeyboardInterrupt:
            complain(f"interrupted; what is finished is in {out}; the same command goes on")
            raise typer.Exit(130) from None
        except WrongAnswer as error:
            complain(error)
            raise typer.Exit(1) from None


def _compared(found: list[Any]) -> None:
    """Print what changed; exit status 1 when something is lost."""
    from groundpose.lab.bench import tell
    from groundpose.lab.bench.baseline import LOST

    if (table := tell.differences(found)) is not None:
        console().print(table)
    counts = {
        verdict: sum(d.verdict == verdict for d in found)
        for verdict in dict.fromkeys(d.verdict for d in found)
    }
    show("Against the baseline: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    if counts.get(LOST):
        raise typer.Exit(1)
