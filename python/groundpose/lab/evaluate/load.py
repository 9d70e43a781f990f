"""Much at once: `python -m groundpose.lab.evaluate.load` writes results/load.json.

A call of a million objects, a file of 100,000 lines, a folder of 10,000 pictures: wall and processor time and
the most memory, at a tenth of each too, so that it is seen whether memory stays flat. With `--beside FOLDER`
the package of another checkout, built there, does the same in turns.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

import groundpose
from groundpose.demo.street import IMAGE, LABELS
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.kill_inputs import copies, drawn_frames

OUT = Path("results/load.json")
COUNTS = {"objects": 1_000_000, "lines": 100_000, "pictures": 10_000}
_DRAWN = 1000
"""Different scenes V1, of which a large call has copies."""
_CALL = """
import json, resource, sys, time
import numpy as np
import groundpose as gp
from groundpose.lab.evaluate.scenes import generate
count = int(sys.argv[1])
drawn = generate("vehicle", min(count, int(sys.argv[2])))
copies = count // len(drawn.bboxes)
keypoints, boxes = np.tile(drawn.keypoints_2d, (copies, 1, 1)), np.tile(drawn.bboxes, (copies, 1))
models = list(drawn.models) * copies
before = resource.getrusage(resource.RUSAGE_SELF)
start = time.monotonic()
poses = gp.estimate_poses(drawn.view, keypoints, boxes, models)
seconds = time.monotonic() - start
after = resource.getrusage(resource.RUSAGE_SELF)
processor = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
print(json.dumps({"seconds": round(seconds, 3), "processor_seconds": round(processor, 3),
                  "bytes_per_object": round((after.ru_maxrss - before.ru_maxrss) * 1024 / count),
                  "ok": int(poses.ok.sum())}))
"""


@dataclass(frozen=True)
class Job:
    """Something of which there is much: `make` its input in the current folder, `arguments` of Python."""

    make: Callable[[int], None]
    arguments: Callable[[int], list[str]]


def _nothing(count: int) -> None:
    pass


def _lines(count: int) -> None:
    drawn_frames(Path("frames.jsonl"), count, vehicles=1)


def _pictures(count: int) -> None:
    """Of one vehicle of the demo's street each."""
    content = json.loads(LABELS.read_text(encoding="utf-8"))
    left, top, right, bottom = max((o["bbox"] for o in content["objects"]), key=lambda box: box[2] - box[0])
    x, y = int(left) - 40, int(top) - 40
    with Image.open(IMAGE) as street:
        street.crop((x, y, int(right) + 40, int(bottom) + 40)).save("vehicle.jpg", quality=90)
    camera = content["camera"]
    shifted = {**camera, "cx": camera["cx"] - x, "cy": camera["cy"] - y}
    copies(Path(), count, Path("vehicle.jpg"), [[left - x, top - y, right - x, bottom - y]], shifted)


def _estimate(*arguments: str) -> list[str]:
    return ["-m", "groundpose.cli", "estimate", *arguments]


JOBS = {
    "objects": Job(_nothing, lambda count: ["-c", _CALL, str(count), str(_DRAWN)]),
    "lines": Job(_lines, lambda count: _estimate("frames.jsonl", "-o", "out/poses.jsonl")),
    "pictures": Job(
        _pictures,
        lambda count: _estimate(
            *(
                "images",
                "--boxes",
                "boxes",
                "--calib",
                "camera.json",
                "-o",
                "out/poses.jsonl",
                "--no-pictures",
            )
        ),
    ),
}


def measure(job: Job, count: int, checkouts: dict[str, Path]) -> dict[str, Any]:
    """One run of each checkout on the same input, in a folder of its own."""
    found: dict[str, Any] = {"count": count}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            job.make(count)
            for name, checkout in checkouts.items():
                Path("out").mkdir(exist_ok=True)
                found[name] = run_once(job.arguments(count), checkout)
                for path in Path("out").iterdir():
                    path.unlink()
        finally:
            os.chdir("/")
    return found


def run_once(arguments: list[str], checkout: Path) -> dict[str, Any]:
    """Time and memory of a process; of a call, as it says itself."""
    paths = [str(checkout / "python"), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    start = time.monotonic()
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            [sys.executable, *arguments], env=environment, stdout=subprocess.PIPE, stderr=errors
        )
        assert process.stdout is not None
        with process.stdout:
            told = process.stdout.read().decode()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            errors.seek(0)
            raise RuntimeError(f"status {process.returncode}: {errors.read().decode()[-2000:]}")
    whole = {
        "seconds": round(time.monotonic() - start, 2),
        "processor_seconds": round(used.ru_utime + used.ru_stime, 2),
        "most_megabytes": round(used.ru_maxrss / 1024, 1),
    }
    return whole | (json.loads(told) if told.startswith("{") else {})


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", choices=["", *JOBS], help="One of them alone.")
    parser.add_argument("--part", type=float, default=1.0, help="Of the counts, for a quick look.")
    parser.add_argument("--beside", type=Path, help="Checkout whose package does the same, built there.")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    out = given.out.resolve()
    checkouts = {"now": Path(groundpose.__file__).parents[2]}
    if given.beside is not None:
        checkouts["beside"] = given.beside.resolve()
    jobs = report.read_json(out).get("jobs", {})
    for name, job in JOBS.items():
        if given.only in ("", name):
            counts = [int(part * given.part * COUNTS[name]) for part in (0.1, 1.0)]
            jobs[name] = [measure(job, count, checkouts) for count in counts]
            print(name, json.dumps(jobs[name]), flush=True)
            content = {"command": "python -m groundpose.lab.evaluate.load", "machine": report.machine()}
            report.write_json(out, content | {"versions": report.versions(), "jobs": jobs})
    print(f"written: {out}")


if __name__ == "__main__":
    main()
