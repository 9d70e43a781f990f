"""`groundpose evaluate kitti`: all frames of a folder, in several processes, to be stopped and gone on
with."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from groundpose._writing import only_writer, write_text
from groundpose.formats.kitti.dataset import KittiFrames
from groundpose.formats.kitti.labels import KittiLabel
from groundpose.formats.kitti.results import format_result
from groundpose.formats.skips import Skips
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.kitti.average_precision import judge
from groundpose.lab.evaluate.kitti.frame import ERROR_COLUMNS, LABEL_COLUMNS, Task, evaluate, truth_as_results
from groundpose.lab.evaluate.kitti.keypoints import KeypointSource
from groundpose.lab.evaluate.kitti.store import Line, Store
from groundpose.lab.evaluate.kitti.summary import SELF_CHECK, Collected, collect, summary
from groundpose.lab.processes import worker_pool

CHECKED_FRAMES = 200
"""The labels of so many frames are put against themselves as a check of the average precision."""
Advance = Callable[[int, int], None]
"""Called with frames done and frames in all."""


@dataclass(frozen=True)
class Worker:
    """Does one frame; copied to every process."""

    folder: KittiFrames
    task: Task
    source: KeypointSource
    export: Path | None = None
    """Folder for results in KITTI's format."""

    def __call__(self, job: tuple[str, bool]) -> Line:
        """`job`: the frame's id, and whether its labels are put against themselves. Whatever is wrong with
        one frame is said in its line: a run over a large folder must not die of it."""
        frame_id, check = job
        line = Line(frame_id, None)
        skipped = line.skipped
        try:
            frame = self.folder.read(frame_id, skipped)
            if frame is not None:
                done = evaluate(frame, self.task, self.source, skipped)
                if done is not None:
                    line.result, answers = done
                    if check:
                        truth = truth_as_results(frame)
                        classes = self.task.classes
                        line.result.hits[SELF_CHECK] = {k: judge(frame.labels, truth, k) for k in classes}
                    self._export(frame_id, answers)
        except Exception as error:
            skipped.add("frame that failed", f"frame {frame_id}: {type(error).__name__}: {error}")
        return line

    def _export(self, frame_id: str, answers: dict[str, list[KittiLabel]]) -> None:
        if self.export is None:
            return
        for name, results in answers.items():
            path = self.export / name / "data" / f"{frame_id}.txt"
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, "".join(map(format_result, results)), sync=False)


def run(
    worker: Worker,
    out: Path,
    split: Path | None = None,
    *,
    settings: dict[str, Any] | None = None,
    jobs: int = 1,
    fresh: bool = False,
    limit: int | None = None,
    advance: Advance | None = None,
) -> tuple[dict[str, Any], Collected]:
    """Evaluate what is not finished yet, then write all tables to `out`.

    Args:
        worker: what to do with a frame.
        out: JSON file of the tables; frames are kept beside it (`.frames.jsonl`).
        split: ImageSets file; None: all frames.
        settings: to store beside those of the task; frames of other settings are refused.
        jobs: processes.
        fresh: forget finished frames.
        limit: only so many frames.
        advance: called after every frame.

    Raises OSError, InputError (no such folder, another run's file, another run that writes there).
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    with only_writer(out):
        return _run(worker, out, split, settings or {}, jobs, fresh, limit, advance)


def _run(
    worker: Worker,
    out: Path,
    split: Path | None,
    settings: dict[str, Any],
    jobs: int,
    fresh: bool,
    limit: int | None,
    advance: Advance | None,
) -> tuple[dict[str, Any], Collected]:
    """Into a file that is ours alone."""
    before = Skips()
    ids = worker.folder.ids(split, before)[:limit]
    stored = {**worker.task.settings, **settings, "root": str(worker.folder.root)}
    stored["columns"] = [*LABEL_COLUMNS, *ERROR_COLUMNS]  # another version's frames are others
    store = Store.open(out.with_suffix(".frames.jsonl"), stored, fresh)
    try:
        waiting = [(name, k < CHECKED_FRAMES) for k, name in enumerate(ids) if name not in store.done]
        done = len(ids) - len(waiting)
        for line in _each(worker, waiting, jobs):
            store.add(line)
            done += 1
            if advance is not None:
                advance(done, len(ids))
    finally:
        store.close()
    wanted = set(ids)
    found = collect((line for line in store.lines() if line.id in wanted), worker.task, before)
    content = {
        "command": " ".join(["groundpose", *map(shlex.quote, sys.argv[1:])]),
        "settings": stored,
        "versions": report.versions(),
        "machine": report.machine(),
        "jobs": jobs,
        **summary(found),
    }
    report.write_json(out, content)
    return content, found


_WAITING_A_PROCESS = 64
"""Frames given to the processes ahead: memory does not grow with the folder."""
_worker: Worker | None = None


def _each(worker: Worker, jobs_waiting: list[tuple[str, bool]], jobs: int) -> Iterator[Line]:
    if jobs == 1 or len(jobs_waiting) < 2:
        yield from map(worker, jobs_waiting)
        return
    with worker_pool(jobs, _take, (worker,)) as pool:
        waiting = iter(jobs_waiting)
        while part := list(islice(waiting, _WAITING_A_PROCESS * jobs)):
            yield from pool.map(_one, part, chunksize=8)


def _take(worker: Worker) -> None:
    global _worker
    _worker = worker


def _one(job: tuple[str, bool]) -> Line:
    assert _worker is not None
    return _worker(job)
