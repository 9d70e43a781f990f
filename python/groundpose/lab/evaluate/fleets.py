"""Kills a fleet's workers and drivers: `python -m groundpose.lab.evaluate.fleets`, results/fleets.json.

Frames of cars with keypoints are estimated by one process, by two workers, and by two workers of whose runs
three lose a worker and then their driver; the same command then goes on. What the three made must be the same
bytes, part by part. Then pictures of the bundled street: frames per second of a worker against the pipeline
alone. Needs Linux, which says whose processes are whose.
"""

from __future__ import annotations

import argparse
import os
import platform
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from groundpose.demo.street import IMAGE, example
from groundpose.fleet.parts import counts_of, parts_of
from groundpose.fleet.worker import EstimateFrames
from groundpose.keypoints.pipeline import Pipeline
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.fleet_frames import keypoint_frames, picture_frames, write

OUT = Path("results/fleets.json")
KILLS, FILES, GROUPS, OBJECTS = 3, 8, 4, 8
_MARK = "GROUNDPOSE_FLEET"
"""Environment variable that the processes of a run hand down."""
_WORKER = re.compile(rb"spawn_main|ray::_Worker")
"""In the command line of a worker."""


class Fleet:
    """One run of the command, and what its workers take."""

    def __init__(self, source: Path, out: Path, workers: int, ray: str) -> None:
        """Start it."""
        arguments = ["fleet", "estimate", source, out, "--workers", workers, "--ray", ray]
        self.mark, self.begun = f"{os.getpid()}-{time.monotonic_ns()}", time.monotonic()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "groundpose.cli", *map(str, arguments)],
            env={**os.environ, _MARK: self.mark},
            stderr=subprocess.PIPE,
            text=True,
        )
        self.memory = 0.0

    def workers(self) -> list[int]:
        """Ids of the workers' processes."""
        wanted, found = f"{_MARK}={self.mark}".encode(), []
        for place in Path("/proc").iterdir():
            if place.name.isdigit():
                try:
                    ours = wanted in place.joinpath("environ").read_bytes().split(b"\0")
                    if ours and _WORKER.search(place.joinpath("cmdline").read_bytes()):
                        found.append(int(place.name))
                except OSError:
                    continue  # it has ended, or is not ours
        return found

    def look(self) -> None:
        """Note the memory of the largest worker so far, in MB."""
        for pid in [self.process.pid, *self.workers()]:
            try:
                text = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
            except OSError:
                continue
            if peak := re.search(r"VmHWM:\s*(\d+) kB", text):
                self.memory = max(self.memory, int(peak[1]) / 1e3)

    def finish(self) -> float:
        """Wait for its end; the seconds it took. Raises RuntimeError when it failed."""
        while self.process.poll() is None:
            self.look()
            time.sleep(0.2)
        _, said = self.process.communicate()
        if self.process.returncode:
            raise RuntimeError(said[-2000:])
        return time.monotonic() - self.begun

    def kill(self, parts: int, out: Path, rng: random.Random) -> dict[str, int]:
        """After so many parts more, end one worker, and a little later the driver, by SIGKILL."""
        before = _made(out)
        while self.process.poll() is None and _made(out) < before + parts:
            self.look()
            time.sleep(0.05)
        ended = self.workers()
        if ended:
            os.kill(rng.choice(ended), signal.SIGKILL)
        time.sleep(rng.uniform(0.5, 4.0))
        self.process.kill()
        self.process.communicate()
        deadline = time.monotonic() + 20.0
        while (left := self.workers()) and time.monotonic() < deadline:
            time.sleep(0.1)
        return {"parts_done": _made(out), "workers_killed": min(1, len(ended)), "workers_left": len(left)}


def _made(out: Path) -> int:
    return len(list(out.rglob("*.parquet")))


