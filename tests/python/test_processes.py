"""Worker processes end with the process that started them, and what it was doing is kept."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import groundpose as gp
import pytest
from groundpose._checks import cores
from groundpose.lab.processes import worker_pool

PACKAGE = Path(gp.__file__).parents[1]
needs_signals = pytest.mark.skipif(sys.platform == "win32", reason="signals are of Unix")

# Two workers: one sleeps, one waits for work.
SLEEPERS = """
import os, signal, sys, time
from groundpose.lab.processes import worker_pool

def sleep(seconds):
    print(os.getpid(), flush=True)
    time.sleep(seconds)

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have it ignored in the background
    with worker_pool(2) as pool:
        for seconds in (0.1, 600):
            pool.submit(sleep, seconds)
"""


def lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{pid}/stat")  # a zombie waits for its parent only
    return not (status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z")


def wait_for_the_end(pids: set[int]) -> set[int]:
    """Those that still live after ten seconds."""
    deadline = time.monotonic() + 10.0
    while (left := {pid for pid in pids if lives(pid)}) and time.monotonic() < deadline:
        time.sleep(0.02)
    return left


def started(command: list[object], **more: object) -> subprocess.Popen:
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE)}
    given = [sys.executable, *map(str, command)]
    return subprocess.Popen(given, env=environment, text=True, start_new_session=True, **more)


@needs_signals
@pytest.mark.parametrize("sent", ["SIGTERM", "SIGKILL", "SIGINT"])
def test_workers_end_with_their_parent(sent, tmp_path):
    script = tmp_path / "sleepers.py"
    script.write_text(SLEEPERS)
    parent = started([script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        workers = {int(parent.stdout.readline()) for _ in range(2)}
        assert all(map(lives, workers))
        parent.send_signal(signal.Signals[sent])
        parent.wait(20)
        assert not wait_for_the_end(workers)
    finally:
        parent.kill()
        parent.stdout.close()


@needs_signals
@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc")
def test_a_command_that_is_killed_leaves_whole_frames_and_no_process(tmp_path):
    out, mark = tmp_path / "out", f"GROUNDPOSE_TEST={os.getpid()}-{time.monotonic_ns()}"
    arguments = ("simulate", "--frames", 100_000, "--no-images", "--jobs", 2, "-o", out)
    arguments += ("--seed", 12, "--split", "validation")  # a country road: few bodies to make
    parent = started(["-c", f"import os; os.environ.update([{mark.split('=')!r}])\n{MAIN}", *arguments])
    try:
        lines = out / "labels.jsonl"
        deadline = time.monotonic() + 60.0
        while not (workers := marked(mark)) and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.5)
        parent.kill()
        parent.wait(20)
        assert workers
        assert not wait_for_the_end(workers)
    finally:
        parent.kill()
    whole = [json.loads(line) for line in lines.read_text().splitlines(keepends=True) if line[-1] == "\n"]
    assert [frame["id"] for frame in whole] == list(range(len(whole)))
    assert whole
    for frame in whole:
        assert (out / "training" / "label_2" / f"{frame['id']:06d}.txt").exists()


MAIN = "from groundpose.cli.start import main\nmain()"


def marked(mark: str) -> set[int]:
    """Processes that were handed down a variable of the environment."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if mark.encode() in path.read_bytes().split(b"\0"):
                found.add(int(path.parent.name))
        except OSError:  # of another user, or ended
            continue
    return found


def test_no_more_processes_than_cores():
    with worker_pool(10_000) as pool:
        assert pool._max_workers <= cores()
        assert sorted(pool.map(abs, [-1, -2])) == [1, 2]


def exit_now() -> None:
    os._exit(9)  # as the system does when memory is short


def test_a_worker_that_the_system_ends_is_a_line():
    with (
        pytest.raises(gp.InputError, match="jobs: expected as many processes as memory"),
        worker_pool(1) as p,
    ):
        p.submit(exit_now).result()
