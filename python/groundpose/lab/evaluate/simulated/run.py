"""Runs G1 and G2: one detector with one kind of box after the other, continuing what is stored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import groundpose as gp
from groundpose._writing import only_writer
from groundpose.lab import timing
from groundpose.lab.contenders.contender import Contender
from groundpose.lab.contenders.libraries import Library
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.contenders.registry import TO_BEAT, installed
from groundpose.lab.contenders.use import Use, batched, with_scores, without_scores
from groundpose.lab.evaluate.experiments.run import Advance
from groundpose.lab.evaluate.experiments.store import Store
from groundpose.lab.evaluate.simulated.box_noise import draw_boxes
from groundpose.lab.evaluate.simulated.errors import Errors, summary
from groundpose.lab.evaluate.simulated.keypoint_noise import Detector
from groundpose.lab.evaluate.simulated.objects import Vehicles, collect
from groundpose.vehicles import shape_model

EXPERIMENTS = ("G1", "G2")
VEHICLES = 10_000
DETECTORS = (
    Detector("real CNN", 1.0, "as measured on KITTI, streets it had not seen"),
    Detector("Res10-like", 0.34, "0.25 / 0.74, the ratio of the paper's vertex errors (Table 1, 256 x 192)"),
    Detector("Res50-like", 0.25, "as small networks were found to be on pictures of the kind they learned"),
)
BOXES = ("true boxes", "detected boxes")
Source = Callable[[int, int], Vehicles]
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

    def given(self, experiment: str, vehicles: Vehicles, seed: int, model: Model) -> Objects:
        """What contenders are given; the same for G1 and G2 but for the models."""
        keypoints, scores = self.detector(vehicles.seen, seed)
        boxes = vehicles.seen.bboxes
        if self.boxes == "detected boxes":
            size = vehicles.camera.image_size
            assert size is not None
            boxes = draw_boxes(boxes, vehicles.occlusion, size, seed)
        models = vehicles.known_models if experiment == "G1" else vehicles.class_models(model)
        return vehicles.given(keypoints, scores, boxes, models)


SETTINGS = tuple(Setting(detector, boxes) for detector in DETECTORS for boxes in BOXES)


SLOW = 2000
"""Vehicles that a slow contender is given."""


def everybody(experiment: str) -> list[Use]:
    """Everybody that can run here, without scores first."""
    those = installed(experiment)
    return [use(one) for use in (without_scores, with_scores) for one in those]


def most(contender: Contender) -> int | None:
    """How many vehicles it is given, the first ones; fewer for a library that takes a millisecond each."""
    base = contender.contender if isinstance(contender, Use) else contender
    return SLOW if isinstance(base, Library) and base.name != TO_BEAT else None


def measure(
    contender: Contender, objects: Objects, vehicles: Vehicles, shapes: bool
) -> tuple[dict[str, Any], float]:
    """Numbers, and microseconds per vehicle of this thread."""
    some, truth = objects[: most(contender)], vehicles[: most(contender)]
    answers = batched(contender, timing.CHUNK).solve(some, timing.thread_clock())
    errors = Errors.of(truth, answers, some.shapes(answers.shape_coefficients))
    return summary(truth, errors, shapes), timing.microseconds(answers.seconds)


def select(experiment: str, methods: list[str] | None) -> list[Use]:
    """Those of `methods`. ValueError for a name that neither experiment has."""
    known = everybody(experiment)
    if methods is None:
        return known
    everywhere = {c.name for name in EXPERIMENTS for c in everybody(name)}
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

    `fresh` measures finished methods again, those of `methods` only. Raises InputError when another run
    writes into the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with only_writer(folder):
        return _run(experiment, vehicles, seed, folder, methods, fresh, advance, source, model)


def _run(
    experiment: str,
    vehicles: int,
    seed: int,
    folder: Path,
    methods: list[str] | None,
    fresh: bool,
    advance: Advance,
    source: Source,
    model: Model,
) -> Store:
    """In a folder that is ours alone."""
    store = Store.open(folder, experiment, vehicles, seed)
    wanted = select(experiment, methods)
    if fresh:
        store.forget([c.name for c in wanted])
    left = [(s, [c for c in wanted if not store.has(s.key, c.name)]) for s in SETTINGS]
    total, done = sum(len(some) for _, some in left), 0
    advance(0, total, "the drive")
    if total == 0:
        return store
    drive = source(vehicles, seed)
    order = [c.name for c in everybody(experiment)]
    for setting, some in left:
        given = setting.given(experiment, drive, seed, model) if some else None
        for contender in some:
            assert given is not None
            name = contender.name
            advance(done, total, f"{setting.key}, {name}")
            numbers, microseconds = measure(contender, given, drive, experiment == "G2")
            store.add(setting.key, {name: numbers}, {name: microseconds})
            store.write([s.key for s in SETTINGS], {name: contender.note}, order)
            done += 1
    advance(total, total, "")
    return Store.read(store.path)
