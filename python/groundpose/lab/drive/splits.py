"""Seeds and bodies of the training, validation and test splits: ranges that cannot overlap."""

from __future__ import annotations

import numpy as np

from groundpose._checks import count, input_error
from groundpose.lab.bodies import real
from groundpose.vehicles import CLASSES

SPLITS = ("train", "validation", "test")
SEEDS_PER_SPLIT = 2**32
"""Number of seeds in each split; a user's seed 0 is the first of its split."""

# Bodies of a class in each split: number of the first one, and how many of cars and of the other classes.
_FIRST_BODY = {"train": 100_000, "validation": 200_000, "test": 300_000}
_BODIES = {"train": (3000, 1000), "validation": (300, 100), "test": (300, 100)}
# Fraction of the training split's vehicles that are drawn by hand, in the classes that have such.
_DRAWN_BY_HAND = 0.03


def scene_seed(seed: int, split: str = "train") -> int:
    """The seed of `scene()` for seed `seed` of a split.

    Raises:
        InputError: an unknown split, a seed outside 0 to 2**32 - 1.
    """
    if split not in SPLITS:
        raise input_error("split", f"one of {', '.join(SPLITS)}", repr(split))
    if count("seed", seed) >= SEEDS_PER_SPLIT:
        raise input_error("seed", f"0 to {SEEDS_PER_SPLIT - 1}", seed)
    return SPLITS.index(split) * SEEDS_PER_SPLIT + seed


def split_of(seed: int) -> str:
    """The split to which a seed of `scene()` belongs. Raises InputError for a seed of no split."""
    index = count("seed", seed) // SEEDS_PER_SPLIT
    if index >= len(SPLITS):
        raise input_error("seed", f"0 to {len(SPLITS) * SEEDS_PER_SPLIT - 1}", seed)
    return SPLITS[index]


def random_body(rng: np.random.Generator, class_name: str, split: str) -> int:
    """Seed of a body of class `class_name` that only this split uses."""
    drawn_by_hand = real.seeds(class_name) if split == "train" else ()
    if drawn_by_hand and rng.random() < _DRAWN_BY_HAND:
        return drawn_by_hand[int(rng.integers(len(drawn_by_hand)))]
    return _FIRST_BODY[split] + int(rng.integers(bodies_of(split, class_name)))


def bodies_of(split: str, class_name: str) -> int:
    """How many bodies of class `class_name` a split has."""
    return _BODIES[split][class_name != CLASSES[0]]
