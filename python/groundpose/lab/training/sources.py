"""Sources of crops by name."""

from __future__ import annotations

from collections.abc import Callable

from groundpose._checks import input_error
from groundpose.lab.training.crops import Source
from groundpose.lab.training.mixed import DriveSamples
from groundpose.lab.training.toy import toy_samples

SOURCES: dict[str, Callable[[], Source]] = {
    "mixed": DriveSamples,  # for training: cameras of all kinds, and places without a vehicle
    "car": lambda: DriveSamples("car", nothing=0.0),  # what one car sees, to compare with the paper
    "toy": lambda: toy_samples,  # painted substitutes, in seconds
}


def source_named(name: str) -> Source:
    """The source of a row of `SOURCES`. Raises InputError for another name."""
    if name not in SOURCES:
        raise input_error("source", f"one of {', '.join(SOURCES)}", repr(name))
    return SOURCES[name]()
