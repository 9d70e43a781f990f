"""Our time an object beside the libraries that are installed: what `groundpose bench` runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from groundpose.evaluate import methods, report
from groundpose.evaluate.methods import HRE_CUBE, HRE_VEHICLE
from groundpose.evaluate.rivals import RIVALS, described
from groundpose.evaluate.scenes import generate
from groundpose.evaluate.timing import Contestant, against, in_chunks, interleaved, ours, rival

SETTINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "V1": ("vehicle", {}),
    "E1 50 %": ("cube", {"outlier_ratio": 0.5}),
    "E1 90 %": ("cube", {"outlier_ratio": 0.9}),
}
SLOW_FROM = 0.7


def contestants(kind: str, outlier_ratio: float, threads: int = 1) -> dict[str, Contestant]:
    """Our ways and every installed library that is bearable at this share of outliers."""
    paper = methods.hre(HRE_VEHICLE if kind == "vehicle" else HRE_CUBE)
    found = {m.name: ours(m, threads) for m in (methods.DEFAULT, paper, methods.P3P, methods.UP2P)}
    for library in RIVALS:
        too_slow = library.slow_with_outliers and outlier_ratio >= SLOW_FROM
        if library.missing() is None and not too_slow:
            found[library.name] = rival(library)
    return found


def run(objects: int = 20, trials: int = 10, threads: int = 1, output: Path | None = None) -> dict[str, Any]:
    """Time `trials` batches of `objects` objects on every setting; print a table and return (or store) it.

    Contestants take turns on the same batches. Ours is the whole Python batch call with `threads` threads,
    the others' their own calls alone, one object at a time on one thread. Ratios are medians over batches of
    the time relative to our default.
    """
    console = Console()
    settings = []
    for name, (kind, options) in SETTINGS.items():
        scenes = generate(kind, objects * trials, **options)
        racing = contestants(kind, options.get("outlier_ratio", 0.0), threads)
        lines = against(interleaved(in_chunks(scenes, objects), racing), methods.DEFAULT.name)
        settings.append({"setting": name, "methods": lines})
        table = Table(title=f"{name}: {trials} batches of {objects}", title_justify="left")
        for column in ("method", "us an object", "times ours"):
            table.add_column(column, justify="left" if column == "method" else "right")
        for line in lines:
            table.add_row(line["method"], f"{line['us an object']:.1f}", f"{line['ratio']:.2f}")
        console.print(table)
    for library in RIVALS:
        if reason := library.missing():
            console.print(f"{library.name}: {reason}")
    content = {
        "objects": objects,
        "trials": trials,
        "threads": threads,
        "versions": report.versions(),
        "machine": report.machine(),
        "rivals": described(),
        "settings": settings,
    }
    if output is not None:
        report.write_json(output, content)
    return content
