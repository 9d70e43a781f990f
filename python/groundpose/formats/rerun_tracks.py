"""Tracks as a recording for the Rerun viewer (`pip install groundpose[rerun]`): a timeline to scrub through.

The world is the ground under the first camera (x right, y down, z forward, the road at y = 0). Below `world`
are `vehicles/ID` (boxes with class and speed), `trails/ID` (where it was in the last seconds), `road` (lines
and lanes) and `camera`; `speed/ID` is a curve in km/h. Timelines are `frame` and `time`.
"""

from __future__ import annotations

from contextlib import ExitStack
from os import PathLike
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose._writing import whole_path
from groundpose.draw.tracks import COLOURS
from groundpose.formats.rerun_log import package, rgb
from groundpose.tracking import Tracks
from groundpose.traffic import Lane, Line
from groundpose.types import View

_TRAIL = 30
"""Frames."""
_KMH = 3.6
_USUAL = (4.3, 1.5, 1.8)
"""Length, height, width in metres of a vehicle whose size is not known."""
_ABOVE = -0.02
"""Metres, y of what lies on the road."""


class TrackLog:
    """One recording; rows are written as they come. It is whole when the `with` block ends, and not there
    when that ends with an error."""

    def __init__(
        self,
        path: str | PathLike[str],
        view: View,
        lines: tuple[Line, ...] = (),
        lanes: tuple[Lane, ...] = (),
    ) -> None:
        """`view`: of the first frame. Raises InputError when rerun-sdk is not installed."""
        self._rr, self.path, self.view = package(), path, view
        self._lines, self._lanes = lines, lanes
        self._place = ExitStack()
        self._tails: dict[int, tuple[int, FloatArray]] = {}

    def __enter__(self) -> TrackLog:
        """Begin the file. Raises OSError for a bad path."""
        rr = self._rr
        part = self._place.enter_context(whole_path(self.path))
        part.open("wb").close()  # a path that cannot be is an OSError, not a message of the library
        self._stream = rr.RecordingStream("groundpose")
        self._stream.save(str(part))
        self._stream.log("world", rr.ViewCoordinates.RDF, static=True)
        down = [0.0, -(self.view.height or _USUAL[1]), 0.0]
        turn = self.view.R_camera_from_ground.T
        self._stream.log("world/camera", rr.Transform3D(translation=down, mat3x3=turn), static=True)
        camera = self.view.camera
        size = None if camera.image_size is None else list(camera.image_size)
        pinhole = rr.Pinhole(image_from_camera=camera.K, resolution=size, camera_xyz=rr.ViewCoordinates.RDF)
        self._stream.log("world/camera", pinhole, static=True)
        self._log_road()
        return self

    def __exit__(self, *error: Any) -> None:
        """Complete the file."""
        self._stream.flush()
        self._stream.disconnect()
        self._place.__exit__(*error)

    def add(self, tracks: Tracks, complete: int) -> None:
        """More rows; none of a frame before number `complete` is to come."""
        for vehicle in tracks.vehicles():
            self._log_vehicle(vehicle)
        self._tails = {v: tail for v, tail in self._tails.items() if tail[0] >= complete - 1}

    def close(self) -> None:
        """No more rows come: nothing is left to write."""

    def _log_vehicle(self, rows: Tracks) -> None:
        rr, number = self._rr, int(rows.id[0])
        colour = rgb(COLOURS[number % len(COLOURS)])
        when = [rr.TimeColumn("frame", sequence=rows.frame), rr.TimeColumn("time", duration=rows.time)]
        size = np.where(np.isfinite(rows.size), rows.size, _USUAL)
        zeros = np.zeros(len(rows))
        half = 0.5 * rows.heading
        speeds = _KMH * rows.speed
        boxes = rr.Boxes3D.columns(
            centers=np.column_stack([rows.place[:, 0], -0.5 * size[:, 1], rows.place[:, 1]]),
            half_sizes=0.5 * size[:, [2, 1, 0]],
            quaternions=np.column_stack([zeros, np.sin(half), zeros, np.cos(half)]),
            labels=[f"{number} {name} {round(v)} km/h" for name, v in zip(rows.name, speeds, strict=True)],
            colors=[colour] * len(rows),
        )
        path = np.column_stack([rows.place[:, 0], np.full(len(rows), _ABOVE), rows.place[:, 1]])
        before = self._tails.get(number, (0, np.zeros((0, 3))))[1]
        whole = np.concatenate([before, path])
        self._tails[number] = int(rows.frame[-1]), whole[-_TRAIL:]
        trails = [whole[max(k - _TRAIL, 0) : k] for k in range(len(before) + 1, len(whole) + 1)]
        strips = rr.LineStrips3D.columns(strips=trails, colors=[colour] * len(rows))
        self._stream.send_columns(f"world/vehicles/{number}", when, boxes)
        self._stream.send_columns(f"world/trails/{number}", when, strips)
        self._stream.send_columns(f"speed/{number}", when, rr.Scalars.columns(scalars=speeds))
        # It has left after its last row; one that goes on is logged there once more.
        self._stream.set_time("frame", sequence=int(rows.frame[-1]) + 1)
        step = float(rows.time[-1] - rows.time[-2]) if len(rows) > 1 else 0.1
        self._stream.set_time("time", duration=float(rows.time[-1]) + step)
        for folder in ("vehicles", "trails"):
            self._stream.log(f"world/{folder}/{number}", rr.Clear(recursive=False))

    def _log_road(self) -> None:
        shapes = [(line.name, np.stack([line.start, line.end])) for line in self._lines]
        shapes += [(lane.name, np.concatenate([lane.polygon, lane.polygon[:1]])) for lane in self._lanes]
        if shapes:
            strips = [np.insert(points, 1, _ABOVE, axis=1) for _, points in shapes]
            named = self._rr.LineStrips3D(strips, labels=[name for name, _ in shapes])
            self._stream.log("world/road", named, static=True)
