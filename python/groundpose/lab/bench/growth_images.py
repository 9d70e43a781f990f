"""How `groundpose estimate` of a folder grows with its images: small pictures of one vehicle each."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import groundpose
from groundpose.lab.evaluate.load import JOBS, run_once

IMAGES = (1, 10, 100, 1_000, 10_000)
EXTRAPOLATED = 100_000
"""So many are not measured: their time is told by that of one image more."""
_MANY, _REPEATED = 1_000, 6
"""The least time of several runs counts, but of so many images, which take long, the only one."""
_DISTINCT = 1
"""Pictures and boxes of a folder that are files of their own; the others are their links."""


def measured(count: int, threads: int) -> dict[str, Any]:
    """Seconds of the command for so many pictures, and the most memory that it took."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            JOBS["pictures"].make(_DISTINCT)
            for name, ending in (("images", "jpg"), ("boxes", "json")):
                for number in range(_DISTINCT, count):
                    Path(name, f"{number:06d}.{ending}").hardlink_to(Path(name, f"{0:06d}.{ending}"))
            arguments = [*JOBS["pictures"].arguments(count), "--threads", str(threads)]
            runs = [_run(arguments) for _ in range(_REPEATED if count < _MANY else 1)]
        finally:
            os.chdir(before)
    return {
        "images": count,
        "threads": threads,
        "s": min(run["seconds"] for run in runs),
        "processor s": min(run["processor_seconds"] for run in runs),
        "MB at most": max(run["most_megabytes"] for run in runs),
    }


def _run(arguments: list[str]) -> dict[str, Any]:
    """One run, of which nothing is left."""
    with tempfile.TemporaryDirectory(dir=".", prefix="out") as out:
        found = run_once([*arguments, "-o", f"{out}/poses.jsonl"], Path(groundpose.__file__).parents[2])
    return found


def per_image(rows: list[dict[str, Any]], threads: int, key: str = "s") -> list[tuple[int, float]]:
    """Milliseconds of each number of images beyond those that the command for one takes, by their number."""
    own = sorted((row["images"], row[key]) for row in rows if row["threads"] == threads)
    start = own[0][1]
    return [(count, 1e3 * (took - start) / (count - 1)) for count, took in own if count > 1]


def extrapolated(rows: list[dict[str, Any]], threads: int, count: int = EXTRAPOLATED) -> float:
    """Seconds of so many images, from the largest number that was measured."""
    own = [row for row in rows if row["threads"] == threads]
    one, most = min(own, key=lambda row: row["images"]), max(own, key=lambda row: row["images"])
    each = (most["s"] - one["s"]) / (most["images"] - one["images"])
    return float(one["s"] + (count - 1) * each)
