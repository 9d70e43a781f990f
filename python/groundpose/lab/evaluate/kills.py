"""Interrupts every long command again and again: `python -m groundpose.lab.evaluate.kills` writes
results/kills.json.

Each command runs in a folder of its own until Ctrl-C, SIGTERM or SIGKILL, in turns, ends it at a random
moment of the time that it takes. After each of the 50 the files of the folder must be whole and no process
may be left; the same command then goes on. At the end it runs undisturbed, and what it writes must be what
a run makes that was never interrupted. Needs Linux, which says whose children are left.

`simulate` is killed every few seconds besides: whole frames stay, and become more where one fits between.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.kill_inputs import drawn_frames, labels, pictures
from groundpose.lab.evaluate.whole import halves

OUT = Path("results/kills.json")
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
TIMES = 50
_GRACE = 3.0
"""Seconds in which the children of a process that has ended must end too."""
_LATEST = 12.0
"""Seconds after which a command is interrupted at the latest: it goes on, so later stages have their turn."""
_MARK = "GROUNDPOSE_KILLS"
"""Environment variable that the processes of a run hand down."""


@dataclass(frozen=True)
class Case:
    """A long command: its inputs, made in the current folder, its arguments, and the place of its results.

    `same` says whether two runs write the same bytes.
    """

    make: Callable[[], None]
    arguments: str
    out: str
    same: bool = True


def _frames() -> None:
    drawn_frames(Path("frames.jsonl"), 300)


def _images() -> None:
    pictures(Path(), 5)


def _nothing() -> None:
    pass


_IMAGES = "estimate images --boxes boxes --calib camera.json"
CASES = {
    "estimate, JSON lines": Case(_frames, "estimate frames.jsonl -o out/poses.jsonl", "out"),
    "estimate, CSV": Case(_frames, "estimate frames.jsonl -o out/poses.csv", "out"),
    "estimate, Parquet": Case(_frames, "estimate frames.jsonl -o out/poses.parquet", "out"),
    "estimate, KITTI": Case(_frames, "estimate frames.jsonl --format kitti -o out", "out"),
    "estimate, images and pictures": Case(_images, f"{_IMAGES} -o out", "out"),
    "simulate": Case(_nothing, "simulate --frames 60 --no-images --jobs 2 -o out", "out"),
    "crops": Case(_nothing, "crops out --source toy --frames 2000 --jobs 2", "out"),
    "experiment": Case(
        _nothing, "experiment E1 --trials 5 --jobs 2 -m RNSC-P1P -o out --page out/page.md", "out", False
    ),
    "evaluate kitti": Case(
        lambda: labels(Path("kitti"), 60),
        "evaluate kitti --root kitti --keypoints simulated --jobs 2 -o out/kitti.json --export out/results",
        "out",
        False,
    ),
    "train": Case(_nothing, "train smoke -o out", "out", False),
}


def run(case: Case, times: int, rng: random.Random) -> dict[str, Any]:
    """Interrupt a command so often in the current folder; what was found. A run that finishes before its
    signal does not count."""
    case.make()
    Path(case.out).mkdir()
    seconds = _undisturbed(case)
    expected = _contents(Path(case.out))
    shutil.rmtree(case.out)
    Path(case.out).mkdir()
    found: dict[str, Any] = {"seconds": round(seconds, 1), "interruptions": 0, "finished_before": 0}
    found |= {"half_files": [], "left_processes": 0}
    while found["interruptions"] < times:
        sent = SIGNALS[found["interruptions"] % len(SIGNALS)]
        finished, left = _interrupted(case, sent, rng.uniform(0.0, min(seconds, _LATEST)))
        found["finished_before" if finished else "interruptions"] += 1
        found["left_processes"] += left
        found["half_files"] += [f"{sent.name}: {line}" for line in halves(Path(case.out))]
        if finished:  # from the start again
            shutil.rmtree(case.out)
            Path(case.out).mkdir()
    _undisturbed(case)
    found["half_files"] += [f"at the end: {line}" for line in halves(Path(case.out))]
    found["left_notes"] = sorted(name for name in _names(Path(case.out)) if _is_note(name))
    found["same_result"] = _contents(Path(case.out)) == expected if case.same else None
    return found


_ROUNDS = 10
_LABELS = Case(_nothing, "simulate --frames 20000 --no-images --jobs 2 -o out", "out")
_PICTURES = Case(_nothing, "simulate --frames 60 --jobs 2 -o out", "out")
KILLED = {
    "simulate, killed every 3 s": (_LABELS, 3.0),
    "simulate with pictures, killed every 3 s": (_PICTURES, 3.0),
    "simulate with pictures, killed every 8 s": (_PICTURES, 8.0),
}
"""What is killed again and again after so many seconds."""


def killed_every(case: Case, seconds: float, times: int) -> dict[str, Any]:
    """Kill a simulation so often, each after so many seconds: the frames after each, and what is half."""
    found: dict[str, Any] = {"seconds": seconds, "frames": [], "half_files": [], "left_processes": 0}
    lines = Path(case.out) / "labels.jsonl"
    for _ in range(times):
        finished, left = _interrupted(case, signal.SIGKILL, seconds)
        found["left_processes"] += left
        found["half_files"] += halves(Path(case.out))
        found["frames"].append(len(lines.read_text(encoding="utf-8").splitlines()) if lines.exists() else 0)
        if finished:
            break
    return found


def _command(case: Case) -> list[str]:
    return [sys.executable, "-m", "groundpose.cli", *case.arguments.split()]


def _undisturbed(case: Case) -> float:
    start = time.monotonic()
    ended = subprocess.run(_command(case), capture_output=True, text=True)
    if ended.returncode not in (0, 1):
        raise RuntimeError(f"{case.arguments}: status {ended.returncode}: {ended.stderr[-2000:]}")
    return time.monotonic() - start


def _interrupted(case: Case, sent: signal.Signals, after: float) -> tuple[bool, int]:
    """Whether the command ended before the signal, and how many processes were left."""
    mark = f"{os.getpid()}-{time.monotonic_ns()}"
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    environment = {**os.environ, _MARK: mark}
    process = subprocess.Popen(_command(case), **quiet, env=environment, start_new_session=True)
    try:
        process.wait(after)
        finished = True
    except subprocess.TimeoutExpired:
        finished = False
        if sent is signal.SIGINT:  # a terminal sends it to all processes of the command
            os.killpg(process.pid, sent)
        else:
            process.send_signal(sent)
        process.wait(60)
    deadline = time.monotonic() + _GRACE
    while (left := _marked(mark)) and time.monotonic() < deadline:
        time.sleep(0.05)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    return finished, len(left)


def _marked(mark: str) -> list[int]:
    """Processes that were handed the mark and still run."""
    wanted, found = f"{_MARK}={mark}".encode(), []
    for place in Path("/proc").iterdir():
        if place.name.isdigit():
            try:
                running = place.joinpath("stat").read_text().rpartition(")")[2].split()[0] != "Z"
                if running and wanted in place.joinpath("environ").read_bytes().split(b"\0"):
                    found.append(int(place.name))
            except OSError:
                continue  # it has ended, or is not ours
    return found


def _names(folder: Path) -> list[str]:
    return [path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()]


def _is_note(name: str) -> bool:
    return any(part.startswith(".") for part in name.split("/"))


def _contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in _names(folder) if not _is_note(name)}


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--times", type=int, default=TIMES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="Cases whose name has this.")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    out = given.out.resolve()
    cases = report.read_json(out).get("cases", {})
    jobs: dict[str, tuple[Case, Callable[[Case], dict[str, Any]]]] = {
        name: (case, lambda case: run(case, given.times, random.Random(given.seed)))
        for name, case in CASES.items()
    }
    for name, (case, seconds) in KILLED.items():
        jobs[name] = (case, partial(killed_every, seconds=seconds, times=_ROUNDS))
    for name, (case, work) in jobs.items():
        if given.only in name:
            cases[name] = {"command": f"groundpose {case.arguments}", **_in_a_folder(partial(work, case))}
            found = cases[name]
            print(f"{name}: {len(found['half_files'])} half files, {found['left_processes']} processes left")
            out.parent.mkdir(parents=True, exist_ok=True)
            report.write_json(out, {"command": "python -m groundpose.lab.evaluate.kills", "cases": cases})


def _in_a_folder(work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """In an empty one of its own."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            return work()
        finally:
            os.chdir(before)


if __name__ == "__main__":
    main()
