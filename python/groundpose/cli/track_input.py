"""What `groundpose track` follows: lines of poses, or images with their boxes."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import blamed, input_error
from groundpose._core import InputError
from groundpose.cli.images import ImageWork
from groundpose.cli.kept_poses import KeptPoses
from groundpose.cli.output import refuse
from groundpose.formats.pose_lines import PoseLines
from groundpose.tracking import SeenVehicles
from groundpose.types import View

Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Followed:
    """A frame: file and line or picture, its id, its time in seconds or None, its vehicles, its picture and
    the file of that, if it has one of its own."""

    place: str
    id: str | int
    time: float | None
    seen: SeenVehicles
    image: Image | None = None
    path: Path | None = None

    def pixels(self) -> Image | None:
        """Its picture (H, W, 3), read if it is not at hand. Raises InputError."""
        if self.image is not None or self.path is None:
            return self.image
        from groundpose.keypoints.image import as_rgb  # with Pillow

        with blamed(self.place):
            return as_rgb(self.path)


def of_lines(lines: PoseLines, folder: Path) -> Iterator[Followed | InputError]:
    """Frames of poses that were written; pictures lie below `folder`."""
    for frame in lines:
        if isinstance(frame, InputError):
            yield frame
        else:
            picture = folder / frame.image if frame.image else None
            yield Followed(frame.place, frame.id, frame.time, frame.seen, path=picture)


def of_images(work: ImageWork, kept: KeptPoses | None) -> Iterator[Followed | InputError]:
    """Frames whose poses are found now, but those that are kept of an interrupted run."""
    if kept is not None:
        work.finished = kept.numbers
    for number, (shot, result) in enumerate(work.with_shots()):
        if isinstance(shot, InputError):
            yield shot
            continue
        if isinstance(result, InputError):
            yield result
            continue
        image, path = shot.image, shot.path if shot.image is None else None
        if result is None:  # an interrupted run has found it
            assert kept is not None
            seen = kept.get(number)
        else:
            seen, image = SeenVehicles.of(result.poses), result.image
            if kept is not None:
                kept.add(number, seen)
        yield Followed(f"{work.name}: {shot.label}", shot.label, shot.time, seen, image, path)


@contextmanager
def pose_lines(source: Path, view: View) -> Iterator[PoseLines]:
    """Lines of a file, or of standard input as they come."""
    if str(source) == "-":
        if sys.stdin is None:
            refuse("standard input is closed; give a file")
        yield PoseLines(_text(sys.stdin.buffer), "standard input", view)
        return
    with source.open("rb") as stream:
        yield PoseLines(_text(stream), str(source), view)


def _text(stream: IO[bytes]) -> Iterator[str]:
    """Each line as soon as it is there."""
    for line in iter(stream.readline, b""):
        yield line.decode("utf-8-sig", "replace")


class Odometry:
    """Places of a camera by the number of the frame: a CSV with x, z and heading, as `simulate --video`
    writes."""

    def __init__(self, path: Path) -> None:
        """Read it. Raises OSError, InputError naming file and line."""
        self._places: dict[int, tuple[float, float, float]] = {}
        self._last: tuple[float, float, float] | None = None
        self.path = path
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream)
            wanted = {"x", "z", "heading"}
            if not wanted <= set(reader.fieldnames or ()):
                raise input_error(
                    str(path), "a CSV with the columns x, z, heading", ", ".join(reader.fieldnames or ())
                )
            for number, row in enumerate(reader):
                self._places[number] = _place(row, f"{path}:{number + 2}")

    def moved(self, number: int) -> tuple[float, float, float] | None:
        """How the camera moved since the frame asked for before; None: this is the first. Raises
        InputError."""
        if number not in self._places:
            raise input_error(str(self.path), f"a row for frame {number}", f"{len(self._places)} rows")
        now, before = self._places[number], self._last
        self._last = now
        if before is None:
            return None
        dx, dz, s, c = now[0] - before[0], now[1] - before[1], math.sin(before[2]), math.cos(before[2])
        return dx * c - dz * s, dx * s + dz * c, math.remainder(now[2] - before[2], 2.0 * math.pi)


def _place(row: Mapping[str, str], place: str) -> tuple[float, float, float]:
    try:
        x, z, heading = (float(row[name]) for name in ("x", "z", "heading"))
    except (TypeError, ValueError):
        raise input_error(place, "numbers x, z, heading", str(dict(row))) from None
    if not all(map(math.isfinite, (x, z, heading))):
        raise input_error(place, "finite numbers x, z, heading", str(dict(row)))
    return x, z, heading