def killed(source: Path, out: Path, parts: int, workers: int, ray: str, seed: int) -> dict[str, Any]:
    """A run of which workers and driver are killed, and that goes on."""
    rng, begun, memory = random.Random(seed), time.monotonic(), 0.0
    kills = []
    for _ in range(KILLS):
        fleet = Fleet(source, out, workers, ray)
        kills.append(fleet.kill(max(1, parts // (KILLS + 1)), out, rng))
        memory = max(memory, fleet.memory)
    fleet = Fleet(source, out, workers, ray)
    fleet.finish()
    seconds = time.monotonic() - begun
    return {"kills": kills, "seconds": seconds, "worker_megabytes": max(memory, fleet.memory)}


def compared(expected: Path, made: Path) -> dict[str, Any]:
    """Whether two outputs are the same bytes, part by part."""
    names = [{p.relative_to(place): p for p in place.rglob("*.parquet")} for place in (expected, made)]
    common = names[0].keys() & names[1].keys()
    return {
        "missing_parts": len(names[0].keys() - common),
        "foreign_parts": len(names[1].keys() - common),
        "different_parts": sum(names[0][n].read_bytes() != names[1][n].read_bytes() for n in common),
        "half_files": len(list(made.rglob("*.part"))),
    }


def objects(count: int, workers: int, ray: str, seed: int) -> dict[str, Any]:
    """The measurement with keypoints."""
    frames = -(-count // (FILES * GROUPS * OBJECTS))
    with tempfile.TemporaryDirectory() as folder:
        source, alone, two, cut = (Path(folder) / name for name in ("frames", "alone", "two", "killed"))
        write(source, FILES, GROUPS, frames, OBJECTS)
        parts = parts_of(source, alone)
        single = Fleet(source, alone, 1, "none")
        seconds = single.finish()
        several = Fleet(source, two, workers, ray)
        seconds_of_two = several.finish()
        counts = counts_of(parts)
        after = killed(source, cut, len(parts), workers, ray, seed)
        found = {
            "parts": len(parts),
            "objects_per_frame": OBJECTS,
            **counts,
            "input_bytes_per_frame": sum(p.size for p in parts) / counts["frames"],
            "output_bytes_per_object": sum(p.target.stat().st_size for p in parts) / counts["objects"],
            "one_process": {"seconds": seconds, "megabytes": single.memory},
            "workers": {
                "seconds": seconds_of_two,
                "worker_megabytes": several.memory,
                **compared(alone, two),
            },
            "killed": {**after, **compared(alone, cut)},
        }
    return found


def memory(count: int) -> dict[str, dict[str, float]]:
    """Megabytes of a process by how many objects its one row group has: an eighth of `count`, and `count`."""
    from pyarrow import parquet

    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for number in (count // 8, count):
            source = Path(folder) / f"{number}.parquet"
            frames = number // OBJECTS
            parquet.write_table(keypoint_frames(frames, OBJECTS, seed=0), source, row_group_size=frames)
            fleet = Fleet(source, Path(folder) / f"poses_{number}", 1, "none")
            seconds = fleet.finish()
            found[str(number)] = {"megabytes": fleet.memory, "seconds": seconds}
    return found


def pictures(count: int) -> dict[str, Any]:
    """Frames per second of a worker and of the pipeline alone, in turns: the loops see the same machine."""
    table, street = picture_frames(20), example()
    estimate, pipeline = EstimateFrames(), Pipeline(threads=1)
    data = IMAGE.read_bytes()
    jobs: dict[str, Callable[[], Any]] = {
        "worker": lambda: estimate(table),
        "pipeline": lambda: [pipeline(data, street.bboxes, street.view) for _ in range(len(table))],
    }
    spent = dict.fromkeys(jobs, 0.0)
    for job in jobs.values():  # networks are loaded, packages imported
        job()
    for _ in range(-(-count // len(table))):
        for name, job in jobs.items():
            begun = time.process_time()
            job()
            spent[name] += time.process_time() - begun
        jobs = dict(reversed(jobs.items()))
    done = -(-count // len(table)) * len(table)
    rates = {f"{name}_frames_per_second": done / seconds for name, seconds in spent.items()}
    ratio = spent["pipeline"] / spent["worker"]
    return {"frames": done, "vehicles": len(street.bboxes), **rates, "worker_to_pipeline": ratio}


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--objects", type=int, default=1_000_000, help="0: only pictures.")
    parser.add_argument("--pictures", type=int, default=200, help="0: only objects.")
    parser.add_argument("--row-group", type=int, default=64_000, help="Objects of the largest; 0: none.")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--ray", choices=("none", "local", "auto"), default="none")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    load = os.getloadavg()[0]
    name = f"keypoints, --ray {given.ray}"
    found = report.read_json(given.out)
    found |= {
        "command": "python -m groundpose.lab.evaluate.fleets",
        "machine": {"processor": report.machine(), "cores": os.cpu_count(), "system": platform.system()},
        "versions": report.versions(),
    }
    if given.objects:
        measured = objects(given.objects, given.workers, given.ray, given.seed)
        found[name] = {"workers_asked": given.workers, "load_before": load, **measured}
        differ = measured["killed"]["different_parts"] + measured["killed"]["missing_parts"]
        print(f"{name}: {measured['objects']} objects, {differ} parts differ or are missing")
    if given.pictures:
        found["pictures"] = pictures(given.pictures)
    if given.row_group:
        found["memory"] = memory(given.row_group)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    report.write_json(given.out, found)


if __name__ == "__main__":
    main()
