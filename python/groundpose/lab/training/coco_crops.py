"""Crops of pictures that somebody labelled (COCO keypoints), to fine-tune a network on them.

`CocoSource` is a source for `crops.write_crops`; its frames are the file's pictures of one split.
"""

from __future__ import annotations

import hashlib
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error
from groundpose._core import InputError
from groundpose.formats.skips import Skips
from groundpose.keypoints.codec import Codec, cut, usable
from groundpose.keypoints.image import as_rgb
from groundpose.lab.drive import OUTSIDE, SPLITS
from groundpose.lab.training.coco_map import CocoMap, keypoints_of
from groundpose.lab.training.crops import Sample
from groundpose.lab.training.records import record_of
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS

SPLIT_PERCENTAGES = (80, 10, 10)
"""Of pictures in each of `SPLITS`, chosen by a hash of the picture's id."""
_TABLES = ("images", "annotations", "categories")


class BadAnnotation(Exception):
    """Why an annotation cannot be used."""


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A usable annotation: index into CLASSES, box (4,), keypoints (K, 2) with NaN, states (K,)."""

    kind: int
    box: FloatArray
    keypoints: FloatArray
    state: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture with at least one usable annotation; size is width, height."""

    path: Path
    size: tuple[int, int]
    vehicles: tuple[Vehicle, ...]


@dataclass(frozen=True, eq=False)
class CocoSource:
    """The pictures of one split, as a source of samples; `digest` is that of the file and its map."""

    pictures: tuple[Picture, ...]
    digest: str

    @property
    def __name__(self) -> str:
        """What the index of the crops calls the source."""
        return f"coco_crops({self.digest})"

    def __call__(self, seed: int, split: str, first: int, count: int, codec: Codec) -> Iterator[Sample]:
        """The vehicles of `count` pictures from number `first`; `seed` and `split` change nothing."""
        for number, picture in enumerate(self.pictures[first : first + count], first):
            image = as_rgb(picture.path)
            for index, vehicle in enumerate(picture.vehicles):
                window = codec.windows(vehicle.box[None])[0]
                label = record_of({
                    **{"keypoints": vehicle.keypoints, "state": vehicle.state, "kind": vehicle.kind},
                    **{"box": vehicle.box, "window": window, "image_size": picture.size},
                    **{"frame": number, "object": index},
                })  # fmt: skip
                yield Sample(cut(image, window, codec.width, codec.height), label)


def split_of_picture(picture_id: object) -> str:
    """The split of a picture: always the same for the same id."""
    percentage = int.from_bytes(hashlib.sha256(str(picture_id).encode()).digest()[:8], "big") % 100
    ends = np.cumsum(SPLIT_PERCENTAGES)
    return SPLITS[int(np.searchsorted(ends, percentage, side="right"))]


def read_coco(
    path: Path, names: CocoMap, images: Path | None = None, split: str | None = None
) -> tuple[dict[str, CocoSource], Skips]:
    """The sources of a COCO keypoints file by split, and what was left out.

    Args:
        path: the JSON file. Pixels count from the centre of the first one, as everywhere in groundpose.
        names: what the file's classes and keypoints are called here.
        images: folder of the pictures; None: `images` beside the file, or the file's own folder.
        split: of all pictures; None: by a hash of each picture's id, 80 / 10 / 10 %.

    Raises:
        OSError: the file cannot be read.
        InputError: not a COCO keypoints file, a map that does not fit it, nothing in it that can be used.
    """
    data = _load(path)
    names.check_against(data["categories"], path)
    beside = path.parent / "images"
    folder = images or (beside if beside.is_dir() else path.parent)
    skips = Skips()
    found: dict[str, list[Picture]] = {}
    for picture_id, picture in _pictures(path, data, names, folder, skips):
        found.setdefault(split or split_of_picture(picture_id), []).append(picture)
    if not found:
        got = skips.lines()[0] if skips.total else "no annotations"
        raise input_error(str(path), "an annotation that can be used", got)
    digest = hashlib.sha256(path.read_bytes() + names.text().encode()).hexdigest()[:12]
    return {name: CocoSource(tuple(found[name]), digest) for name in SPLITS if name in found}, skips


