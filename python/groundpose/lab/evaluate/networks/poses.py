"""G1 and G2 with what a trained network sees in held-out pictures of the drive."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np

from groundpose.keypoints.network import Network
from groundpose.lab.contenders.objects import Array, Objects
from groundpose.lab.drive import labels, scene, scene_seed
from groundpose.lab.evaluate.networks.renders import labelled
from groundpose.lab.evaluate.simulated.box_noise import draw_boxes
from groundpose.lab.evaluate.simulated.objects import WIDTH, Vehicles, counts, from_rows, row_of
from groundpose.lab.evaluate.simulated.run import everybody
from groundpose.lab.evaluate.simulated.run import measure as measured
from groundpose.lab.training.crops import NOTHING, Crops
from groundpose.lab.training.evaluate import answers
from groundpose.vehicles import keypoint_indices, shape_model

SPLIT = "test"
BOXES = ("true boxes", "detected boxes")


def measure(network: Network, crops: Crops, experiment: str, boxes: str, seed: int) -> dict[str, Any]:
    """{method: numbers} of `experiment` ("G1" or "G2"); every method is given the true class."""
    given, vehicles = detected(network, crops, experiment, boxes, seed)
    found: dict[str, Any] = {}
    for contender in everybody(experiment):
        numbers, _ = measured(contender, given, vehicles, experiment == "G2")
        numbers.pop("groups")
        found[contender.name] = numbers
    return found


def detected(
    network: Network, crops: Crops, experiment: str, boxes: str, seed: int
) -> tuple[Objects, Vehicles]:
    """What the network says of the crops, and the truth of their vehicles."""
    vehicles, rows = _truth(crops)
    given = vehicles.seen.bboxes
    if boxes == "detected boxes":
        size = vehicles.camera.image_size
        assert size is not None
        given = draw_boxes(given, vehicles.occlusion, size, seed)
    seen = answers(network.detect, crops.of(rows, given), network.codec)
    points = network.codec.image_from_crop(seen.detections.keypoints, seen.windows)
    scores = network.calibration.scores(seen.detections, seen.sides_in_crop)
    models = vehicles.known_models if experiment == "G1" else vehicles.class_models(shape_model)
    keypoints, scores = _own(vehicles, points, np.nan), _own(vehicles, scores, 0.0)
    return vehicles.given(keypoints, scores, given, models), vehicles


def _own(vehicles: Vehicles, values: Array, fill: float) -> Array:
    """The values (N, K, ...) of each vehicle's own keypoints, (N, WIDTH, ...)."""
    found = np.full((len(vehicles), WIDTH, *values.shape[2:]), fill)
    for row, class_name, all_of_it in zip(found, vehicles.classes, values, strict=True):
        own = keypoint_indices(class_name)
        row[: len(own)] = all_of_it[own]
    return found


def _truth(crops: Crops) -> tuple[Vehicles, np.ndarray]:
    """The vehicles of the crops that KITTI would count, and which crops they are."""
    rows, places = [], []
    camera = None
    for number, members in _frames(crops):
        frame = scene(scene_seed(crops.index["seed"], SPLIT), number)
        camera = frame.camera
        seen = {label.index: label for label in labels(frame)}
        for place in members:
            if crops.labels["kind"][place] == NOTHING:
                continue
            row = row_of(labelled(seen, crops.labels[place]))
            if counts(row):
                rows.append(row)
                places.append(place)
    assert camera is not None
    return from_rows(camera, rows), np.array(places)


def _frames(crops: Crops) -> Iterator[tuple[int, list[int]]]:
    """Frame number and its crops, which follow each other."""
    for number, members in groupby(range(len(crops)), key=lambda i: int(crops.labels["frame"][i])):
        yield number, list(members)
