"""Where the 2D boxes of images come from: files, or a detector that looks at each."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from groundpose._checks import input_error
from groundpose.cli.inputs import Shot, companion, frame_companion
from groundpose.detector.detector import Detector
from groundpose.formats.boxes import ANY, Boxes, BoxFile, read_boxes
from groundpose.formats.skips import Skips
from groundpose.keypoints.codec import ByteArray
from groundpose.keypoints.pipeline import Pipeline
from groundpose.plausibility import other_reading


class BoxSource(Protocol):
    """Boxes of one image after the other."""

    @property
    def skipped(self) -> Skips:
        """Entries that are no boxes."""

    @property
    def may_have_cameras(self) -> bool:
        """Whether boxes can come with their camera."""

    def of(self, shot: Shot, pixels: ByteArray) -> Boxes:
        """In pixels of the image (H, W, 3). Raises OSError, InputError."""

    def remarks(self) -> list[str]:
        """What to say at the end."""


class BoxesOfFiles:
    """A file with the boxes of the image or of all images, or a folder with a file for each image."""

    def __init__(self, place: Path, source: Path, several: bool) -> None:
        """Read what is for all images of `source`. Raises OSError, InputError."""
        self.skipped = Skips()
        self._place, self._source = place, source
        self._file = None if place.is_dir() else read_boxes(place)
        if self._file is None:
            return
        self.skipped.merge(self._file.skipped)
        if several and ANY in self._file.images:
            raise input_error(str(place), "boxes that name their images", "those of one image")

    @property
    def may_have_cameras(self) -> bool:
        """Only those of a folder are not known yet."""
        return self._file is None or any(boxes.view for boxes in self._file.images.values())

    def of(self, shot: Shot, pixels: ByteArray) -> Boxes:
        """Raises InputError also where most of them must mean something else."""
        size = (pixels.shape[1], pixels.shape[0])
        file = self._file or self._file_of(shot)
        if file is None:
            return Boxes(())
        of_video = shot.number is not None and file is self._file
        found = file.frame(shot.number or 0) if of_video else file.of(shot.name)
        found = found.in_pixels(*size, file.place)
        bboxes = np.array([box.bbox for box in found.boxes], dtype=float).reshape(-1, 4)
        meant = other_reading(bboxes, size)
        if meant:
            expected = f"left, top, right, bottom pixels of {size[0]} x {size[1]}"
            raise input_error(file.place, expected, f"boxes that look like {meant}")
        return found

    def _file_of(self, shot: Shot) -> BoxFile | None:
        """The file of an image in the folder of boxes; None: a frame that has none."""
        if shot.number is None:
            path: Path | None = companion(self._place, shot.name)
        else:
            path = frame_companion(self._place, str(self._source), shot.number)
        if path is None:
            return None
        file = read_boxes(path)
        self.skipped.merge(file.skipped)
        if len(file.images) == 1:  # the file's name has said whose boxes it holds
            return replace(file, images={ANY: next(iter(file.images.values()))})
        return file

    def remarks(self) -> list[str]:
        """Nothing of the files themselves."""
        return []


class BoxesOfDetector:
    """What a detector finds, as far as the pipeline takes it for vehicles."""

    may_have_cameras = False

    def __init__(self, detector: Detector, pipeline: Pipeline) -> None:
        """Nothing is looked at yet."""
        self.skipped = Skips()
        self._detector, self._pipeline = detector, pipeline
        self._vehicles = 0
        self._others: Counter[str] = Counter()

    def of(self, shot: Shot, pixels: ByteArray) -> Boxes:
        """What else the detector finds in the picture is passed over."""
        found = self._detector(pixels)
        boxes = tuple(box for box in found.boxes if box.means_vehicle(self._pipeline.classes))
        self._vehicles += len(boxes)
        self._others.update(box.name for box in found.boxes if box not in boxes)
        return replace(found, boxes=boxes)

    def remarks(self) -> list[str]:
        """What the detector is, and that it knows no vehicles."""
        said = [f"detector: {self._detector}"]
        if self._others and not self._vehicles:
            names = ", ".join(f"{count} {name}" for name, count in self._others.most_common(5))
            hint = "--classes NAME=CLASS says which names are vehicles"
            said.append(f"detector: found no vehicle but {names}; {hint}")
        return said
