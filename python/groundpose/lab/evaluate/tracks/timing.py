"""Time and memory of the tracker: `python -m groundpose.lab.evaluate.tracks.timing` prints them."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time

import numpy as np

import groundpose as gp
from groundpose.lab.evaluate.tracks.made import seen_once

VEHICLES = 20
_FRAMES = 500
_INTERVAL = 0.1
_HOUR, _EARLY, _MINUTE = 36_000, 7_200, 600
"""Frames."""


def timings() -> dict[str, float]:
    """`measured` in a process of its own, whose most memory is that of the tracker."""
    ran = subprocess.run([sys.executable, "-m", __name__], stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(ran.stdout))


def measured() -> dict[str, float]:
    """Processor time of one core: microseconds per object and frame of the Python call and of smoothing.

    Of an hour at 10 Hz seconds, and by how much its most memory is above that of its first twelve minutes.
    """
    view = gp.View(gp.Camera(fx=1000.0, fy=1000.0, cx=640.0, cy=360.0), pitch=-0.1)
    frames = [_made(view, k) for k in range(_FRAMES)]
    return {"vehicles": VEHICLES, **_of_updates(view, frames), **_of_an_hour(view, frames)}


def _of_updates(view: gp.View, frames: list[gp.SeenVehicles]) -> dict[str, float]:
    tracker = gp.Tracker(view)
    start = time.process_time()
    for k, frame in enumerate(frames):
        tracker.update(frame, _INTERVAL * k)
    middle = time.process_time()
    rows = len(tracker.finish())
    end = time.process_time()
    objects = len(frames) * VEHICLES
    return {"update us": 1e6 * (middle - start) / objects, "finish us": 1e6 * (end - middle) / max(rows, 1)}


def _of_an_hour(view: gp.View, frames: list[gp.SeenVehicles]) -> dict[str, float]:
    """The frames again and again: every 50 seconds other vehicles come. Rows are taken every minute."""
    tracker, rows, early = gp.Tracker(view), 0, 0.0
    start = time.process_time()
    for k in range(_HOUR):
        tracker.update(frames[k % len(frames)], _INTERVAL * k)
        if k % _MINUTE == 0:
            rows += len(tracker.take())
        if k == _EARLY:
            early = _most_megabytes()
    rows += len(tracker.finish())
    seconds = time.process_time() - start
    return {"hour s": seconds, "hour rows": rows, "hour MB more": _most_megabytes() - early}


def _most_megabytes() -> float:
    unit = 1e6 if sys.platform == "darwin" else 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def _made(view: gp.View, frame: int) -> gp.SeenVehicles:
    """Vehicles that drive away, seen with noise."""
    n, rng = VEHICLES, np.random.default_rng(frame)
    ground = np.stack([4.0 * np.arange(n) - 40.0, np.full(n, 1.5), 20.0 + 0.2 * frame + np.arange(n)], axis=1)
    covariance = np.tile(np.diag([1e-3, 1e-3, 1e-3, 0.04, 0.04, 0.04]), (n, 1, 1))
    R = np.tile(view.R_camera_from_ground, (n, 1, 1))
    t = (ground + 0.05 * rng.normal(size=(n, 3))) @ view.R_camera_from_ground.T
    return seen_once(view, ("car",) * n, R, t, covariance)


if __name__ == "__main__":
    print(json.dumps(measured()))
