"""Answers of a tracker: a table with one row per vehicle and frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error


@dataclass(frozen=True, eq=False, kw_only=True)
class Tracks:
    """A table with one row per vehicle and frame. The plane is that of the first frame: right and forward of
    the camera as it stood then; angles from forward to the right."""

    id: NDArray[np.int64]
    """Number of the vehicle, from 1 in order of appearance."""
    name: NDArray[np.str_]
    """Its class, from all its frames."""
    frame: NDArray[np.int64]
    """Number of the frame, from 0 in the order of `Tracker.update`."""
    time: FloatArray
    """Seconds, as given."""
    index: NDArray[np.int64]
    """Which object of the frame it was; -1: not seen."""
    place: FloatArray
    """(2,) metres, right and forward: the middle of its bottom face."""
    place_covariance: FloatArray
    """(2, 2) of the place."""
    heading: FloatArray
    """Radians, -pi to pi: 0 = forward, pi / 2 = to the right."""
    heading_sigma: FloatArray
    """Radians, its standard deviation, if it does not face the other way."""
    facing_probability: FloatArray
    """Probability that it does not face the other way."""
    speed: FloatArray
    """m/s along the heading, negative: it reverses; relative to a camera whose motion is not known."""
    speed_sigma: FloatArray
    """m/s."""
    yaw_rate: FloatArray
    """rad/s, positive to the right."""
    yaw_rate_sigma: FloatArray
    """rad/s."""
    acceleration: FloatArray
    """m/s^2 along the heading."""
    acceleration_sigma: FloatArray
    """m/s^2."""
    size: FloatArray
    """(3,) metres, length, height, width; NaN: not known."""
    size_sigma: FloatArray
    """(3,) metres."""
    standing: NDArray[np.bool_]
    """Whether it stands still."""
    seen_from: FloatArray
    """(3,) metres right and forward of the camera now, and radians of the heading against the camera's."""

    @classmethod
    def of(cls, columns: dict[str, Any], names: list[str]) -> Tracks:
        """From the core's columns, `names` of its classes."""
        given = {name: value for name, value in columns.items() if name != "class"}
        classes = (
            np.array([*names, ""])[columns["class"]] if len(columns["class"]) else np.array([], dtype=str)
        )
        given["place_covariance"] = columns["place_covariance"].reshape(-1, 2, 2)
        return cls(**given, name=classes)

    @classmethod
    def join(cls, parts: Iterable[Tracks]) -> Tracks:
        """All rows of several tables, by vehicle and frame. Raises InputError without a table."""
        tables = list(parts)
        if not tables:
            raise input_error("parts", "at least one table", "none")
        joined = {f.name: np.concatenate([getattr(t, f.name) for t in tables]) for f in fields(cls)}
        return cls(**joined).sorted()

    def sorted(self) -> Tracks:
        """The rows by vehicle and frame."""
        return self[np.lexsort((self.frame, self.id))]

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.id)

    def __getitem__(self, rows: Any) -> Tracks:
        """Some of the rows: a slice, numbers or a mask."""
        return Tracks(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def __repr__(self) -> str:
        """How many vehicles."""
        return f"Tracks({len(np.unique(self.id))} vehicles, {len(self)} rows)"

    def vehicles(self) -> Iterator[Tracks]:
        """The rows of each vehicle, by number."""
        for number in np.unique(self.id):
            yield self[self.id == number]

    @property
    def place_sigma(self) -> FloatArray:
        """(N, 2) metres, standard deviations of `place`."""
        return np.asarray(np.sqrt(np.stack([self.place_covariance[:, k, k] for k in range(2)], axis=1)))
