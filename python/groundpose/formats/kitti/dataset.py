"""KITTI's object and tracking sets as they unpack, frame by frame.

Object set: `training/{label_2,calib,image_2}/NNNNNN.{txt,txt,png}`. Tracking:
`training/{label_02,calib}/SSSS.txt` and `training/image_02/SSSS/FFFFFF.png`; its frames are called
`SSSS/FFFFFF`. Detections: a folder of result files of the same names. Only what has labels and a
calibration is needed; images are looked for.

KITTI's labels are in the frame of camera 0, images and P2 are of camera 2 beside it: `camera_from_labels`
is the step between the two.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np

from groundpose._checks import FloatArray, input_error, read_text
from groundpose._core import InputError
from groundpose.calibration import read_kitti_projection
from groundpose.formats.kitti.labels import DONT_CARE, KittiLabel, TrackedLabel, read_labels, read_tracking
from groundpose.formats.skips import Skips
from groundpose.types import Camera

IMAGE_SIZE = (1242, 375)
"""Assumed when there is no image to ask; a few of KITTI's cameras have some pixels less or more."""
LEAST_HEIGHT_PX = (40.0, 25.0, 25.0)
MOST_OCCLUSION = (0, 1, 2)
MOST_TRUNCATION = (0.15, 0.30, 0.50)
DIFFICULTIES = ("easy", "moderate", "hard")
"""KITTI's levels; each holds those before it."""
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
_FARTHEST_CENTRE = 0.25
"""Largest distance of the principal point from the middle of the image, as a fraction of its size; beyond it
the calibration belongs to another camera."""


@dataclass(frozen=True)
class KittiFrame:
    """One image with what is labelled and detected in it."""

    id: str
    projection: FloatArray
    """(3, 4), P2"""
    image_size: tuple[int, int]
    image: Path | None
    labels: list[KittiLabel]
    detections: list[KittiLabel] | None
    """None when no detections were asked for."""

    @property
    def camera(self) -> Camera:
        """Of the image."""
        return _camera(self.projection.tobytes(), self.image_size)

    @cached_property
    def camera_from_labels(self) -> FloatArray:
        """(3,) metres: position in this camera's frame = that in the labels + this."""
        return np.asarray(np.linalg.solve(self.projection[:, :3], self.projection[:, 3]))


@lru_cache(maxsize=64)
def _camera(projection: bytes, image_size: tuple[int, int]) -> Camera:
    return Camera.from_K(np.frombuffer(projection).reshape(3, 4)[:, :3], image_size=image_size)


def difficulty(label: KittiLabel) -> int:
    """KITTI's level of a label: index into `DIFFICULTIES`, 3 for those that do not count at all."""
    height = label.bbox[3] - label.bbox[1]
    for level, least in enumerate(LEAST_HEIGHT_PX):
        if (
            height > least
            and label.occluded <= MOST_OCCLUSION[level]
            and label.truncated <= MOST_TRUNCATION[level]
        ):
            return level
    return len(DIFFICULTIES)


class KittiFrames(Protocol):
    """Anything that gives frames by name."""

    @property
    def root(self) -> Path:
        """Where they are."""
        ...

    def ids(self, split: Path | None = None, skipped: Skips | None = None) -> list[str]:
        """Names of the frames, or of those of an ImageSets file."""
        ...

    def read(self, frame_id: str, skipped: Skips) -> KittiFrame | None:
        """One frame; None when it cannot be used."""
        ...


