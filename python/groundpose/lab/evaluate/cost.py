"""Rows about time, threads and memory."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np

import groundpose as gp
from groundpose.lab.contenders.contender import Contender, seconds_of
from groundpose.lab.contenders.libraries import POSELIB_TUNED
from groundpose.lab.contenders.own import DEFAULT
from groundpose.lab.contenders.registry import others
from groundpose.lab.evaluate.rows import Context, Detail, Result
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.targets import TARGETS
from groundpose.lab.timing import against, in_chunks, interleaved

THREAD_OBJECTS = 10_000
MEMORY_OBJECTS = (20_000, 40_000, 80_000)
# name: (kind, settings, target)
SETTINGS = {
    "V1": ("vehicle", {}, "v1 time"),
    "E1 50 % image": ("cube", {"outlier_ratio": 0.5, "outliers": "image"}, "e1 50 time"),
    "E1 50 % box": ("cube", {"outlier_ratio": 0.5, "outliers": "box"}, "e1 50 time"),
    "E1 90 % image": ("cube", {"outlier_ratio": 0.9, "outliers": "image"}, "e1 90 time"),
    "E1 90 % box": ("cube", {"outlier_ratio": 0.9, "outliers": "box"}, "e1 90 time"),
}


def time_one_thread(context: Context) -> Result:
    """Our default beside PoseLib tuned (on V1 every library), one thread, chunk by chunk on one input."""
    if reason := POSELIB_TUNED.missing():
        return Result([], missing=reason)
    checks, times = [], []
    for name, (kind, settings, target) in SETTINGS.items():
        context.advance(f"time {name}")
        scenes = generate(kind, context.trials, seed=context.seed, **settings)
        # on vehicles every installed library takes part: the table that people look for
        installed = [one for one in others("V1") if one.missing() is None]
        racing: list[Contender] = [DEFAULT, *(installed if kind == "vehicle" else [POSELIB_TUNED])]
        timed = {one.name: partial(seconds_of, one) for one in racing}
        lines = against(interleaved(in_chunks(scenes), timed), DEFAULT.name)
        times += [{"setting": name} | line for line in lines]
        ratio = next(line["ratio"] for line in lines if line["method"] == POSELIB_TUNED.name)
        checks.append(TARGETS[target].check(ratio, f"{name}, PoseLib tuned / ours"))
    return Result(checks, times=times)


def two_threads(context: Context) -> Result:
    """One batch of V1 objects with one and with two threads, in turns."""
    context.advance("two threads")
    scenes = generate("vehicle", 10 * context.trials, seed=context.seed)
    repeats = [scenes] * 15  # single runs differ by a quarter on a shared machine
    timed = {f"{n} threads": partial(seconds_of, replace(DEFAULT, threads=n)) for n in (1, 2)}
    seconds = interleaved(repeats, timed)
    ratio = float(np.median(seconds["1 threads"] / seconds["2 threads"]))
    times = [{"objects": len(scenes)} | line for line in against(seconds, "2 threads")]
    what = f"one thread / two threads, {len(scenes)} V1 objects"
    return Result([TARGETS["threads"].check(ratio, what)], times=times)


def memory(context: Context) -> Result:
    """Peak resident memory of fresh processes with batches of different sizes, beyond inputs and outputs."""
    if not Path("/proc/self/status").exists():
        return Result([], missing="no /proc/self/status on this system")
    lines: list[Detail] = []
    for count in MEMORY_OBJECTS:
        context.advance(f"memory {count}")
        command = [sys.executable, "-c", f"{_IN_A_PROCESS}({count}, {context.seed})))"]
        output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        lines.append(json.loads(output))
    slopes = [
        1024 * (b["peak KiB"] - a["peak KiB"]) / (b["objects"] - a["objects"])
        for a, b in itertools.pairwise(lines)
    ]
    beyond = [slope - lines[-1]["input and output B per object"] for slope in slopes]
    for line, extra in zip(lines[1:], beyond, strict=True):
        line["beyond B per object"] = extra
    return Result([TARGETS["memory"].check(max(beyond))], times=lines)


_IN_A_PROCESS = (
    "import json; from groundpose.lab.evaluate.cost import peak_of_batch as peak; print(json.dumps(peak"
)


def peak_of_batch(count: int, seed: int) -> Detail:
    """One batch of `count` V1 objects in this process, and its peak memory. Objects repeat, arrays do not."""
    few = generate("vehicle", 100, seed=seed)
    rows = np.arange(count) % len(few)
    models = [few.models[row] for row in rows.tolist()]
    keypoints, boxes = few.keypoints_2d[rows], few.bboxes[rows]
    scores = np.ones(keypoints.shape[:2])
    poses = gp.estimate_poses(few.view, keypoints, boxes, models, scores, gp.Options(), threads=1)
    arrays = [getattr(poses, f.name) for f in fields(poses)]
    out = sum(a.nbytes for a in arrays if isinstance(a, np.ndarray) and a is not keypoints and a is not boxes)
    given = keypoints.nbytes + boxes.nbytes + scores.nbytes + 16 * count  # two lists of references to models
    status = Path("/proc/self/status").read_text(encoding="ascii")
    peak = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM"))
    return {"objects": count, "peak KiB": peak, "input and output B per object": (out + given) / count}
