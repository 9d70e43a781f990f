"""Times the renderer on one core: `python -m groundpose.simulation.render.bench OUT.json`.

Run it pinned (`taskset -c 1`) on a quiet machine. `bench_alternative.py` beside it times another package.
"""

from __future__ import annotations

import json
import platform
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from groundpose.simulation.drive import scene
from groundpose.simulation.labels import labels
from groundpose.simulation.render import Renderer, camera
from groundpose.simulation.render.context import context
from groundpose.simulation.scene import Scene
from groundpose.simulation.sheets import crop_box
from groundpose.simulation.splits import scene_seed

_SIZE = (128, 96)
_DRIVES, _FRAMES, _STEP = 6, 5, 10  # of the throughput: drives, frames of each, every so many
_LEAST_HEIGHT = 25.0  # px


def main(path: str) -> None:
    """Measure and write."""
    start = time.perf_counter()
    renderer = Renderer()
    made = {"start_s": round(time.perf_counter() - start, 2)}
    figures: dict[str, Any] = {
        "command": "taskset -c 1 python -m groundpose.simulation.render.bench",
        "machine": {
            "cpu": platform.processor() or platform.machine(),
            "renderer": context().info["GL_RENDERER"],
        },
        "throughput": {**made, **throughput(renderer)},
        "frame": frames(renderer),
        "antialiasing": antialiasing(renderer),
    }
    old = json.loads(Path(path).read_text("utf-8")) if Path(path).exists() else {}
    kept = {"alternatives": old["alternatives"]} if "alternatives" in old else {}
    Path(path).write_text(json.dumps({**figures, **kept}, indent=1) + "\n", "utf-8")


def throughput(renderer: Renderer) -> dict[str, Any]:
    """Crops with effects of every labelled vehicle of some drives, everything included: drive, labels,
    bodies, shadows, drawing, camera. The first drive, which compiles and fills the caches, is given apart."""
    spent: dict[str, float] = {"scenes": 0.0, "labels": 0.0, "staging": 0.0, "crops": 0.0}
    first, count = 0.0, 0
    for drive in range(_DRIVES + 1):
        if drive == 1:
            first, count = sum(spent.values()), 0
            spent = dict.fromkeys(spent, 0.0)
            wall = time.perf_counter()
        for frame in range(0, _FRAMES * _STEP, _STEP):
            made: Scene = _timed(spent, "scenes", lambda d=drive, f=frame: scene(scene_seed(d), f))  # type: ignore[misc]
            found = _timed(spent, "labels", lambda s=made: labels(s))  # type: ignore[misc]
            wanted = [x for x in found if x.bbox[3] - x.bbox[1] >= _LEAST_HEIGHT]
            if not wanted:
                continue
            _timed(spent, "staging", lambda s=made: renderer.stage(s))  # type: ignore[misc]
            for label in wanted:
                box = crop_box(label.bbox, _SIZE)
                _timed(spent, "crops", lambda s=made, i=label.index, b=box: renderer.crop(s, i, b, _SIZE))  # type: ignore[misc]
                count += 1
    total = sum(spent.values())
    return {
        "crops": count, "size": list(_SIZE),
        "cpu_s": round(total, 2), "wall_s": round(time.perf_counter() - wall, 2),
        "ms_a_crop": {name: round(1e3 * s / count, 2) for name, s in {**spent, "all": total}.items()},
        "crops_a_second_and_core": round(count / total, 1),
        "minutes_for_100000_on_two_cores": round(1e5 * total / count / 120.0, 1),
        "first_drive_s": round(first, 2),
        "memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }  # fmt: skip


def frames(renderer: Renderer) -> dict[str, Any]:
    """CPU seconds of 1914 x 1080 frames, staged before."""
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
    """One crop drawn with 4 samples a pixel, and at twice the width and height."""
    made = scene(scene_seed(1), 0)
    window = camera.sampled_window((800.0, 450.0, 993.0, 594.0), _SIZE)
    gl, staged = context(), renderer.stage(made)
    size, fine = (window.width, window.height), (2 * window.width, 2 * window.height)
    samples = gl.framebuffer(
        [gl.renderbuffer(size, 4, samples=4, dtype="f4")], gl.depth_renderbuffer(size, samples=4)
    )
    double = gl.framebuffer([gl.renderbuffer(fine, 4, dtype="f4")], gl.depth_renderbuffer(fine))

    def drawn(target: Any) -> float:
        times = []
        for _ in range(6):
            start = time.process_time()
            renderer.draw_into(target, staged, window)
            gl.finish()
            times.append(time.process_time() - start)
        return round(1e3 * float(np.median(times)), 1)

    return {"window": list(size), "four_samples_ms": drawn(samples), "double_size_ms": drawn(double)}


def _timed(spent: dict[str, float], name: str, call: Callable[[], Any]) -> Any:
    start = time.process_time()
    out = call()
    spent[name] += time.process_time() - start
    return out


def _cpu(call: Callable[[], Any]) -> float:
    start = time.process_time()
    call()
    return time.process_time() - start


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "results/renderer.json")
