"""Where the boxes come from: crops of the virtual drive, real streets, and places without a vehicle."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from groundpose.formats.kitti.labels import read_labels
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.image import as_rgb
from groundpose.lab.evaluate.honesty import truth
from groundpose.lab.evaluate.honesty.seen import Records, given
from groundpose.lab.evaluate.networks import nothing
from groundpose.lab.evaluate.networks.photographs import BOXES, FOLDER
from groundpose.lab.training.crops import NOTHING, Crops, write_crops
from groundpose.lab.training.nothing import KINDS, nothing_samples
from groundpose.lab.training.nothing_boxes import detector_box, inside
from groundpose.lab.training.streets import Street, looks, moved_boxes, streets
from groundpose.types import Camera, View
from groundpose.vehicles.classes import CLASSES

Boxes = Iterator[tuple[ByteArray, Records]]
BATCH = 64
DARKENED = 0.4
"""Brightness of darkened crops, as a fraction of the bytes'."""
SCENERY_FRAMES = 100
"""Frames of the test split whose scenery, six places each, is drawn."""
LOOKS = 6
"""Looks at each development frame and at its mirror image."""
MIRRORED = "car, mirrored"
"""Kind of the cars in mirror images of development frames."""
PHOTOGRAPH_FOV_DEG = 60.0
"""Of photographs whose camera is not known."""
_FLAT_IMAGE = (1280, 720)


@dataclass(frozen=True)
class Look:
    """How crops are looked at: with their boxes or moved ones (`streets.moved_boxes`), at a brightness."""

    moved: bool = False
    brightness: float = 1.0


PLAIN, MOVED, DARK = Look(), Look(moved=True), Look(brightness=DARKENED)


@dataclass(frozen=True)
class OfCrops:
    """The crops of a split of a folder, seen with the true tilt of the camera."""

    folder: Path
    split: str
    look: Look = PLAIN

    def __call__(self, codec: Codec) -> Boxes:
        """See `seen.Source`."""
        crops = Crops(self.folder, self.split)
        records = _records(crops, truth.poses(self.folder, self.split, crops))
        if self.look.moved:
            records["box"] = moved_boxes(records["box"], np.random.default_rng(0))
        crops = crops.of(np.arange(len(crops)), records["box"])
        from groundpose.lab.training.batches import Batcher  # with PyTorch, which pages do without

        batcher, rng = Batcher(codec, crops.codec), np.random.default_rng(0)
        for start in range(0, len(crops), BATCH):
            rows = np.arange(start, min(start + BATCH, len(crops)))
            pictures = batcher(*crops.take(rows), rng).pictures()
            yield (self.look.brightness * pictures).astype(np.uint8), records[rows]


def _records(crops: Crops, poses: Records) -> Records:
    """What is known of crops with these poses."""
    labels = crops.labels
    made = given(len(labels), "", View(Camera(1.0, 1.0, 0.0, 0.0, image_size=(1, 1))), labels["box"])
    made["class"], made["R"], made["t"] = labels["kind"], poses["R"], poses["t"]
    made["hidden"], made["cut"] = labels["occluded"], labels["truncation"]
    names = np.array([*CLASSES, *(kind.name for kind in KINDS)])
    made["kind"] = names[
        np.where(labels["kind"] == NOTHING, len(CLASSES) - 1 - labels["object"], labels["kind"])
    ]
    size, (_, pitch, roll, focal) = labels["image_size"].astype(float), labels["camera"].T.astype(float)
    made["view"] = np.column_stack([focal, focal, 0.5 * (size - 1.0), size, pitch, roll])
    return made


def scenery(folder: Path, codec: Codec) -> Boxes:
    """Places without a vehicle in frames of the test split, drawn into `folder` if they are not there."""
    write_crops(folder, nothing_samples, "test", SCENERY_FRAMES, frames_per_shard=SCENERY_FRAMES)
    return OfCrops(folder, "test")(codec)


