"""How often a network calls a place without a vehicle a vehicle, and a vehicle none: on photographs that no
network was trained on."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.kitti.labels import CLASS_OF, KittiLabel, read_labels
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.image import as_rgb
from groundpose.keypoints.network import Network
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate.networks.photographs import BOXES, FOLDER
from groundpose.lab.training.nothing_boxes import covered, detector_box, inside
from groundpose.lab.training.streets import looks, streets

LEAST = 0.5
"""Probability from which a crop is called a vehicle."""
PER_FRAME, FLAT, LOOKS = 20, 32, 6
"""Boxes of each KITTI frame; pictures of grey and of each noise; looks at a frame and at its mirror image."""
_PEOPLE = ("Pedestrian", "Person_sitting", "Cyclist")
_TRIES = 4000

Crops = Iterator[tuple[str, ByteArray]]


def rates(network: Network, data: Path | None = None) -> dict[str, Any]:
    """Fractions by kind of place and over all, of those that the folder of real data (`--data`) has.

    Returns:
        `{"nothing": {kind: {"boxes": N, "called_vehicle": fraction}}, "vehicles": {"boxes": N, "called_none":
        fraction}}`; "vehicles" only where there are KITTI frames.
    """
    folder = data_folder(data)
    frames = folder / "kitti" / "training"
    found: dict[str, list[FloatArray]] = defaultdict(list)
    for source in (flat(network.codec), photographs(folder / FOLDER, network.codec)):
        _judge(network, source, found)
    result: dict[str, Any] = {}
    if frames.is_dir():
        _judge(network, backgrounds(frames, network.codec), found)
        result["vehicles"] = _vehicles(network, frames)
    kinds = {kind: np.concatenate(values) for kind, values in found.items()}
    kinds["all"] = np.concatenate(list(kinds.values()))
    return {
        "nothing": {
            kind: {"boxes": len(p), "called_vehicle": float((p >= LEAST).mean())} for kind, p in kinds.items()
        },
        **result,
    }


def vehicle_probability(network: Network, crops: ByteArray) -> FloatArray:
    """(N,) of crops (N, height, width, 3); 1 for networks that know vehicles only."""
    detections = network.detect(crops)
    return np.asarray(getattr(detections, "vehicle", np.ones(len(crops))), dtype=float)


def _judge(network: Network, source: Crops, found: dict[str, list[FloatArray]]) -> None:
    for kind, crops in source:
        found[kind].append(vehicle_probability(network, crops))


def photographs(folder: Path, codec: Codec) -> Crops:
    """Kind and crops of the boxes of `photographs.BOXES`; photographs that are not there are left out."""
    for name, kinds in BOXES.items():
        if not (folder / name).exists():
            continue
        image = as_rgb(folder / name)
        for kind, boxes in kinds.items():
            yield kind, codec.crops(image, np.array(boxes, dtype=float))


def backgrounds(frames: Path, codec: Codec) -> Crops:
    """ "street" (crops that meet no label nor region to ignore) and "person" of frames in KITTI's layout."""
    for path in sorted((frames / "label_2").glob("*.txt")):
        image = as_rgb(frames / "image_2" / f"{path.stem}.png")
        for kind, boxes in places(image, read_labels(path), int(path.stem), codec):
            yield kind, codec.crops(image, boxes)


def places(
    image: ByteArray, labels: list[KittiLabel], number: int, codec: Codec
) -> Iterator[tuple[str, FloatArray]]:
    """Kind and boxes (n, 4) of places in a frame, by its number, that meet no vehicle."""
    size = np.array([image.shape[1], image.shape[0]], dtype=float)
    rng = np.random.default_rng([89, number])
    for kind, boxes in (
        ("street", background_boxes(size, _boxes(labels), rng, PER_FRAME, codec)),
        ("person", people_boxes(labels)),
    ):
        if len(boxes):
            yield kind, boxes


def background_boxes(
    image_size: FloatArray, taken: FloatArray, rng: np.random.Generator, count: int, codec: Codec
) -> FloatArray:
    """Up to `count` boxes (n, 4) of a detector's shapes whose crops meet none of the boxes `taken` (N, 4)."""
    boxes: list[FloatArray] = []
    for _ in range(_TRIES):
        if len(boxes) == count:
            break
        box = inside(detector_box(rng, rng.random(2) * image_size), image_size)
        if box is not None and not covered(codec.windows(box[None])[0], taken).any():
            boxes.append(box)
    return np.array(boxes).reshape(-1, 4)


def people_boxes(labels: list[KittiLabel]) -> FloatArray:
    """Boxes (n, 4) of people and cyclists that meet no box of anything else."""
    people = _boxes([x for x in labels if x.type in _PEOPLE])
    others = _boxes([x for x in labels if x.type not in _PEOPLE])
    return people[[not covered(box, others).any() for box in people]].reshape(-1, 4)


def _boxes(labels: list[KittiLabel]) -> FloatArray:
    return np.array([x.bbox for x in labels], dtype=float).reshape(-1, 4)


def flat(codec: Codec) -> Crops:
    """ "grey": one brightness each; "noise": of pixels and of larger cells."""
    rng, shape = np.random.default_rng(90), (FLAT, codec.height, codec.width, 3)
    levels = np.linspace(0, 255, FLAT).astype(np.uint8)
    yield "grey", np.ascontiguousarray(np.broadcast_to(levels[:, None, None, None], shape))
    for cell in (1, 4, 16):
        cells = rng.integers(0, 256, (FLAT, -(-codec.height // cell), -(-codec.width // cell), 3))
        noise = cells.astype(np.uint8).repeat(cell, axis=1).repeat(cell, axis=2)
        yield "noise", np.ascontiguousarray(noise[:, : codec.height, : codec.width])


def _vehicles(network: Network, frames: Path) -> dict[str, Any]:
    """The labelled vehicles of `streets`, each with `LOOKS` boxes in the frame and in its mirror image."""
    found = [
        vehicle_probability(network, network.codec.crops(look.image, look.bboxes))
        for street in streets(frames, tuple(CLASS_OF))
        for look in looks(street, LOOKS)
        if len(look.bboxes)
    ]
    probability = np.concatenate(found)
    return {"boxes": len(probability), "called_none": float((probability < LEAST).mean())}
