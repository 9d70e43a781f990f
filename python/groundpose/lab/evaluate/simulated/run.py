"""Runs G1 and G2: one detector with one kind of box after the other, continuing what is stored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import groundpose as gp
from groundpose.lab.evaluate.experiments.outcome import CHUNK
from groundpose.lab.evaluate.experiments.run import Advance
from groundpose.lab.evaluate.experiments.store import Store
from groundpose.lab.evaluate.simulated.box_noise import draw_boxes
from groundpose.lab.evaluate.simulated.contest import Contestant, Given, contestants
from groundpose.lab.evaluate.simulated.errors import Errors, summary
from groundpose.lab.evaluate.simulated.keypoint_noise import Detector
from groundpose.lab.evaluate.simulated.objects import Objects, collect
from groundpose.vehicles import shape_model

EXPERIMENTS = ("G1", "G2")
VEHICLES = 10_000
DETECTORS = (
    Detector("real CNN", 1.0, "as measured on KITTI, streets it had not seen"),
    Detector("Res10-like", 0.34, "0.25 / 0.74, the ratio of the paper's vertex errors (Table 1, 256 x 192)"),
    Detector("Res50-like", 0.25, "as small networks were found to be on pictures of the kind they learned"),
)
BOXES = ("true boxes", "detected boxes")
Source = Callable[[int, int], Objects]
"""Count and seed to vehicles."""
Model = Callable[[str], gp.ShapeModel]
"""Class to shape model."""


@dataclass(frozen=True)
class Setting:
    """A detector and a kind of box."""

    detector: Detector
    boxes: str

    @property
    def key(self) -> str:
        """Its name in stored results."""
        return f"{self.detector.name}, {self.boxes}"

    def given(self, experiment: str, objects: Objects, seed: int, model: Model) -> Given:
        """What methods are given; the same for G1 and G2 but for the models."""
        keypoints, scores = self.detector(objects.seen, seed)
        boxes = objects.seen.bboxes
        if self.boxes == "detected boxes":
            size = objects.camera.image_size
            assert size is not None
            boxes = draw_boxes(boxes, objects.occlusion, size, seed)
        models = objects.known_models if experiment == "G1" else objects.class_models(model)
        return Given(objects, keypoints, scores, boxes, models)


SETTINGS = tuple(Setting(detector, boxes) for detector in DETECTORS for boxes in BOXES)


def select(experiment: str, methods: list[str] | None) -> list[Contestant]:
    """Those of `methods`. ValueError for a name that neither experiment has."""
    known = contestants(experiment)
    if methods is None:
        return known
    everywhere = {c.name for name in EXPERIMENTS for c in contestants(name)}
    if unknown := [name for name in methods if name not in everywhere]:
        raise ValueError(f"methods: expected some of {'; '.join(everywhere)}, got {'; '.join(unknown)}")
    return [c for c in known if c.name in methods]


def run(
    experiment: str,
    vehicles: int,
    seed: int,
    folder: Path,
    methods: list[str] | None = None,
    fresh: bool = False,
    advance: Advance = lambda done, total, text: None,
    source: Source = collect,
    model: Model = shape_model,
) -> Store:
    """Measure what is missing of G1 or G2 and store it method by method.

    `fresh` measures finished methods again, those of `methods` only.
    """
    store = Store.open(folder, experiment, vehicles, seed)
    wanted = select(experiment, methods)
    if fresh:
        store.forget([c.name for c in wanted])
    left = [(s, [c for c in wanted if not store.has(s.key, c.name)]) for s in SETTINGS]
    total, done = sum(len(some) for _, some in left), 0
    advance(0, total, "the drive")
    if total == 0:
        return store
    objects = source(vehicles, seed)
    order = [c.name for c in contestants(experiment)]
    for setting, some in left:
        given = setting.given(experiment, objects, seed, model) if some else None
        for contestant in some:
            assert given is not None
            advance(done, total, f"{setting.key}, {contestant.name}")
            part = given[: contestant.most]
            answers = contestant(part)
            numbers = summary(part.objects, Errors.of(part.objects, answers), experiment == "G2")
            store.add(
                setting.key, {contestant.name: numbers}, {contestant.name: microseconds(answers.seconds)}
            )
            store.write([s.key for s in SETTINGS], {contestant.name: contestant.note}, order)
            done += 1
    advance(total, total, "")
    return Store.read(store.path)


def microseconds(seconds: np.ndarray) -> float:
    """Median over chunks of the mean time a vehicle."""
    parts = np.array_split(seconds, max(len(seconds) // CHUNK, 1))
    return 1e6 * float(np.median([np.mean(part) for part in parts]))
