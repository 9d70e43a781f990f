"""Measurements that are no race: the cost of a call without any work in it, and what this core can do."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np

import groundpose as gp
from groundpose.lab.bench.races import Effort, Tell
from groundpose.lab.bench.scenes import KEYPOINTS, car_model
from groundpose.lab.timing import clocked, median_interval, quartiles, shortest

OVERHEAD_OBJECTS = (1, 100, 1000)
_MODELS = 10
"""Models of a call: real ones hold a few classes."""


def overhead(effort: Effort, tell: Tell) -> dict[str, Any]:
    """Python's and the binding's part of a batch call: objects without a keypoint come back at once.

    Everything but the estimate is done for them: checks, conversions, arrays of results. An object costs the
    difference between calls of many and of few objects, a call what is left of a call of one.
    """
    tell("calls without work")
    calls = {count: _empty_call(count) for count in OVERHEAD_OBJECTS}
    kept = _empty_call(OVERHEAD_OBJECTS[0], kept=True)
    rounds = 3 if effort.quick else 200
    seconds = np.array([[clocked(call) for call in (*calls.values(), kept)] for _ in range(rounds)])
    one, few, many = OVERHEAD_OBJECTS
    each = (seconds[:, 2] - seconds[:, 1]) / (many - few)
    call, of_estimator = (seconds[:, k] - one * each for k in (0, 3))
    return {
        "group": "overhead",
        "label": "Python batch call without work",
        **{
            f"us {name}": {
                "median": 1e6 * float(np.median(values)),
                "quartiles": quartiles(1e6 * values),
                "95 %": median_interval(1e6 * values),
            }
            for name, values in (
                ("per call", call),
                ("per call of an estimator", of_estimator),
                ("per object", each),
            )
        },
        "bytes per object": _bytes(calls[many], many),
        "us of whole calls": {
            str(n): 1e6 * float(m) for n, m in zip(calls, np.median(seconds[:, :3], 0), strict=True)
        },
    }


def _empty_call(count: int, kept: bool = False) -> Callable[[], gp.PoseBatch]:
    """A call of `estimate_poses`, or of an `Estimator` that is kept."""
    view = gp.View(gp.Camera(1000.0, 1000.0, 957.0, 540.0, image_size=(1914, 1080)))
    mean = car_model(0)
    distinct = [gp.ShapeModel(mean.keypoints_3d, mean.bbox_3d) for _ in range(_MODELS)]
    models = [distinct[k % _MODELS] for k in range(count)]
    keypoints = np.full((count, KEYPOINTS, 2), np.nan)
    boxes = np.tile([800.0, 500.0, 900.0, 560.0], (count, 1))
    options = gp.Options()
    call: Callable[[], gp.PoseBatch] = (
        partial(gp.Estimator(view, models, options, threads=1), keypoints, boxes)
        if kept
        else partial(gp.estimate_poses, view, keypoints, boxes, models, None, options, threads=1)
    )
    if call().ok.any():
        raise AssertionError("objects without keypoints have a pose")
    return call


def _bytes(call: Callable[[], gp.PoseBatch], count: int) -> dict[str, float]:
    """Given (keypoints, boxes, a model of its own) and returned, per object."""
    poses = call()
    handed_on = ("keypoints_2d", "bboxes")
    names = [f.name for f in fields(poses) if isinstance(getattr(poses, f.name), np.ndarray)]
    sizes = {name: getattr(poses, name).nbytes / count for name in names}
    given = sum(sizes[name] for name in handed_on) + poses.models[0].keypoints_3d.nbytes
    return {"in": given, "out": sum(size for name, size in sizes.items() if name not in handed_on)}


def machine(effort: Effort, tell: Tell) -> dict[str, Any]:
    """Floating-point operations and bytes a second of one core, in a process of its own with one thread."""
    tell("what the core can do")
    one = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    size = "64" if effort.quick else "1024"
    measure = "import json; from groundpose.lab.bench.special import core_speed"
    command = [sys.executable, "-c", f"{measure}; print(json.dumps(core_speed({size})))"]
    output = subprocess.run(command, env=os.environ | one, capture_output=True, text=True, check=True).stdout
    return {"group": "machine", "label": "one core", **json.loads(output)}


def core_speed(size: int, seconds: float = 0.5) -> dict[str, float]:
    """Best of several: multiplying matrices (what the core's multiply-adds can do), copying arrays."""
    a, b = (np.random.default_rng(seed).normal(size=(size, size)) for seed in (0, 1))
    flops = 2.0 * size**3 / shortest(lambda: a @ b, seconds)
    bandwidths = {}
    for name, numbers in (("memory", 16 * size * size), ("cache", 32 * size)):  # 128 MB, 256 kB at 1024
        source, target = np.ones(numbers), np.empty(numbers)
        best = shortest(lambda pair=(target, source): np.copyto(*pair), seconds)  # type: ignore[misc]
        bandwidths[f"{name} GB/s"] = 2e-9 * source.nbytes / best  # read, and written
    return {"gflops": 1e-9 * flops, **bandwidths}
