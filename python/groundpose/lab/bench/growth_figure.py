"""The figure of docs/growth.md: what an object and an image cost against how many there are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator

from groundpose.draw.save import save_figure
from groundpose.lab.bench import growth_images
from groundpose.lab.contenders.styles import ORANGE, RED

BLUE = "#2b6ca3"
Points = list[tuple[float, float]]


def _short(value: float) -> str:
    """10 k, 1 M: names of ticks that fit beside each other."""
    for unit, name in ((1e6, "M"), (1e3, "k")):
        if value >= 10.0 * unit or value == unit == 1e6:
            return f"{value / unit:g} {name}"
    return f"{value:,.10g}"


_PLAIN = FuncFormatter(lambda value, _: _short(value))


def draw(content: dict[str, Any], limits: list[dict[str, Any]]) -> Figure:
    """Six panels: objects, keypoints, images, and how near the limits an object is."""
    figure = Figure(figsize=(12.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(2, 3).flat)
    rows = [row for row in content["rows"] if not row["single precision"]]
    vehicles, cubes = ([row for row in rows if row["scene"] == scene] for scene in ("vehicle", "cube"))
    by_threads = {n: [row for row in vehicles if row["threads"] == n] for n in (1, 2)}
    _panel(axes[0], "objects of a call: time", "objects", "µs per object")
    for threads, colour in ((1, RED), (2, BLUE)):
        _curve(axes[0], _points(by_threads[threads], "objects", "us per object"), _threads(threads), colour)
    large = [row for row in by_threads[1] if row["objects"] >= 1000]
    _panel(axes[1], "objects of a call: memory, one thread", "objects", "bytes per object")
    _curve(axes[1], _points(large, "objects", "bytes per object"), "held", RED)
    _curve(axes[1], _points(large, "objects", "bytes per object, all fields"), "with all fields", ORANGE)
    _panel(axes[2], "keypoints, one thread", "keypoints", "µs per object")
    _log(axes[2])
    _curve(axes[2], _points(cubes, "keypoints", "us per object"), "", RED)
    _images(axes[3], axes[4], content["images"])
    _near(axes[5], limits)
    for axis in axes:
        if axis.get_yscale() == "linear" and axis is not axes[5]:
            axis.set_ylim(bottom=0.0)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(frameon=False, fontsize=9)
    return figure


def write(content: dict[str, Any], limits: list[dict[str, Any]], path: Path) -> None:
    """PNG, SVG or PDF by the name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(draw(content, limits), path, 110)


def _images(time: Axes, memory: Axes, rows: list[dict[str, Any]]) -> None:
    """`groundpose estimate` of a folder; what is not measured is hollow."""
    _panel(time, "folder of images: time", "images", "seconds")
    _panel(memory, "folder of images: memory", "images", "MB at most")
    _log(time)
    for threads, colour in ((1, RED), (2, BLUE)):
        own = [row for row in rows if row["threads"] == threads]
        points = _points(own, "images", "s")
        _curve(time, points, _threads(threads), colour)
        end = (float(growth_images.EXTRAPOLATED), growth_images.extrapolated(own, threads))
        time.plot(*zip(points[-1], end, strict=True), "--", color=colour, lw=1.3)
        time.plot(*end, "o", mec=colour, mfc="white", ms=6, label="extrapolated" if threads == 2 else None)
        _curve(memory, _points(own, "images", "MB at most"), _threads(threads), colour)


def _near(axis: Axes, limits: list[dict[str, Any]]) -> None:
    """How much of what a core can do an object uses."""
    axis.set_title("of what one core can do, one thread", loc="left", fontsize=11)
    axis.spines[["top", "right"]].set_visible(False)
    for k, line in enumerate(reversed(limits)):
        axis.barh(k, line["of that, %"], color=BLUE if "memory" in line["one thread"] else RED, height=0.5)
        axis.text(line["of that, %"], k, f"  {line['of that, %']:.3g} %", va="center", fontsize=9)
    names = [line["one thread"].replace(", ", ",\n") for line in reversed(limits)]
    axis.set_yticks(range(len(limits)), names, fontsize=9)
    axis.set_xlim(0.0, 100.0)
    axis.set_xlabel("%")
    if not limits:
        axis.text(0.5, 0.5, "not measured", ha="center", transform=axis.transAxes)


def _panel(axis: Axes, title: str, x: str, y: str) -> None:
    axis.set_title(title, loc="left", fontsize=11)
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.set_xscale("log")
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    axis.xaxis.set_minor_locator(NullLocator())
    for one in (axis.xaxis, axis.yaxis):
        one.set_major_formatter(_PLAIN)


def _curve(axis: Axes, points: Points, label: str, colour: str) -> None:
    x, y = zip(*points, strict=True) if points else ((), ())
    axis.plot(x, y, "o-", color=colour, ms=5, lw=1.8, label=label or None)


def _log(axis: Axes) -> None:
    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(_PLAIN)
    axis.yaxis.set_minor_formatter(NullFormatter())


def _points(rows: list[dict[str, Any]], x: str, y: str) -> Points:
    return sorted((float(row[x]), float(row[y])) for row in rows)


def _threads(count: int) -> str:
    return f"{count} thread{'s' if count > 1 else ''}"
