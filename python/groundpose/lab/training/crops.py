"""Training crops on disk: numbered shards of two memory-mapped arrays each, and one index.

A stored crop shows more than a network sees, so that the box can be moved, rotated and mirrored anew each
time the crop is used. `FOLDER/index.json` says how the crops were made; `SPLIT-00007-images.npy` holds
(N, 3, height, width) bytes and `SPLIT-00007-labels.npy` N records of `LABEL`. The labels are written last and
every file is renamed into place when it is complete. A shard with labels is therefore done, and a writer that
was stopped continues with the missing shards.
"""

from __future__ import annotations

import copy
import itertools
import json
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose._checks import FloatArray, input_error
from groundpose._writing import only_writer, whole_file, write_text
from groundpose.keypoints.codec import MARGIN, ByteArray, Codec
from groundpose.lab.processes import worker_pool
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS, keypoint_indices

VERSION = 2
STORED = Codec(160, 120, margin=0.5 * (1.25 * (1.0 + 2.0 * MARGIN) - 1.0))
"""Codec of stored crops: 1.25 times the window of a network's crop, at the pixel size of 128 x 96."""

LABEL = np.dtype(
    [
        ("keypoints", "<f4", (len(KEYPOINTS), 2)),  # image pixels, NaN = not a keypoint of this class
        ("state", "u1", (len(KEYPOINTS),)),  # OUTSIDE, HIDDEN or VISIBLE of `groundpose.lab.drive`
        ("kind", "u1"),  # index into CLASSES, or NOTHING
        ("box", "<f4", (4,)),  # left, top, right, bottom, image pixels, cut as a detector's
        ("window", "<f8", (4,)),  # part of the image in the stored crop, image pixels
        ("image_size", "<i4", (2,)),  # width, height; a crop has no picture outside the image
        ("frame", "<i8"),
        ("object", "<i4"),  # frame and object number in the source, to find the scene
        ("occluded", "<f4"),  # fraction hidden by others, 0 to 1
        ("truncation", "<f4"),  # fraction outside the image, 0 to 1
        ("alpha", "<f4"),  # KITTI's viewing angle, radians; NaN = unknown, or nothing there
        ("size", "<f4", (3,)),  # length, height, width, metres; NaN = unknown
        ("style", "u1"),  # index into `groundpose.lab.bodies.STYLE_NAMES`, or NO_STYLE
        ("camera", "<f4", (4,)),  # height in metres, pitch and roll in radians, focal length fx in pixels
    ]
)
NOTHING = len(CLASSES)
"""The `kind` of a crop without a vehicle."""
NO_STYLE = 255

Records = NDArray[np.void]
_Task = tuple[Path, int, int]
"""Path of a shard without its endings, first frame, number of frames."""


@dataclass(frozen=True, eq=False)
class Sample:
    """One stored crop (height, width, 3) and its record of type `LABEL`."""

    image: ByteArray
    label: Records


class Source(Protocol):
    """A source of samples: a module-level function or an object that can be pickled, for worker processes.

    The index of the folder keeps the function's name or the object's text, which therefore says all that
    decides what the samples are.
    """

    def __call__(self, seed: int, split: str, first: int, count: int, codec: Codec) -> Iterator[Sample]:
        """Samples of `count` frames from number `first`; they depend on the arguments alone."""


def record(
    class_name: str, keypoints: FloatArray, state: NDArray[np.integer[Any]], **values: ArrayLike
) -> Records:
    """A record of a vehicle of class `class_name` with keypoints (P, 2) and their states (P,)."""
    made = record_of(kind=CLASSES.index(class_name), **values)
    rows = keypoint_indices(class_name)
    made["keypoints"][rows], made["state"][rows] = keypoints, state
    return made


def record_of(**values: ArrayLike) -> Records:
    """A record of `LABEL` with these values; others are unknown, and without `kind` nothing is there."""
    made = np.zeros((), dtype=LABEL)
    for name in ("keypoints", "alpha", "size", "camera"):
        made[name] = np.nan
    made["kind"], made["style"] = NOTHING, NO_STYLE
    for name, value in values.items():
        made[name] = value
    return made


