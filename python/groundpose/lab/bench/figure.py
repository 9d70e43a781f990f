"""The figure: what an object costs against keypoints, outliers, modes, objects, threads; ours and others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from groundpose.draw.save import save_figure
from groundpose.lab.contenders.registry import DEFAULT
from groundpose.lab.contenders.styles import ORANGE, RED, in_legend_order, style_of


@dataclass(frozen=True)
class Panel:
    """One small diagram of a group of cases."""

    title: str
    group: str
    axis: str
    log: bool = True


PANELS = (
    Panel("keypoints (25 % outliers)", "keypoints", "keypoints"),
    Panel("outliers (300 keypoints)", "outliers", "outliers (%)", log=False),
    Panel("shape modes (28 keypoints; others: known shape)", "shape", "modes of our model", log=False),
    Panel("objects of a call (V1)", "batch", "objects"),
)


def draw(cases: dict[str, Any]) -> Figure:
    """Curves of everything measured; a group that was not is an empty panel that says so."""
    figure = Figure(figsize=(11.0, 12.0), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 1, height_ratios=(2.2, 1.0))
    above, below = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])  # short numbers; long names
    axes = above.subplots(2, 2)
    for axis, panel in zip(axes.flat, PANELS, strict=True):
        _curves(axis, panel, cases)
    left, right = below.subplots(1, 2)
    _bars(left, cases)
    _stages(right, cases)
    handles = {}
    for axis in axes.flat:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles[label] = handle
    names = in_legend_order(handles)
    above.legend([handles[name] for name in names], names, loc="outside lower center", ncols=4, frameon=False)
    return figure


def write(cases: dict[str, Any], path: Path) -> None:
    """PNG, SVG or PDF by the name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(draw(cases), path, 110)


def _plain(axis: Axes, title: str) -> None:
    axis.set_title(title, loc="left", fontsize=11)
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axis.set_axisbelow(True)


def _curves(axis: Axes, panel: Panel, cases: dict[str, Any]) -> None:
    found = sorted(
        (c for name, c in cases.items() if name.startswith(panel.group + "/") and c.get("lines")),
        key=lambda case: float(case["x"]),
    )
    _plain(axis, panel.title)
    if not found:
        axis.text(0.5, 0.5, "not measured", ha="center", transform=axis.transAxes)
        return
    methods = dict.fromkeys(line["method"] for case in found for line in case["lines"])
    for name in methods:
        points = [(c["x"], line["us"]) for c in found for line in c["lines"] if line["method"] == name]
        width = 2.5 if name == DEFAULT else 1.3
        x, y = zip(*points, strict=True)
        axis.plot(x, y, **style_of(name).curve(), ms=5, lw=width, label=name)
    axis.set_yscale("log")
    low, high = axis.get_ylim()
    subs = (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)  # a label or two is too few to read a curve by
    axis.yaxis.set_major_locator(LogLocator(subs=subs))
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    if panel.log:
        axis.set_xscale("log")
    ticks = [case["x"] for case in found]
    axis.xaxis.set_major_locator(FixedLocator(ticks))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xticklabels([f"{tick:,.0f}" for tick in ticks])
    axis.set_xlabel(panel.axis)
    axis.set_ylabel("time per object (µs)")


def _bars(axis: Axes, cases: dict[str, Any]) -> None:
    """V1, everybody, fastest on top."""
    lines = sorted(cases.get("vehicles", {}).get("lines", []), key=lambda line: -line["us"])
    _plain(axis, "V1, one thread: time and failures")
    for k, line in enumerate(lines):
        axis.barh(k, line["us"], color=style_of(line["method"]).colour, height=0.65)
        axis.text(
            line["us"], k, f"  {line['us']:,.0f} µs, {line['failures %']:.1f} %", va="center", fontsize=9
        )
    axis.set_yticks(range(len(lines)), [line["method"] for line in lines])
    axis.set_xscale("log")
    axis.set_xlabel("time per object (µs), percentage of failures")
    axis.grid(False, axis="y")
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axis.margins(x=0.4)


def _stages(axis: Axes, cases: dict[str, Any]) -> None:
    """Cumulative rows, known model and shape side by side."""
    _plain(axis, "our stages, each with the search")
    drawn = [(f"stages/{m}", label, c) for m, label, c in ((0, "known model", RED), (5, "M = 5", ORANGE))]
    for offset, (name, label, colour) in zip((0.2, -0.2), drawn, strict=True):
        lines = cases.get(name, {}).get("lines", [])
        lines = [*lines[1:], *lines[:1]]  # the reference has everything: last
        for k, line in enumerate(reversed(lines)):
            axis.barh(k + offset, line["us"], height=0.38, color=colour, label=label if k == 0 else None)
            axis.text(line["us"], k + offset, f"  {line['us']:.3g}", va="center", fontsize=9)
        if lines:
            axis.set_yticks(range(len(lines)), [line["method"] for line in reversed(lines)])
    axis.set_xlabel("time per object (µs)")
    axis.grid(False, axis="y")
    if axis.get_legend_handles_labels()[0]:
        axis.legend(frameon=False, loc="upper right", fontsize=9)
    axis.margins(x=0.15)
