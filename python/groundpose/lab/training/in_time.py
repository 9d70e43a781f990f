"""Crops rendered and a network trained in one go that ends in time, wherever it runs."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from groundpose._writing import write_text
from groundpose.keypoints.codec import Codec
from groundpose.lab.training.crops import STORED, Source, write_crops

FRACTIONS = {"validation": 0.03, "test": 0.03, "train": 0.44}
"""Fractions of the time for rendering the crops of each split, in this order; the rest is for training."""
_FRAMES = 40
"""Frames of a shard: two drives, so that a process that ends late ends a little late."""
_MANY = 10**7
_SPENT = "rendered.json"


@dataclass(frozen=True)
class Plan:
    """What is rendered, into which folder, by how many processes, in how many minutes with the training."""

    folder: Path
    source: Source
    minutes: float
    jobs: int
    seed: int = 0
    codec: Codec = STORED


def render(plan: Plan, advance: Callable[[str, int], None] = lambda split, shards: None) -> float:
    """Render for the plan's time, counting earlier calls; returns the minutes left for training.

    `advance` is called with the split and the number of its finished shards.
    """
    plan.folder.mkdir(parents=True, exist_ok=True)
    record = plan.folder / _SPENT
    spent: dict[str, float] = json.loads(record.read_text()) if record.exists() else {}
    for split, fraction in FRACTIONS.items():
        start = time.time()
        left = 60.0 * plan.minutes * fraction - spent.get(split, 0.0)
        if left <= 0.0:
            continue
        write_crops(
            plan.folder,
            plan.source,
            split,
            _MANY,
            seed=plan.seed,
            frames_per_shard=_FRAMES,
            codec=plan.codec,
            jobs=plan.jobs,
            until=start + left,
            advance=lambda done, _, split=split: advance(split, done),  # type: ignore[misc]
        )
        spent[split] = spent.get(split, 0.0) + time.time() - start
        write_text(record, json.dumps(spent))
    return plan.minutes - sum(spent.values()) / 60.0
