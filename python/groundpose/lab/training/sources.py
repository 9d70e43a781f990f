"""Sources of crops by name."""

from __future__ import annotations

from groundpose._checks import input_error
from groundpose.lab.training.crops import Source
from groundpose.lab.training.mixed import drive_samples
from groundpose.lab.training.rendered import rendered_samples
from groundpose.lab.training.toy import toy_samples

SOURCES: dict[str, Source] = {
    "mixed": drive_samples,  # for training: cameras of all kinds, and places without a vehicle
    "car": rendered_samples,  # the vehicles that the camera of one car sees, to compare with the paper
    "toy": toy_samples,  # painted substitutes, in seconds
}


def source_named(name: str) -> Source:
    """A row of `SOURCES`. Raises InputError for another name."""
    if name not in SOURCES:
        raise input_error("source", f"one of {', '.join(SOURCES)}", repr(name))
    return SOURCES[name]