def _pictures(
    path: Path, data: dict[str, list[Any]], names: CocoMap, folder: Path, skips: Skips
) -> Iterator[tuple[object, Picture]]:
    """Ids and pictures with something to use; the rest goes to `skips`."""
    categories = {_key(row.get("id")): row for row in data["categories"] if isinstance(row, dict)}
    grouped: dict[object, list[tuple[int, Any]]] = defaultdict(list)
    for place, row in enumerate(data["annotations"]):
        grouped[_key(row.get("image_id") if isinstance(row, dict) else None)].append((place, row))
    for place, row in enumerate(data["images"]):
        mine = grouped.pop(_key(row.get("id")), []) if isinstance(row, dict) else []
        try:
            picture, size = _picture(row, folder)
        except BadAnnotation as problem:
            skips.add(str(problem), f"{path}: images[{place}]")
            continue
        vehicles = _vehicles(mine, categories, names, size, path, skips)
        if vehicles:
            yield row["id"], Picture(picture, size, vehicles)
    for rows in grouped.values():
        for place, _ in rows:
            skips.add("annotation of no picture in the file", f"{path}: annotations[{place}]")


def _key(value: object) -> object:
    """A value that a dictionary takes as a key."""
    return value if isinstance(value, (int, float, str)) else repr(value)


def _load(path: Path) -> dict[str, list[Any]]:
    try:
        data = json.loads(path.read_text("utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise input_error(str(path), "a JSON file", error) from None
    if not isinstance(data, dict):
        raise input_error(str(path), "an object with images, annotations, categories", type(data).__name__)
    for name in _TABLES:
        if not isinstance(data.get(name), list):
            raise input_error(f"{path}: {name}", "a list", type(data.get(name)).__name__)
    return data


def _picture(row: Any, folder: Path) -> tuple[Path, tuple[int, int]]:
    """Path and true size of a picture that can be read to its end."""
    if not isinstance(row, dict) or not isinstance(row.get("file_name"), str) or "id" not in row:
        raise BadAnnotation("picture without id or file_name")
    path = folder / row["file_name"]
    try:
        image = as_rgb(path)
    except (OSError, InputError):
        raise BadAnnotation(f"picture that cannot be read ({path.name})") from None
    return path, (image.shape[1], image.shape[0])


def _vehicles(
    rows: Sequence[tuple[int, Any]],
    categories: Mapping[Any, Any],
    names: CocoMap,
    size: tuple[int, int],
    path: Path,
    skips: Skips,
) -> tuple[Vehicle, ...]:
    found = []
    for place, row in rows:
        try:
            found.append(_vehicle(row, categories, names, size))
        except BadAnnotation as problem:
            skips.add(str(problem), f"{path}: annotations[{place}]")
    return tuple(found)


def _vehicle(row: Any, categories: Mapping[Any, Any], names: CocoMap, size: tuple[int, int]) -> Vehicle:
    if not isinstance(row, dict):
        raise BadAnnotation("annotation that is no object")
    if row.get("iscrowd"):
        raise BadAnnotation("a crowd")
    category = categories.get(_key(row.get("category_id")))
    if category is None:
        raise BadAnnotation("unknown category_id")
    class_name = names.class_of(str(category.get("name")))
    if class_name is None:
        raise BadAnnotation(f"category {category.get('name')!r} is not in the map")
    theirs = keypoints_of(category)
    left, top, width, height = _numbers(row, "bbox", 4)
    box = np.clip([left, top, left + width, top + height], -0.5, np.tile(size, 2) - 0.5)
    if not (width > 0 and height > 0 and usable(box[None], *size)[0]):
        raise BadAnnotation("bbox without area in the picture")
    triples = _numbers(row, "keypoints", 3 * len(theirs)).reshape(-1, 3)
    if not np.isin(triples[:, 2], (0, 1, 2)).all():
        raise BadAnnotation("visibility of a keypoint that is not 0, 1 or 2")
    keypoints = np.full((len(KEYPOINTS), 2), np.nan)
    state = np.full(len(KEYPOINTS), OUTSIDE, dtype=np.uint8)
    for name, (x, y, visibility) in zip(theirs, triples.tolist(), strict=True):
        ours = names.row_of(name, class_name)
        if ours is None or visibility == 0:
            continue
        keypoints[ours] = x, y
        inside = -0.5 <= x < size[0] - 0.5 and -0.5 <= y < size[1] - 0.5
        state[ours] = visibility if inside else OUTSIDE  # COCO's 1 and 2 are HIDDEN and VISIBLE
    return Vehicle(CLASSES.index(class_name), box, keypoints, state)


def _numbers(row: dict[str, Any], key: str, count: int) -> FloatArray:
    """`count` finite numbers of an annotation."""
    values = row.get(key)
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0) if count else np.full(1, np.nan)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise BadAnnotation(f"{key} that is not {count} finite numbers")
    return array
