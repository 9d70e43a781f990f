"""The poses that an interrupted `groundpose track` has found: the costly part, which the same command does
not find again."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from groundpose.cli.journal import Journal, Settings
from groundpose.cli.output import say
from groundpose.tracking import SeenVehicles
from groundpose.types import View


class KeptPoses:
    """Vehicles of images by the number of the image, beside the file of the tracks until that is whole.

    Args:
        out: file of the tracks.
        settings: what decides the poses, see `Journal`.
        view: camera of all images.

    Attributes:
        whole: whether the tracks are, so that nothing is to be kept.

    Raises:
        OSError: naming the file.
    """

    whole = False

    def __init__(self, out: Path, settings: Settings, view: View) -> None:
        """Go on with what is there, or begin."""
        target = out.with_name(f"{out.name}.poses")
        self.journal = Journal(target, settings, convert=lambda part, target: None)
        self._view = view
        self._text = self.journal.part.open("rb")
        self._places: dict[int, int] = {}
        begin = 0
        for line in self._text:
            self._places[int(line[: line.index(b" ")])] = begin
            begin += len(line)

    @property
    def numbers(self) -> Collection[int]:
        """Of the images whose vehicles an interrupted run has found."""
        return self._places.keys()

    def get(self, number: int) -> SeenVehicles:
        """The vehicles of one of these images."""
        self._text.seek(self._places[number])
        return _read(json.loads(self._text.readline().partition(b" ")[2]), self._view)

    def add(self, number: int, seen: SeenVehicles) -> None:
        """Keep those of one more image."""
        self.journal.add(f"{number} {json.dumps(_written(seen))}\n")
        self.journal.finished(number, len(seen), 0)

    def close(self) -> None:
        """Leave what there is to the next run."""
        self._text.close()
        if self.whole or not self.journal.items:
            self.journal.forget()
        else:
            self.journal.close()


@contextmanager
def kept_poses(out: Path | None, settings: Settings | None, view: View) -> Iterator[KeptPoses | None]:
    """Those beside the file of the tracks; None where they go to a pipe, or nobody can tell whether the input
    is the same again. What is kept stays when the block ends with an error."""
    if out is None or settings is None:
        yield None
        return
    kept = KeptPoses(out, settings, view)
    if kept.journal.dropped:
        say(f"{out}: begun anew: what is unfinished there is of another command or of other inputs")
    elif kept.journal.done:
        say(f"{out}: going on: the poses of {len(kept.journal.done)} images are there")
    try:
        yield kept
    except BaseException:
        kept.whole = False
        raise
    finally:
        kept.close()


_ARRAYS = [f.name for f in fields(SeenVehicles) if f.name not in ("view", "names", "error_dof")]


def _written(seen: SeenVehicles) -> dict[str, Any]:
    """All numbers as they are: a float as Python prints it is read as the same bits."""
    view = seen.view
    arrays = {name: getattr(seen, name) for name in _ARRAYS}
    return {
        "view": [view.pitch, view.roll, view.height, view.camera.image_size],
        "names": list(seen.names),
        "error_dof": seen.error_dof,
        **{name: [array.shape, array.ravel().tolist()] for name, array in arrays.items()},
    }


def _read(found: dict[str, Any], view: View) -> SeenVehicles:
    pitch, roll, height, size = found["view"]
    camera = replace(view.camera, image_size=None if size is None else tuple(size))
    arrays = {name: np.array(found[name][1], dtype=float).reshape(found[name][0]) for name in _ARRAYS}
    return SeenVehicles(
        view=View(camera, pitch, roll, height),
        names=tuple(found["names"]),
        error_dof=found["error_dof"],
        **arrays,
    )
