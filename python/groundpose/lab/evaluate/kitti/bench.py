"""Time and memory of an evaluation on a made-up folder of labels: `groundpose evaluate speed`."""

from __future__ import annotations

import os
import resource
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._writing import write_text
from groundpose.formats.kitti.dataset import IMAGE_SIZE, KittiSet
from groundpose.formats.kitti.labels import KittiLabel, format_calibration, format_labels
from groundpose.formats.kitti.results import R_from_rotation_y, wrapped
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.kitti.frame import CAMERA_HEIGHT, Task
from groundpose.lab.evaluate.kitti.keypoints import Simulated
from groundpose.lab.evaluate.kitti.run import Advance, Worker, run
from groundpose.lab.timing import Clock

CAMERA = gp.Camera(721.5377, 721.5377, 609.5593, 172.854, image_size=IMAGE_SIZE)
# name, height, width, length: KITTI's means
_SIZES = (("Car", 1.51, 1.62, 3.90), ("Car", 1.51, 1.62, 3.90), ("Van", 2.18, 1.90, 4.97))
_OBJECTS = 5.5
"""Vehicles a frame, about as many as KITTI's frames have."""


def make_folder(root: Path, frames: int, seed: int = 0) -> None:
    """An object set of random vehicles, without images."""
    labels, calib = root / "training" / "label_2", root / "training" / "calib"
    for folder in (labels, calib):
        folder.mkdir(parents=True)
    calibration = format_calibration(CAMERA)
    rng = np.random.default_rng(seed)
    for number in range(frames):
        found = [_vehicle(rng) for _ in range(rng.poisson(_OBJECTS))]
        text = format_labels(x for x in found if x is not None)
        write_text(labels / f"{number:06d}.txt", text, sync=False)
        write_text(calib / f"{number:06d}.txt", calibration, sync=False)


def _vehicle(rng: np.random.Generator) -> KittiLabel | None:
    """One that is in the image, or None."""
    name, height, width, length = _SIZES[rng.integers(len(_SIZES))]
    z, angle = float(rng.uniform(6.0, 60.0)), float(rng.uniform(-np.pi, np.pi))
    place = np.array([rng.uniform(-0.6, 0.6) * z, CAMERA_HEIGHT, z])
    low, high = np.array([-width / 2, -height, -length / 2]), np.array([width / 2, 0.0, length / 2])
    corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1)), axis=-1).reshape(-1, 3)
    points = corners @ R_from_rotation_y(angle).T + place
    pixels = (points @ CAMERA.K.T)[:, :2] / points[:, 2:]
    whole = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
    limit = np.array(IMAGE_SIZE) - 1.0
    left, top, right, bottom = np.clip(whole, 0.0, np.concatenate([limit, limit])).tolist()
    if right - left < 5.0 or bottom - top < 5.0 or points[:, 2].min() < 1.0:
        return None
    inside = (right - left) * (bottom - top) / float(np.prod(whole[2:] - whole[:2]))
    alpha = wrapped(angle - float(np.arctan2(place[0], z)))
    x, y, z = place.tolist()
    box = (left, top, right, bottom)
    return KittiLabel(name, 1.0 - inside, 0, alpha, box, height, width, length, (x, y, z), angle)


def bench(frames: int, jobs: int, advance: Advance | None = None) -> dict[str, Any]:
    """Evaluate `frames` made-up frames by the default method, keypoints simulated; time and peak memory."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        make_folder(root, frames)
        clock, before = Clock(), sum(os.times()[:4])
        task = Task(keypoints="simulated")
        worker = Worker(KittiSet(root), task, Simulated())
        content, _ = clock(partial(run, worker, root / "out.json", jobs=jobs, advance=advance))
    return {
        "command": f"groundpose evaluate speed --frames {frames} --jobs {jobs}",
        "machine": report.machine(),
        "frames": content["frames"]["done"],
        "objects": content["objects"],
        "jobs": jobs,
        "seconds": round(clock.seconds, 1),
        "CPU seconds of all processes": round(sum(os.times()[:4]) - before, 1),
        "peak memory of the parent, MB": _peak(resource.RUSAGE_SELF),
        "peak memory of the largest process, MB": _peak(resource.RUSAGE_CHILDREN),
    }


def _peak(who: int) -> float:
    per_mb = 1e6 if sys.platform == "darwin" else 1e3  # bytes there, kilobytes elsewhere
    return round(resource.getrusage(who).ru_maxrss / per_mb, 1)
