"""Figures of docs/honesty.md: what is stated against what is true."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from groundpose.draw.save import save_figure
from groundpose.lab.evaluate.honesty.numbers import ALLOWED, CLEAR, INDEPENDENT
from groundpose.lab.evaluate.honesty.sources import ALL_RENDERS, MANY_LOOKS, RENDERS

COVERAGE, RELIABILITY = Path("docs/honesty_coverage.png"), Path("docs/honesty_reliability.png")
_PANELS = ((RENDERS[0], INDEPENDENT), (RENDERS[0], CLEAR), (MANY_LOOKS, CLEAR), (MANY_LOOKS, ALLOWED))
_FEWEST = 10
"""Answers of a bin that is shown."""
_STATED = (("probability", "right answers"), ("ambiguity", "poses turned round"))


def draw(root: Path, trained: dict[str, Any], network: str = "default") -> None:
    """Both, of one network (the first when it is not there); none where none was measured."""
    one = trained.get(network) or next(iter(trained.values()), None)
    if one is not None:
        _coverage(root, one["vehicles"])
        _reliability(root, one["vehicles"])


def _coverage(root: Path, seen: dict[str, Any]) -> None:
    from matplotlib.figure import Figure

    panels = [
        (source, group) for source, group in _PANELS if group in seen.get(source, {}).get("coverage", {})
    ]
    figure = Figure(figsize=(3.2 * len(panels), 3.6), layout="constrained")
    for axes, (source, group) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        axes.plot([0, 100], [0, 100], color="0.7", linewidth=1.0)
        for quantity, by in seen[source]["coverage"][group]["inside"].items():
            levels = sorted(by, key=float)
            axes.plot(
                [float(level) for level in levels], [by[level] for level in levels], ".-", label=quantity
            )
        axes.set_title(f"{source}\n{group}", fontsize=8, loc="left")
        _frame(axes, "stated, %", "inside the region, %" if axes is figure.axes[0] else "", 100)
    figure.axes[0].legend(fontsize=8)
    save_figure(figure, root / COVERAGE, 90, metadata={"Software": None})


def _reliability(root: Path, seen: dict[str, Any]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    for axes, (name, true) in zip(figure.subplots(1, 2), _STATED, strict=True):
        axes.plot([0, 1], [0, 1], color="0.7", linewidth=1.0)
        for source in (ALL_RENDERS, MANY_LOOKS):
            if source in seen:
                bins = [b for b in seen[source][name]["bins"] if b[2] >= _FEWEST]
                stated, fraction, count = zip(*bins, strict=True)
                (line,) = axes.plot(stated, fraction, "-", label=source)
                axes.scatter(stated, fraction, [8.0 + 2.0 * n**0.5 for n in count], color=line.get_color())
        _frame(axes, name, f"fraction of {true}", 1)
    figure.axes[0].legend(fontsize=8)
    save_figure(figure, root / RELIABILITY, 90, metadata={"Software": None})


def _frame(axes: Any, x: str, y: str, limit: int) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_xlim(0, limit)
    axes.set_ylim(0, 1.02 * limit)
    axes.grid(visible=True, linewidth=0.4, alpha=0.5)