def development(frames: Path, many: bool, codec: Codec) -> Boxes:
    """The labelled cars of KITTI's development frames, once or `LOOKS` times in the frame and its mirror
    image. The nominal tilt is zero."""
    for street in streets(frames):
        for i, look in enumerate(looks(street, LOOKS) if many else [street]):
            yield codec.crops(look.image, look.bboxes), _cars(look, MIRRORED if i >= LOOKS else "car")


def _cars(street: Street, kind: str) -> Records:
    made = given(len(street.bboxes), kind, street.view, street.bboxes)
    made["class"] = [CLASSES.index(name) for name in street.classes]
    made["R"], made["t"] = street.R, street.t
    return made


def away_from_labels(frames: Path, codec: Codec) -> Boxes:
    """Boxes of the development frames that meet no label."""
    by_name = {street.name: street for street in streets(frames)}
    for path in sorted((frames / "label_2").glob("*.txt")):
        street = by_name[path.stem]
        for kind, boxes in nothing.places(street.image, read_labels(path), int(path.stem), codec):
            yield codec.crops(street.image, boxes), given(len(boxes), kind, street.view, boxes)


def photographs(folder: Path, codec: Codec) -> Boxes:
    """Places without a vehicle in photographs of roads (`networks.photographs`); never used for a fit."""
    for name, kinds in BOXES.items():
        if (folder / FOLDER / name).exists():
            image = as_rgb(folder / FOLDER / name)
            view = _level((image.shape[1], image.shape[0]))
            for kind, boxes in kinds.items():
                chosen = np.array(boxes, dtype=float)
                yield codec.crops(image, chosen), given(len(boxes), kind, view, chosen)


def flat(codec: Codec) -> Boxes:
    """Grey and noise, as if a detector had found boxes of its usual shapes in them."""
    rng, size = np.random.default_rng(91), np.array(_FLAT_IMAGE, dtype=float)
    for kind, crops in nothing.flat(codec):
        found: list[np.ndarray] = []
        while len(found) < len(crops):
            box = inside(detector_box(rng, rng.random(2) * size), size)
            found += [] if box is None else [box]
        yield crops, given(len(crops), kind, _level(_FLAT_IMAGE), np.array(found))


def _level(size: tuple[int, int]) -> View:
    return View(Camera.from_fov(*size, np.radians(PHOTOGRAPH_FOV_DEG)))


def for_fit(crops: Path) -> dict[str, Callable[[Codec], Boxes]]:
    """Sources of a fit: the validation split, vehicles and places without one, each looked at twice."""
    return {
        "validation": OfCrops(crops, "validation"),
        "validation, boxes moved": OfCrops(crops, "validation", MOVED),
    }


RENDERS = ("held-out renders", "boxes moved by 3 %", "darkened")
ALL_RENDERS = "held-out renders, three looks"
"""The three together."""
STREETS, MANY_LOOKS = "development frames", "development frames, 12 looks"
BACKGROUND = ("scenery of renders", "photographs of roads", "streets away from labels", "grey and noise")


def for_test(crops: Path, data: Path) -> dict[str, Callable[[Codec], Boxes]]:
    """Sources of a test, those of real images only where the data folder has them."""
    found: dict[str, Callable[[Codec], Boxes]] = {
        name: OfCrops(crops, "test", look) for name, look in zip(RENDERS, (PLAIN, MOVED, DARK), strict=True)
    }
    found[BACKGROUND[0]] = partial(scenery, truth.folder_of(crops) / "scenery")
    frames = data / "kitti" / "training"
    if frames.is_dir():
        found[STREETS] = partial(development, frames, False)
        found[MANY_LOOKS] = partial(development, frames, True)
        found[BACKGROUND[2]] = partial(away_from_labels, frames)
    if (data / FOLDER).is_dir():
        found[BACKGROUND[1]] = partial(photographs, data)
    found[BACKGROUND[3]] = flat
    return found
