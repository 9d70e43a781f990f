"""`groundpose evaluate tracks`: sequences, contenders, numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import groundpose as gp
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.tracks.calibrated import PRIORS
from groundpose.lab.evaluate.tracks.drive import DriveVideo, moved, without_motion
from groundpose.lab.evaluate.tracks.errors import Errors, Said, passages, truth_of
from groundpose.lab.evaluate.tracks.identity import identity
from groundpose.lab.evaluate.tracks.kitti import FRAME_INTERVAL, KittiSequences
from groundpose.lab.evaluate.tracks.rivals import plain_kalman, sort
from groundpose.lab.evaluate.tracks.sequence import Sequence
from groundpose.lab.evaluate.tracks.timing import timings

JSON = Path("results/tracks.json")
TABLE = "kitti_vehicles_dev.npz"
ALONE, PLAIN, SORT, FILTER, SMOOTHED = (
    *("every frame alone", "plain Kalman filter", "SORT on the boxes"),
    *("tracker, frames so far", "tracker, all frames"),
)

Contender = Callable[[Sequence], Said]


def followed(sequence: Sequence, options: gp.TrackOptions | None = None) -> tuple[gp.Tracks, gp.Tracks]:
    """Rows of every frame as they came, and smoothed ones."""
    given = options or gp.TrackOptions(camera_motion=sequence.camera_motion, least_sightings=1)  # type: ignore[arg-type]
    tracker, now, last = gp.Tracker(sequence.view, given), [], None
    for frame in sequence.frames:
        ego = None
        if last is not None and given.camera_motion == "odometry":
            ego = moved(last.ego, frame.ego)
        now.append(tracker.update(frame.poses, frame.time, ego))
        last = frame
    return gp.Tracks.join(now), tracker.finish()


def numbers_of(sequences: list[Sequence]) -> list[dict[str, Any]]:
    """A row for each contender on the same sequences."""
    both = [followed(sequence) for sequence in sequences]
    said: dict[str, list[Said]] = {
        ALONE: [Said.of_poses(sequence) for sequence in sequences],
        PLAIN: [plain_kalman(sequence) for sequence in sequences],
        SORT: [sort(sequence, FRAME_INTERVAL) for sequence in sequences],
        FILTER: [Said.of_tracks(now) for now, _ in both],
        SMOOTHED: [Said.of_tracks(smoothed) for _, smoothed in both],
    }
    rows = []
    for name, parts in said.items():
        pairs = list(zip(parts, sequences, strict=True))
        errors = Errors.join([Errors.of(part, sequence) for part, sequence in pairs])
        row: dict[str, Any] = {"contender": name, **errors.numbers()}
        if name == ALONE:
            row = {key: value for key, value in row.items() if "speed" not in key}
        else:
            row |= identity(pairs) | passage_numbers(pairs)
        rows.append(row)
    return rows


def passage_numbers(pairs: list[tuple[Said, Sequence]]) -> dict[str, float | int]:
    """Of the mean speeds of vehicles; nothing where no speed is known."""
    off = np.concatenate([passages(said, truth_of(said, sequence)) for said, sequence in pairs])
    if not len(off):
        return {}
    return {
        "passages": len(off),
        "median speed error of a passage km/h": float(np.median(off)),
        "mean speed error of a passage km/h": float(off.mean()),
    }


def sets(data: Path | None, videos: list[Path]) -> Iterator[tuple[str, Callable[[], list[Sequence]]]]:
    """Names of sets, and what reads them."""
    if data is not None and (data / TABLE).is_file():
        for name, arguments in (
            ("KITTI, camera unknown, errors of 1 s", {}),
            ("KITTI, height known, errors of 1 s", {"height": True}),
            ("KITTI, height known, errors of a frame", {"height": True, "error_time": 0.0}),
        ):
            yield name, lambda given=arguments: list(KittiSequences(data / TABLE, **given))  # type: ignore[misc]
    if videos:
        pipeline = gp.Pipeline()
        for video in videos:
            yield from drive_sets(DriveVideo(video, pipeline))


def drive_sets(video: DriveVideo) -> Iterator[tuple[str, Callable[[], list[Sequence]]]]:
    """A camera that stands, on a mast that was calibrated too; or one that moves, with odometry, and without
    where its height is known."""
    name = f"drive {video.folder.name}"
    known = replace(video, frame=gp.FramePriors())
    if not video.moves:
        yield f"{name}, vehicles alone", lambda: [video.sequence()]
        yield f"{name}, vehicles height known", lambda: [known.sequence()]
        calibrated = replace(video, tilt="calibrated", frame=PRIORS)
        yield f"{name}, camera calibrated", lambda: [calibrated.sequence()]
        return
    alone = replace(video, tilt="calibrated")
    read = cache(replace(known, tilt="calibrated").sequence)
    yield f"{name}, vehicles alone, odometry", lambda: [alone.sequence()]
    yield f"{name}, vehicles height known, odometry", lambda: [read()]
    yield f"{name}, vehicles height known, motion unknown", lambda: [without_motion(read())]


def run(data: Path | None, videos: list[Path], say: Callable[[str], None]) -> dict[str, Any]:
    """All contenders on all sets, and times."""
    tables: dict[str, Any] = {}
    for name, read in sets(data, videos):
        say(name)
        sequences = read()
        tables[name] = {
            "sequences": len(sequences),
            "frames": sum(len(sequence.frames) for sequence in sequences),
            "rows": numbers_of(sequences),
        }
    return {
        "command": "groundpose evaluate tracks",
        "versions": report.versions(),
        "machine": report.machine(),
        "sets": tables,
        "time": timings(),
    }
