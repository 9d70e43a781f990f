"""The paper's Fig. 4 (a) to (n) and Fig. 5 from stored results, as SVG and PNG.

What colours and lines mean is said in `contenders.styles`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from groundpose.draw.save import save_figure
from groundpose.lab.contenders.registry import contenders
from groundpose.lab.contenders.styles import style_of
from groundpose.lab.evaluate.experiments.series import MICROSECONDS, Results
from groundpose.lab.evaluate.experiments.settings import OUTLIERS


@dataclass(frozen=True)
class Panel:
    """One small diagram."""

    letter: str
    experiment: str
    curve: str
    quantity: str
    log: bool = False


ROTATION, TRANSLATION, INLIERS = "mean_e_r_deg", "mean_e_t_percent", "mean_inliers"
ITERATIONS = "mean_iterations"
E1, E2, E3 = ("E1", "outlier_ratio"), ("E2", "n_points"), ("E3", "pitch_error_deg")
E4, E4_SHIFT = ("E4", "bbox_error outward"), ("E4", "bbox_error shift")
FIGURE_4 = (
    (Panel("a", *E1, ROTATION, True), Panel("b", *E1, TRANSLATION, True), Panel("c", *E1, INLIERS)),
    (Panel("d", *E2, ROTATION, True), Panel("e", *E2, TRANSLATION, True), Panel("f", *E2, INLIERS)),
    (
        Panel("g", *E1, ITERATIONS, True),
        Panel("h", *E1, MICROSECONDS, True),
        Panel("i", *E2, ITERATIONS, True),
        Panel("j", *E2, MICROSECONDS, True),
    ),
    (
        Panel("k", *E3, ROTATION, True),
        Panel("l", *E3, INLIERS),
        Panel("m", *E4, ROTATION, True),
        Panel("n", *E4, INLIERS),
    ),
    # not in the paper: it does not say which error of a box is meant
    (Panel("m'", *E4_SHIFT, ROTATION, True), Panel("n'", *E4_SHIFT, INLIERS)),
)
VARIED_IN = {curve: experiment for experiment, curve in (E1, E2, E3, E4, E4_SHIFT)}
H3, H4, H4_SHIFT = ("HRE", E3[1]), ("HRE", E4[1]), ("HRE", E4_SHIFT[1])
FIGURE_5 = (
    (
        Panel("a", *H3, ROTATION),
        Panel("b", *H3, INLIERS),
        Panel("c", *H4, ROTATION),
        Panel("d", *H4, INLIERS),
    ),
    (Panel("c'", *H4_SHIFT, ROTATION), Panel("d'", *H4_SHIFT, INLIERS)),
)
LABELS = {
    ROTATION: "mean e_r (deg)",
    TRANSLATION: "mean e_t (%)",
    INLIERS: "mean inliers",
    ITERATIONS: "RANSAC iterations",
    MICROSECONDS: "time per object (us)",
    "outlier_ratio": "outlier ratio",
    "n_points": "points",
    "pitch_error_deg": "pitch error (deg)",
    "bbox_error outward": "box sides moved outward (px)",
    "bbox_error shift": "box shifted (px)",
}
LOG_STEPS = ((30.0, (1.0, 2.0, 3.0, 5.0)), (300.0, (1.0, 3.0)), (np.inf, (1.0,)))
"""Ticks within a decade for axes that span at most so much."""
THIN: dict[str, Any] = {"linewidth": 1.1, "markersize": 3.5}
Rows = tuple[tuple[Panel, ...], ...]
FIGURES: dict[str, tuple[str, Rows, str]] = {
    "fig4_paper": ("Fig. 4, methods of the paper", FIGURE_4, "paper"),
    "fig4_today": ("Fig. 4, today's libraries", FIGURE_4, "today"),
    "fig5": ("Fig. 5, hierarchical robust estimation", FIGURE_5, "HRE"),
}
"""{file name: (title, rows of panels, where its contenders are marked in the registry)}"""


def drawn(figure: str) -> list[str]:
    """Names of the contenders in a figure: what it is about, then those that all figures show."""
    each = {where: [one.name for one in contenders(where)] for _, _, where in FIGURES.values()}
    names = each[FIGURES[figure][2]]
    common = [name for name in names if all(name in some for some in each.values())]
    return [*(name for name in names if name not in common), *common]


def draw(results: Results, figure_name: str, outliers: str) -> Figure:
    """One figure with one legend; panels without results stay empty."""
    title, rows, _ = FIGURES[figure_name]
    methods = drawn(figure_name)
    legend_rows = -(-len(methods) // 5)
    size = (15.0, 3.1 * len(rows) + 0.28 * legend_rows + 0.6)
    figure = Figure(figsize=size, layout="constrained")
    kind = "in the whole image" if outliers == "image" else "in the object's box"
    figure.suptitle(f"{title}; outliers {kind}", fontsize=13)
    grid = figure.add_gridspec(len(rows), 12)
    handles: dict[str, Any] = {}
    for i, row in enumerate(rows):
        width = 4 if len(row) == 3 else 3
        for j, panel in enumerate(row):
            axes = figure.add_subplot(grid[i, j * width : (j + 1) * width])
            handles |= _panel(axes, results, panel, methods, outliers)
    if handles:
        lines, names = list(handles.values()), list(handles)
        figure.legend(lines, names, loc="outside lower center", ncols=5, fontsize=9, frameon=False)
    return figure


def _panel(axes: Axes, results: Results, panel: Panel, methods: list[str], outliers: str) -> dict[str, Any]:
    """Curves of one panel, {method: line}."""
    handles = {}
    for method in methods:
        x, y = results.curve(panel.experiment, panel.curve, outliers, method, panel.quantity)
        seen = np.isfinite(y)
        if seen.any():
            style = style_of(method).curve()
            (handles[method],) = axes.plot(x[seen], y[seen], label=method, **THIN, **style)
    if panel.log and handles:
        _log_axis(axes)
    axes.set_title(f"({panel.letter}) {VARIED_IN[panel.curve]}", fontsize=10, loc="left")
    axes.set_xlabel(LABELS[panel.curve], fontsize=9)
    axes.set_ylabel(LABELS[panel.quantity], fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(visible=True, which="major", linewidth=0.4, alpha=0.5)
    return handles


def _log_axis(axes: Axes) -> None:
    """Logarithmic where numbers differ by more than three times, with plain numbers at the ticks."""
    values = np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.get_lines()])
    span = values.max() / values.min()
    if not span > 3.0:
        return
    axes.set_yscale("log")
    steps = next(steps for most, steps in LOG_STEPS if span < most)
    axes.yaxis.set_major_locator(LogLocator(subs=steps))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def write(results: Results, folder: Path, names: Sequence[str] = tuple(FIGURES)) -> list[Path]:
    """Figures for both outlier models as PNG; equal results give equal files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name in names:
        _, rows, _ = FIGURES[name]
        if not any(panel.experiment in results.stores for row in rows for panel in row):
            continue
        for outliers in OUTLIERS:
            figure = draw(results, name, outliers)
            path = folder / f"{name}_{outliers}.png"
            save_figure(figure, path, 90, metadata={"Software": None})
            written.append(path)
    return written