def write_crops(
    folder: Path,
    source: Source,
    split: str,
    frames: int,
    *,
    seed: int = 0,
    first: int = 0,
    frames_per_shard: int = 500,
    codec: Codec = STORED,
    jobs: int = 1,
    until: float = math.inf,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Write the missing shards of `frames` frames; returns the number of shards written.

    Args:
        folder: made if missing; a folder with other crops is refused.
        source: makes the samples; the shards are the same for any number of `jobs` (processes).
        until: no shard is begun after this time (`time.time()`) but the first.
        advance: called with (shards done, shards in all).

    Raises:
        InputError: the folder holds crops made with other settings, or another run writes there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with only_writer(folder):
        _write_index(folder, source, seed, frames_per_shard, codec)
        return _write_crops(
            folder, source, split, frames, seed, first, frames_per_shard, codec, jobs, until, advance
        )


def _write_crops(
    folder: Path,
    source: Source,
    split: str,
    frames: int,
    seed: int,
    first: int,
    frames_per_shard: int,
    codec: Codec,
    jobs: int,
    until: float,
    advance: Callable[[int, int], None],
) -> int:
    """In a folder that is ours alone."""
    starts = range(first, first + frames, frames_per_shard)

    def task(start: int) -> _Task:
        stem = folder / f"{split}-{start // frames_per_shard:05d}"
        return stem, start, min(frames_per_shard, first + frames - start)

    finished = {path.name for path in folder.glob(f"{split}-*-labels.npy")}
    tasks = (task(start) for start in starts)
    missing = (task for task in tasks if _labels(task[0]).name not in finished)
    done, written = len(finished), 0
    advance(done, len(starts))
    make = partial(_write_shard, source, seed, split, codec)
    begun = itertools.takewhile(lambda task: task[1] == first or time.time() < until, missing)
    for _ in map(make, begun) if jobs == 1 else _in_processes(make, begun, jobs):
        written += 1
        advance(done + written, len(starts))
    return written


def _in_processes(make: Callable[[_Task], None], tasks: Iterator[_Task], jobs: int) -> Iterator[None]:
    """Results as they come; a task is taken when a process is free for it."""
    with worker_pool(jobs) as pool:
        running = {pool.submit(make, task) for task in itertools.islice(tasks, jobs)}
        while running:
            ready, running = wait(running, return_when=FIRST_COMPLETED)
            running |= {pool.submit(make, task) for task in itertools.islice(tasks, len(ready))}
            for one in ready:
                yield one.result()


def _write_shard(source: Source, seed: int, split: str, codec: Codec, task: _Task) -> None:
    stem, first, count = task
    samples = list(source(seed, split, first, count, codec))
    images = np.empty((len(samples), 3, codec.height, codec.width), dtype=np.uint8)
    labels = np.empty(len(samples), dtype=LABEL)
    for i, sample in enumerate(samples):
        images[i], labels[i] = sample.image.transpose(2, 0, 1), sample.label
    _replace(_images(stem), images)
    _replace(_labels(stem), labels)


def _replace(path: Path, array: NDArray[Any]) -> None:
    """Write a complete file or none."""
    with whole_file(path, "wb") as file:
        np.save(file, array)


def _images(stem: Path) -> Path:
    return stem.with_name(stem.name + "-images.npy")


def _labels(stem: Path) -> Path:
    return stem.with_name(stem.name + "-labels.npy")


def _write_index(folder: Path, source: Source, seed: int, frames_per_shard: int, codec: Codec) -> None:
    index = {
        "version": VERSION,
        "source": f"{getattr(source, '__module__', '')}.{getattr(source, '__name__', source)}",
        "seed": seed,
        "frames_per_shard": frames_per_shard,
        "width": codec.width,
        "height": codec.height,
        "margin": codec.margin,
        "kinds": list(CLASSES),
        "keypoints": [keypoint.name for keypoint in KEYPOINTS],
    }
    path = folder / "index.json"
    if path.exists():
        found = json.loads(path.read_text())
        other = [name for name in index if found.get(name) != index[name]]
        if other:
            got = ", ".join(f"{name} {found.get(name)} instead of {index[name]}" for name in other)
            raise input_error(str(path), "crops made with the same source, seed and sizes", got)
        return
    folder.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps(index, indent=1) + "\n")


class Crops:
    """The finished shards of one split, memory-mapped: a length and `take`."""

    def __init__(self, folder: Path, split: str, limit: int | None = None) -> None:
        """Open the shards; `limit` keeps only the first samples.

        Raises:
            InputError: not a folder of crops, another version, other keypoints, or no finished shard.
        """
        path = folder / "index.json"
        if not path.exists():
            raise input_error(str(folder), "a folder of crops (index.json)", "none")
        self.index = json.loads(path.read_text())
        if self.index.get("version") != VERSION:
            raise input_error(str(path), f"version {VERSION}", self.index.get("version"))
        if self.index["keypoints"] != [k.name for k in KEYPOINTS] or self.index["kinds"] != list(CLASSES):
            raise input_error(str(path), "the keypoints and classes of this version", "others")
        self.codec = Codec(self.index["width"], self.index["height"], self.index["margin"])
        stems = [
            p.with_name(p.name.removesuffix("-labels.npy"))
            for p in sorted(folder.glob(f"{split}-*-labels.npy"))
        ]
        if not stems:
            raise input_error(str(folder), f"finished shards of split {split!r}", "none")
        self._images = [np.load(_images(stem), mmap_mode="r") for stem in stems]
        self.labels: Records = np.concatenate([np.load(_labels(stem)) for stem in stems])[:limit]
        self._starts = np.cumsum([0, *(len(images) for images in self._images)])
        self._rows: NDArray[np.intp] = np.arange(len(self.labels))

    def of(self, rows: NDArray[np.intp], boxes: FloatArray) -> Crops:
        """Some of the crops, cut for boxes (n, 4) around their vehicles."""
        some = copy.copy(self)
        some._rows, some.labels = self._rows[rows], self.labels[rows].copy()
        some.labels["box"] = boxes
        return some

    def __len__(self) -> int:
        """Number of crops."""
        return len(self.labels)

    def take(self, indices: NDArray[np.integer[Any]]) -> tuple[ByteArray, Records]:
        """Images (n, 3, height, width) and records (n,) of these crops."""
        images = np.empty((len(indices), 3, self.codec.height, self.codec.width), dtype=np.uint8)
        rows = self._rows[indices]
        shards = np.searchsorted(self._starts, rows, side="right") - 1
        for i, (index, shard) in enumerate(zip(rows, shards, strict=True)):
            images[i] = self._images[shard][index - self._starts[shard]]
        return images, self.labels[indices]
