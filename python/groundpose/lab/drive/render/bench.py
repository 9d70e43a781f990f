"""Times of the renderer on one core: crops of a training set, frames, one crop antialiased in two ways.

The command is `groundpose.lab.training.renderer_bench`; `bench_alternative.py` times another package.
"""

from __future__ import annotations

import math
import os
import platform
import resource
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from groundpose.keypoints.codec import Codec
from groundpose.lab.drive import cache
from groundpose.lab.drive.body_cache import body, length_and_width, measures
from groundpose.lab.drive.drive import scene
from groundpose.lab.drive.render import Renderer, camera
from groundpose.lab.drive.render.context import context
from groundpose.lab.drive.render.renderer import OVERSAMPLED
from groundpose.lab.drive.solids import solid
from groundpose.lab.drive.splits import bodies_of, scene_seed
from groundpose.vehicles import CLASSES

CODEC = Codec(128, 96)
FRAMES = 60  # of the throughput


Samples = Callable[[], Iterable[object]]


def forget_bodies() -> None:
    """Empty the caches in memory that a new process does not have."""
    for known in (body, measures, length_and_width, solid):
        known.cache_clear()


def measure(samples: Samples, forget: Callable[[], None]) -> dict[str, Any]:
    """All figures; `samples` draws the crops of `FRAMES` frames, at the size of `CODEC`; `forget` empties the
    caches in memory."""
    renderer = Renderer()
    return {
        "machine": {
            "cpu": platform.processor() or platform.machine(),
            "renderer": context().info["GL_RENDERER"],
        },
        "throughput": throughput(samples, forget),
        "frame": frames(renderer),
        "antialiasing": antialiasing(renderer),
    }


def throughput(samples: Samples, forget: Callable[[], None]) -> dict[str, Any]:
    """Crops as `groundpose crops` draws them, at the size of a network's crop, everything included: drive,
    labels, bodies, shadows, drawing, camera. The frames are drawn three times: with an empty cache on disk,
    by what a new process knows (bodies on disk), and with everything in memory. The extra time of the first
    pass is the time to make the bodies."""
    with tempfile.TemporaryDirectory() as folder, mock.patch.dict(os.environ, {cache.VARIABLE: folder}):
        empty, count, _ = _drawn(samples, forget)
        made = sum(1 for _ in Path(folder).glob("bodies-*/levels/*"))
        size = sum(file.stat().st_size for file in Path(folder).rglob("*.npz"))
        disk, _, wall = _drawn(samples, forget)
        memory, _, _ = _drawn(samples, lambda: None)
    bodies = (empty - disk) / made * sum(bodies_of("train", class_name) for class_name in CLASSES)
    return {
        "frames": FRAMES, "crops": count, "size": [CODEC.width, CODEC.height],
        "ms_a_crop_empty_cache": round(1e3 * empty / count, 2),
        "ms_a_crop_bodies_on_disk": round(1e3 * disk / count, 2),
        "ms_a_crop_bodies_in_memory": round(1e3 * memory / count, 2),
        "wall_ms_a_crop_bodies_on_disk": round(1e3 * wall / count, 2),
        "load": [round(n, 1) for n in os.getloadavg()],
        "bodies": made,
        "disk_mb_a_body": round(size / made / 1e6, 2),
        "all_bodies_s": round(bodies, 1),
        "minutes_for_100000_on_two_cores": round((1e5 * disk / count + bodies) / 2.0 / 60.0, 1),
        "memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }  # fmt: skip


def _drawn(samples: Samples, forget: Callable[[], None]) -> tuple[float, int, float]:
    """CPU seconds, number of crops, wall seconds."""
    forget()
    wall, start = time.perf_counter(), time.process_time()
    count = sum(1 for _ in samples())
    return time.process_time() - start, count, time.perf_counter() - wall


def frames(renderer: Renderer) -> dict[str, Any]:
    """CPU seconds of 1914 x 1080 frames; staging is not timed."""
    clean, full = [], []
    for drive in range(6):
        made = scene(scene_seed(drive), 0)
        renderer.frame(made)
        clean.append(_cpu(lambda s=made: renderer.frame(s, effects=False)))  # type: ignore[misc]
        full.append(_cpu(lambda s=made: renderer.frame(s)))  # type: ignore[misc]
    return {
        "median_s": round(float(np.median(full)), 2),
        "without_effects_s": round(float(np.median(clean)), 2),
    }


def antialiasing(renderer: Renderer) -> dict[str, Any]:
    """One crop drawn with 4 samples per pixel, and drawn larger and averaged."""
    made = scene(scene_seed(1), 0)
    window = camera.sampled_window((800.0, 450.0, 993.0, 594.0), (CODEC.width, CODEC.height))
    gl, staged = context(), renderer.stage(made)
    size = (window.width, window.height)
    fine = tuple(math.ceil(OVERSAMPLED * n) for n in size)
    samples = gl.framebuffer(
        [gl.renderbuffer(size, 4, samples=4, dtype="f4")], gl.depth_renderbuffer(size, samples=4)
    )
    larger = gl.framebuffer([gl.renderbuffer(fine, 4, dtype="f4")], gl.depth_renderbuffer(fine))

    def drawn(target: Any) -> float:
        times = []
        for _ in range(6):
            start = time.process_time()
            renderer.draw_into(target, staged, window)
            gl.finish()
            times.append(time.process_time() - start)
        return round(1e3 * float(np.median(times)), 1)

    return {
        "window": list(size),
        "four_samples_ms": drawn(samples),
        "oversampled": OVERSAMPLED,
        "oversampled_ms": drawn(larger),
    }


def _cpu(call: Callable[[], Any]) -> float:
    start = time.process_time()
    call()
    return time.process_time() - start
