"""Writes a drive to a folder, in several processes, and resumes an interrupted run.

`labels.jsonl` records what is done: a frame belongs to the folder when its line is in that file. Pictures and
label files are renamed into place when they are complete, in the order of the frames.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from groundpose._checks import input_error, integer
from groundpose._writing import LOCK, only_writer
from groundpose.lab.drive.coco import write_lines
from groundpose.lab.drive.record import (
    ODOMETRY_COLUMNS,
    TILT_COLUMNS,
    odometry_row,
    tilt_row,
    tracking_lines,
)
from groundpose.lab.drive.rigs import DEFAULT_RIG
from groundpose.lab.drive.video.film import write_film
from groundpose.lab.drive.workers import (
    SUFFIX,
    Frame,
    Settings,
    image_folder,
    image_name,
    make_frames,
    temporary,
)

SETTINGS, LINES, TILT, COCO = "drive.json", "labels.jsonl", "tilt.csv", "keypoints_coco.json"
ODOMETRY, TRACKS, FILM = "odometry.csv", "training/label_02/0000.txt", "video.mp4"
"""Of a video."""

Advance = Callable[[int, int, int], None]
"""Frames done, frames in all, objects labelled in this run."""


def write_drive(
    out: Path,
    frames: int,
    settings: Settings,
    jobs: int = 1,
    advance: Advance = lambda done, total, objects: None,
) -> int:
    """Write frames `settings.first` to `settings.first + frames` to folder `out`. Existing frames stay.

    Returns the number of objects labelled in this run.

    Raises:
        InputError: an invalid number, a folder with other settings or foreign content, another run in it.
        OSError: disk full, no such folder, no permission; complete frames stay.
    """
    if integer("frames", frames) < 1:
        raise input_error("frames", "1 or more", frames)
    if integer("jobs", jobs) < 1:
        raise input_error("jobs", "1 or more", jobs)
    out.mkdir(parents=True, exist_ok=True)
    with only_writer(out):
        _open_folder(out, settings)
        done, objects = _whole_frames(out, settings), 0
        advance(done, frames, objects)
        numbers = range(settings.first + done, settings.first + frames)
        with closing(_add_frames(out, numbers, settings, jobs)) as added:
            for count in added:
                done, objects = done + 1, objects + count
                advance(done, frames, objects)
        if not all((out / name).exists() for name in _covering(settings)):
            _summaries(out, settings)
    return objects


def _add_frames(out: Path, numbers: range, settings: Settings, jobs: int) -> Generator[int, None, None]:
    """Make these frames and record them; yields the number of objects of each."""
    if not numbers:
        return
    for name in _covering(settings):  # they describe fewer frames
        (out / name).unlink(missing_ok=True)
    try:
        with _appending(out / LINES) as append, closing(make_frames(out, numbers, settings, jobs)) as made:
            for frame in made:
                _keep(out, frame, settings, append)
                yield frame.objects
    finally:
        for part in (out / "training").glob("**/.*.part"):  # incomplete, or complete but not yet recorded
            part.unlink(missing_ok=True)


def _open_folder(out: Path, settings: Settings) -> None:
    """Make the folder, or check that it has the same settings."""
    path = out / SETTINGS
    if path.exists():
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            raise input_error(str(path), "settings of a simulated drive", "another file") from None
        # a folder without a rig is older than rigs
        found = {"rig": DEFAULT_RIG, **(found if isinstance(found, dict) else {})}
        for key, wanted in json.loads(json.dumps(asdict(settings))).items():
            if found.get(key) != wanted:
                expected = f"{key} {repr(found.get(key))[:100]}, with which the folder was begun"
                raise input_error(str(out), expected, f"{wanted!r}; give another folder")
        return
    if any(path.name != LOCK for path in out.iterdir()):
        raise input_error(str(out), "a new or empty folder, or one that simulate began", "other files in it")
    _replace(path, [json.dumps(asdict(settings), indent=1) + "\n"])


def _whole_frames(out: Path, settings: Settings) -> int:
    """Number of recorded frames; an incomplete last line is removed."""
    path = out / LINES
    for folder in ("label_2", "calib", *((image_folder(settings),) if settings.images else ())):
        (out / "training" / folder).mkdir(parents=True, exist_ok=True)
    if not path.exists():
        return 0
    done = size = 0
    with path.open("r+b") as file:
        for line in file:
            if not line.endswith(b"\n"):
                break
            done, size = done + 1, size + len(line)
        file.truncate(size)
    return done


@contextmanager
def _appending(path: Path) -> Iterator[Callable[[str], None]]:
    """A writer of complete lines: a line that does not fit on the disk is removed."""
    with path.open("ab") as file:

        def append(line: str) -> None:
            size = file.tell()
            try:
                file.write(line.encode())
                file.flush()
            except BaseException as error:
                _cut(path, size)
                if isinstance(error, OSError):
                    error.filename = error.filename or str(path)
                raise

        yield append


def _cut(path: Path, size: int) -> None:
    with path.open("r+b") as file:
        file.truncate(size)


def _keep(out: Path, frame: Frame, settings: Settings, append: Callable[[str], None]) -> None:
    """Rename a frame's files into place and record the frame."""
    stem = f"{frame.number:06d}"
    _replace(out / "training" / "label_2" / f"{stem}.txt", [frame.kitti])
    _replace(out / "training" / "calib" / f"{stem}.txt", [frame.calibration])
    if settings.images:
        picture = out / image_name(frame.number, settings)
        os.replace(temporary(picture), picture)
    append(frame.line)


def _replace(path: Path, pieces: Iterable[str]) -> None:
    """Write a file under the temporary name that pictures have too, and rename it."""
    part = temporary(path)
    try:
        with part.open("w", encoding="utf-8") as file:
            file.writelines(pieces)
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        error.filename = error.filename or str(path)
        raise


def read_lines(path: Path) -> Iterator[dict[str, Any]]:
    """The frames in labels.jsonl."""
    with path.open(encoding="utf-8") as file:
        for line in file:
            yield json.loads(line)


def _covering(settings: Settings) -> tuple[str, ...]:
    """The files that cover all frames."""
    if settings.fps is None:
        return TILT, COCO
    return TILT, COCO, ODOMETRY, TRACKS, *((FILM,) if settings.images == "mp4" else ())


def _summaries(out: Path, settings: Settings) -> None:
    """Write the files that cover all frames."""
    header = ",".join(TILT_COLUMNS) + "\n"
    _replace(out / TILT, (header, *map(tilt_row, read_lines(out / LINES))))
    suffix = SUFFIX[settings.images or "png"]
    _replace(out / COCO, write_lines(read_lines(out / LINES), f".{suffix}"))
    if settings.fps is None:
        return
    header = ",".join(ODOMETRY_COLUMNS) + "\n"
    _replace(out / ODOMETRY, (header, *map(odometry_row, read_lines(out / LINES))))
    (out / TRACKS).parent.mkdir(parents=True, exist_ok=True)
    _replace(
        out / TRACKS, (tracking_lines(frame, _kitti(out, frame["id"])) for frame in read_lines(out / LINES))
    )
    calibration = (out / "training" / "calib" / "000000.txt").read_text(encoding="utf-8")
    _replace(out / "training" / "calib" / "0000.txt", [calibration])
    if settings.images == "mp4":
        pictures = [out / frame["image"] for frame in read_lines(out / LINES)]
        part = temporary(out / FILM)
        write_film(part, pictures, settings.fps)
        os.replace(part, out / FILM)


def _kitti(out: Path, number: int) -> str:
    return (out / "training" / "label_2" / f"{number:06d}.txt").read_text(encoding="utf-8")
