"""Lines and lanes in pictures of tracks, with how many vehicles have crossed them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle
from string import ascii_uppercase
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose.tracking import Tracks
from groundpose.traffic import CrossingCounter, Lane, Line
from groundpose.types import View

LINE, LANE = "#F0E442", "#FFFFFF"
"""Colours over a picture."""
_PRINTED = "#222222"
"""Of lines and names on white."""
_STEPS = 24
"""Pieces of a side, which a lens bends."""


class RoadMarks:
    """Lines and lanes to draw. They count what crosses them in the rows that they are given."""

    def __init__(self, lines: tuple[Line, ...], lanes: tuple[Lane, ...]) -> None:
        """At least one of them. Raises InputError."""
        self.lines, self.lanes = lines, lanes
        self._counter = CrossingCounter(lines, lanes)

    def count(self, tracks: Tracks, complete: int) -> None:
        """More rows; see `CrossingCounter.add`."""
        self._counter.add(tracks, complete)

    def label(self, line: Line) -> str:
        """Its name, and how many have crossed it each way."""
        counts = self._counter.counts
        ways = [
            sum(n for (name, _, way), n in counts.items() if (name, way) == (line.name, word))
            for word in line.directions
        ]
        return f"{line.name}: " + " + ".join(map(str, ways))

    def paint(self, pen: Any, view: View, down: float) -> None:
        """Over a picture, for Pillow's pen; the road lies `down` metres below the camera."""
        for lane in self.lanes:
            _stroke(pen, view, down, np.concatenate([lane.polygon, lane.polygon[:1]]), LANE, 1)
        said = []
        for letter, line in self._lettered():
            colour = LINE if line in self.lines else LANE
            middle = _stroke(pen, view, down, np.stack([line.start, line.end]), colour, 2)
            said.append(f"{letter}  {self.label(line)}")
            if middle is not None:
                x, y = middle
                pen.ellipse([x - 7, y - 7, x + 7, y + 7], fill="#000000", outline=colour)
                pen.text(middle, letter, fill=colour, anchor="mm")
        table = "\n".join(said)
        left, top, right, bottom = pen.multiline_textbbox((12, 10), table)
        pen.rectangle([left - 6, top - 5, right + 6, bottom + 5], fill="#000000")
        pen.multiline_text((12, 10), table, fill=LANE)

    def _lettered(self) -> Iterator[tuple[str, Line]]:
        return zip(cycle(ascii_uppercase), self._counter.lines, strict=False)

    def plot(self, axes: Any) -> None:
        """On matplotlib's axes of the ground, metres right and forward."""
        for lane in self.lanes:
            axes.fill(*lane.polygon.T, facecolor="#00000010", edgecolor="#888888", linewidth=0.8)
        for letter, line in self._lettered():
            ends = np.stack([line.start, line.end])
            style = "-" if line in self.lines else ":"
            axes.plot(
                *ends.T, color=_PRINTED, linewidth=1.2, linestyle=style, label=f"{letter}  {self.label(line)}"
            )
            box = {"boxstyle": "circle,pad=0.15", "facecolor": "#FFFFFF", "edgecolor": _PRINTED}
            axes.annotate(letter, line.end, fontsize=6, color=_PRINTED, bbox=box, ha="center", va="center")
        axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), fontsize=8, handlelength=1.5)


def _stroke(
    pen: Any, view: View, down: float, corners: FloatArray, colour: str, width: int
) -> tuple[float, float] | None:
    """A path over the ground, where the picture shows it; the middle of what it shows."""
    pieces = np.linspace(corners[:-1], corners[1:], _STEPS + 1, axis=1).reshape(-1, 2)
    ground = np.column_stack([pieces[:, 0], np.full(len(pieces), down), pieces[:, 1]])
    points = view.camera.image_of(ground @ view.R_camera_from_ground.T)
    known = np.asarray(np.isfinite(points).all(axis=1))
    for a, b in zip(points[:-1][known[:-1] & known[1:]], points[1:][known[:-1] & known[1:]], strict=True):
        pen.line([*a, *b], fill=colour, width=width)
    size = view.camera.image_size
    inside = known
    if size is not None:
        inside = known & np.asarray((points >= 0.0).all(axis=1) & (points < size).all(axis=1))
    if not inside.any():
        return None
    middle = points[inside][int(inside.sum()) // 2]
    return float(middle[0]), float(middle[1])
