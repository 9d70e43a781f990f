"""Rows about time, threads and memory."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np

import groundpose as gp
from groundpose.lab.evaluate import methods
from groundpose.lab.evaluate.rivals import POSELIB_TUNED, RIVALS
from groundpose.lab.evaluate.rows import Check, Context, Detail, Result
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.evaluate.timing import against, in_chunks, interleaved, ours, rival

THREAD_OBJECTS = 10_000
MEMORY_OBJECTS = (20_000, 40_000, 80_000)
# name: (kind, settings, times PoseLib tuned must be slower)
SETTINGS = {
    "V1": ("vehicle", {}, 2.0),
    "E1 50 % image": ("cube", {"outlier_ratio": 0.5, "outliers": "image"}, 3.0),
    "E1 50 % box": ("cube", {"outlier_ratio": 0.5, "outliers": "box"}, 3.0),
    "E1 90 % image": ("cube", {"outlier_ratio": 0.9, "outliers": "image"}, 30.0),
    "E1 90 % box": ("cube", {"outlier_ratio": 0.9, "outliers": "box"}, 30.0),
}


def time_one_thread(context: Context) -> Result:
    """Our default beside PoseLib tuned (on V1 every library), one thread, chunk by chunk on one input."""
    if reason := POSELIB_TUNED.missing():
        return Result([], missing=reason)
    checks, times = [], []
    for name, (kind, settings, limit) in SETTINGS.items():
        context.advance(f"time {name}")
        scenes = generate(kind, context.trials, seed=context.seed, **settings)
        # on vehicles every installed library takes part: the table that people look for
        others = [r for r in RIVALS if r.missing() is None and (kind == "vehicle" or r is POSELIB_TUNED)]
        contestants = {methods.DEFAULT.name: ours(methods.DEFAULT)} | {r.name: rival(r) for r in others}
        lines = against(interleaved(in_chunks(scenes), contestants), methods.DEFAULT.name)
        times += [{"setting": name} | line for line in lines]
        ratio = next(line["ratio"] for line in lines if line["method"] == POSELIB_TUNED.name)
        checks.append(Check(f"{name}, PoseLib tuned / ours", ratio, limit, "at least", " x"))
    return Result(checks, times=times)


def two_threads(context: Context) -> Result:
    """One batch of V1 objects with one and with two threads, in turns."""
    context.advance("two threads")
    scenes = generate("vehicle", 10 * context.trials, seed=context.seed)
    repeats = [scenes] * 15  # single runs differ by a quarter on a shared machine
    seconds = interleaved(repeats, {f"{n} threads": ours(methods.DEFAULT, n) for n in (1, 2)})
    ratio = float(np.median(seconds["1 threads"] / seconds["2 threads"]))
    times = [{"objects": len(scenes)} | line for line in against(seconds, "2 threads")]
    what = f"one thread / two threads, {len(scenes)} V1 objects"
    return Result([Check(what, ratio, 1.8, "at least", " x")], times=times)


def memory(context: Context) -> Result:
    """Peak resident memory of fresh processes with batches of different sizes, beyond inputs and outputs."""
    if not Path("/proc/self/status").exists():
        return Result([], missing="no /proc/self/status on this system")
    lines: list[Detail] = []
    for count in MEMORY_OBJECTS:
        context.advance(f"memory {count}")
        command = [sys.executable, "-m", "groundpose.lab.evaluate.cost", str(count), str(context.seed)]
        output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        lines.append(json.loads(output))
    slopes = [
        1024 * (b["peak KiB"] - a["peak KiB"]) / (b["objects"] - a["objects"])
        for a, b in itertools.pairwise(lines)
    ]
    beyond = [slope - lines[-1]["input and output B an object"] for slope in slopes]
    for line, extra in zip(lines[1:], beyond, strict=True):
        line["beyond B an object"] = extra
    return Result(
        [Check("bytes an object beyond inputs and outputs", max(beyond), 1024, unit=" B")], times=lines
    )


def _peak_of_batch(count: int, seed: int) -> Detail:
    """One batch of `count` V1 objects in this process, and its peak memory. Objects repeat, arrays do not."""
    few = generate("vehicle", 100, seed=seed)
    rows = np.arange(count) % len(few)
    models = [few.models[row] for row in rows]
    keypoints, boxes = few.keypoints_2d[rows], few.bboxes[rows]
    scores = np.ones(keypoints.shape[:2])
    poses = gp.estimate_poses(few.view, keypoints, boxes, models, scores, gp.Options(), threads=1)
    arrays = [getattr(poses, f.name) for f in fields(poses)]
    out = sum(a.nbytes for a in arrays if isinstance(a, np.ndarray) and a is not keypoints and a is not boxes)
    given = keypoints.nbytes + boxes.nbytes + scores.nbytes + 16 * count  # two lists of references to models
    status = Path("/proc/self/status").read_text(encoding="ascii")
    peak = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM"))
    return {"objects": count, "peak KiB": peak, "input and output B an object": (out + given) / count}


if __name__ == "__main__":
    print(json.dumps(_peak_of_batch(int(sys.argv[1]), int(sys.argv[2]))))