@dataclass(frozen=True)
class KittiSet:
    """A folder; iterating over `ids()` and calling `read` goes through it in bounded memory."""

    root: Path
    detections: Path | None = None
    """Folder of result files to read beside the labels."""
    part: str = "training"

    def __post_init__(self) -> None:
        """Raises InputError for a folder that holds neither set."""
        if not (self._folder("label_2").is_dir() or self.tracking):
            expected = f"{self.part}/label_2 (object set) or {self.part}/label_02 (tracking)"
            raise input_error(str(self.root), f"a folder with {expected}", "none")
        if self.detections is not None and not self.detections.is_dir():
            raise input_error(str(self.detections), "a folder of detections", "none")

    @property
    def tracking(self) -> bool:
        """Whether it is the tracking set."""
        return self._folder("label_02").is_dir() and not self._folder("label_2").is_dir()

    def _folder(self, name: str) -> Path:
        return self.root / self.part / name

    def ids(self, split: Path | None = None, skipped: Skips | None = None) -> list[str]:
        """Names of the frames: those of an ImageSets file (one a line, sequences for tracking), or all."""
        folder = self._folder("label_02" if self.tracking else "label_2")
        found = sorted(path.stem for path in folder.glob("*.txt"))
        if split is not None:
            found = read_split(split, Skips() if skipped is None else skipped)
        if not self.tracking:
            return found
        return [f"{name}/{frame:06d}" for name in found for frame in self._frames(name)]

    def read(self, frame_id: str, skipped: Skips) -> KittiFrame | None:
        """One frame; None when it cannot be used. What is left out, lines or the frame, goes to `skipped`."""
        sequence, _, number = frame_id.partition("/")
        try:
            projection = _projection(str(self._folder("calib") / f"{sequence}.txt"))
            labels = self._labels(sequence, number, skipped)
            detections = self._detections(frame_id, skipped)
        except OSError as error:
            skipped.add(_no_file(error), f"frame {frame_id}: {error.filename}")
            return None
        except (InputError, UnicodeDecodeError) as error:
            skipped.add("frame with a bad calibration", f"frame {frame_id}: {error}")
            return None
        image = self._image(frame_id)
        size = IMAGE_SIZE
        if image is not None:
            read = _image_size(image)
            if read is None:
                skipped.add("image that cannot be read", f"frame {frame_id}: {image}")
                image = None
            elif not _fits(projection, read):
                skipped.add(
                    "frame with an image that is not its camera's", f"frame {frame_id}: {image}: {read}"
                )
                return None
            else:
                size = read
        try:
            _camera(projection.tobytes(), size)
        except InputError as error:
            skipped.add("frame with a bad calibration", f"frame {frame_id}: {error}")
            return None
        usable = [label for label in labels if _usable(label, size, f"frame {frame_id}", skipped)]
        if detections is not None:
            detections = [d for d in detections if _usable(d, size, f"detections of {frame_id}", skipped)]
        return KittiFrame(frame_id, projection, size, image, _once(usable, frame_id, skipped), detections)

    def frames(self, split: Path | None, skipped: Skips) -> Iterator[KittiFrame]:
        """All that can be used."""
        for frame_id in self.ids(split, skipped):
            frame = self.read(frame_id, skipped)
            if frame is not None:
                yield frame

    def _labels(self, sequence: str, number: str, skipped: Skips) -> list[KittiLabel]:
        if not number:
            return read_labels(self._folder("label_2") / f"{sequence}.txt", skipped)
        path = str(self._folder("label_02") / f"{sequence}.txt")
        rows, left_out = _tracking(path)
        if int(number) == min(rows, default=0):  # once for the file
            skipped.merge(left_out)
        return [row.label for row in rows.get(int(number), [])]

    def _frames(self, sequence: str) -> list[int]:
        """Those with an image, or else those with a label."""
        folder = self._folder("image_02") / sequence
        if folder.is_dir():
            return sorted(int(p.stem) for p in folder.iterdir() if p.suffix in IMAGE_SUFFIXES)
        try:
            return sorted(_tracking(str(self._folder("label_02") / f"{sequence}.txt"))[0])
        except OSError:
            return [0]  # `read` says what is missing

    def _detections(self, frame_id: str, skipped: Skips) -> list[KittiLabel] | None:
        if self.detections is None:
            return None
        found = read_labels(self.detections / f"{frame_id}.txt", skipped)
        return [row for row in found if row.type != DONT_CARE]

    def _image(self, frame_id: str) -> Path | None:
        folder = self._folder("image_02" if self.tracking else "image_2")
        paths = (folder / f"{frame_id}{suffix}" for suffix in IMAGE_SUFFIXES)
        return next((path for path in paths if path.exists()), None)


def read_split(path: Path, skipped: Skips) -> list[str]:
    """Names of an ImageSets file. Raises OSError, InputError when there is none in it."""
    names: dict[str, None] = {}
    for number, line in enumerate(read_text(path).splitlines(), 1):
        name = line.strip()
        if not name:
            continue
        if name in names:
            skipped.add("duplicate id in the split", f"{path}:{number}: {name!r}")
        elif "/" in name or "\\" in name or name.startswith("."):
            skipped.add("id that is no name", f"{path}:{number}: {name!r}")
        else:
            names[name] = None
    if not names:
        raise input_error(str(path), "ids of frames, one a line", "none")
    return list(names)


@lru_cache(maxsize=256)
def _projection(path: str) -> FloatArray:
    return read_kitti_projection(path, "P2")


@lru_cache(maxsize=2)
def _tracking(path: str) -> tuple[dict[int, list[TrackedLabel]], Skips]:
    left_out = Skips()
    return read_tracking(path, left_out), left_out


def _no_file(error: OSError) -> str:
    folder = Path(str(error.filename)).parent.name
    return f"frame without a readable file in {folder}"


def _image_size(path: Path) -> tuple[int, int] | None:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            width, height = image.size
            return width, height
    except (OSError, UnidentifiedImageError):
        return None


def _fits(projection: FloatArray, size: tuple[int, int]) -> bool:
    away = np.abs(projection[:2, 2] / size - 0.5)
    return bool((away < _FARTHEST_CENTRE).all())


def _usable(label: KittiLabel, size: tuple[int, int], place: str, skipped: Skips) -> bool:
    left, top, right, bottom = label.bbox
    if label.type == DONT_CARE:
        return right > left and bottom > top
    reason = ""
    if not (right > left and bottom > top):
        reason = "box without area"
    elif left >= size[0] or top >= size[1] or right <= 0.0 or bottom <= 0.0:
        reason = "box outside the image"
    elif label.score is None and not label.has_pose:
        reason = "label without size or place"
    elif label.score is None and label.location[2] <= 0.0:
        reason = "label behind the camera"
    if reason:
        box = ", ".join(f"{value:g}" for value in label.bbox)
        skipped.add(reason, f"{place}: {label.type} [{box}]")
    return not reason


def _once(labels: list[KittiLabel], frame_id: str, skipped: Skips) -> list[KittiLabel]:
    once = list(dict.fromkeys(labels))
    for _ in range(len(labels) - len(once)):
        skipped.add("duplicate label", f"frame {frame_id}")
    return once
