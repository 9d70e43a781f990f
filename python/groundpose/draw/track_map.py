"""All tracks seen from above in one picture."""

from __future__ import annotations

from collections import OrderedDict
from os import PathLike

import numpy as np

from groundpose._checks import FloatArray
from groundpose.draw.colours import GRID, PAPER
from groundpose.draw.road_marks import RoadMarks
from groundpose.draw.save import save_figure
from groundpose.draw.tracks import colour_of
from groundpose.tracking import Tracks

_STEP = 0.5
"""Metres between points of a line."""
_MOST = 1000
"""Vehicles; more cannot be told apart, and fill the memory."""
_KMH = 3.6


class TrackMap:
    """The ways of the last 1000 vehicles, with speeds."""

    def __init__(self, path: str | PathLike[str], marks: RoadMarks | None = None) -> None:
        """Raises InputError for a name that is none of a picture."""
        from groundpose.draw.picture import check_path

        check_path(path)
        self.path, self._marks = path, marks
        self._ways: OrderedDict[int, FloatArray] = OrderedDict()
        self._left_out = 0

    def add(self, tracks: Tracks, complete: int) -> None:
        """More rows; none of a frame before number `complete` is to come."""
        if self._marks is not None:
            self._marks.count(tracks, complete)
        for vehicle in tracks.vehicles():
            number = int(vehicle.id[0])
            way = np.column_stack([vehicle.place, _KMH * vehicle.speed])
            before = self._ways.pop(number, None)
            self._ways[number] = _thinned(way if before is None else np.concatenate([before, way]))
        while len(self._ways) > _MOST:
            self._ways.popitem(last=False)
            self._left_out += 1

    def close(self) -> None:
        """Draw it."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 8), facecolor=PAPER)
        axes = figure.add_subplot()
        if self._marks is not None:
            self._marks.plot(axes)
        for number, way in self._ways.items():
            colour, end = colour_of(number), way[-1]
            axes.plot(way[:, 0], way[:, 1], color=colour, linewidth=1.4)
            axes.plot(end[0], end[1], color=colour, marker="o", markersize=3)
            said = f"{number}: {round(float(np.median(way[:, 2])))}"
            axes.annotate(said, end[:2], fontsize=7, color=colour)
        axes.plot(0.0, 0.0, marker="^", color="#000000", markersize=9)
        axes.set(xlabel="metres to the right", ylabel="metres forward", aspect="equal")
        axes.grid(color=GRID)
        more = f", without the {self._left_out} before" if self._left_out else ""
        axes.set_title(f"Tracks: number, median speed along the way in km/h{more}", fontsize=11)
        save_figure(figure, self.path, 120)


def _thinned(way: FloatArray) -> FloatArray:
    """Points `_STEP` apart along a way, its first and its last."""
    gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1))])
    steps = np.floor(gone / _STEP)
    kept = np.concatenate([[True], steps[1:] > steps[:-1]])
    kept[-1] = True
    return np.asarray(way[kept])
