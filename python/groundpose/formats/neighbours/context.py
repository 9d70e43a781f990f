"""What writers share: settings, what was left out, pictures, time stamps, and names of classes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose.formats.scenes import Scene
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.words import vehicle_class

STEP = 0.1
"""Seconds between frames that have no time."""
BUS_LENGTH = 7.0
"""Metres; a vehicle of the class `van_bus` that is longer is a bus to formats that tell the two apart."""
_LATEST = 2**31
"""Seconds that ROS's time stamps hold."""
_PICTURES = {".jpg": "jpeg", ".jpeg": "jpeg", ".png": "png", ".webp": "webp"}


@dataclass(frozen=True)
class Context:
    """Settings of a conversion, and what it left out.

    Attributes:
        tables: folder of nuScenes' tables (`v1.0-mini`), for its results.
        frame_id: name of the camera's frame in ROS and Foxglove.
        pictures: whether recordings take the pictures along.
        left_out: counts what was left out, by why.
        failed: takes a frame that cannot be written and its error, and the others are written; None: the
            error is raised.
    """

    tables: Path | None = None
    frame_id: str = "camera"
    pictures: bool = True
    left_out: Counter[str] = field(default_factory=Counter)
    failed: Callable[[Scene, InputError], None] | None = None

    @contextmanager
    def frame(self, scene: Scene) -> Iterator[None]:
        """A block that makes what is written of a frame; its error is that of the frame alone."""
        try:
            yield
        except InputError as error:
            if self.failed is None:
                raise
            self.failed(scene, error)

    def picture(self, scene: Scene) -> tuple[bytes, str] | None:
        """The frame's picture as its file has it, and its format; None where there is none to take."""
        if not self.pictures or scene.image is None:
            return None
        form = _PICTURES.get(scene.image.suffix.lower())
        if form is None or not scene.image.is_file():
            self.left_out[f"picture, which is no {', '.join(_PICTURES)} file that is there"] += 1
            return None
        return scene.image.read_bytes(), form

    def stamp(self, scene: Scene, number: int) -> int:
        """Nanoseconds of frame `number` from 0: its time, else so many steps. Raises InputError for a time
        that recordings cannot hold."""
        if scene.time is not None and not 0.0 <= scene.time < _LATEST:
            raise input_error(f"frame {scene.id}: time", f"seconds from 0 to {_LATEST}", scene.time)
        if scene.time is None:
            self.left_out[f"time, which is not known: frames are {STEP:g} s apart"] += 1
        return round(1e9 * (number * STEP if scene.time is None else scene.time))

    def category(self, scene: Scene, row: int, names: Mapping[str, str]) -> str | None:
        """What a format calls the class of an object, `names` by our classes and "bus"; None: it has no
        such class."""
        meant = vehicle_class(scene.classes[row] or "none")
        key = "bus" if meant == "van_bus" and scene.size[row, 0] > BUS_LENGTH else meant
        if key not in names:
            self.left_out[f"class {scene.classes[row]!r}, which the format does not have"] += 1
        return names.get(key)


def score(scene: Scene, row: int) -> float:
    """How sure an object is, 0 to 1: its probability to be right, else its detector's score, else 1."""
    for value in (scene.probability[row], scene.scores[row]):
        if math.isfinite(value):
            return float(value)
    return 1.0


def class_numbers(names: tuple[str, ...]) -> dict[str, int]:
    """Numbers from 1: our classes first, then others as they come."""
    return {name: k for k, name in enumerate(dict.fromkeys((*CLASSES, *names)), 1)}
