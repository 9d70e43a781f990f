"""Lens models: their names here and in other tools' files, and their coefficients.

The mathematics of each stands in a file of the Rust core's `geometry/lens`. A new model is a row of `LENSES`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from groundpose._checks import input_error, shaped, text

DEFAULT_LENS = "brown_conrady"


@dataclass(frozen=True)
class LensModel:
    """One lens model.

    Args:
        coefficients: names of its coefficients in order.
        required: how many of them must be given; the others are then 0.
        ros: its name as `distortion_model` of ROS's calibration files and camera_info messages.
    """

    coefficients: tuple[str, ...]
    required: int
    ros: str

    @property
    def counts(self) -> range:
        """How many coefficients can be given."""
        return range(self.required, len(self.coefficients) + 1)

    def checked(self, argument: str, value: object) -> tuple[float, ...]:
        """As many coefficients as the model has. Raises InputError, TypeError."""
        given = shaped(argument, value, *((n,) for n in self.counts)).tolist()
        return (*given, *[0.0] * (len(self.coefficients) - len(given)))


LENSES: dict[str, LensModel] = {
    "brown_conrady": LensModel(("k1", "k2", "p1", "p2", "k3"), 4, "plumb_bob"),
}

_NO_MODEL = ("none", "pinhole", "")
"""What files of cameras without a lens model say instead of its name."""


def lens_name(argument: str, value: object) -> str:
    """A name in `LENSES`. Raises InputError, TypeError."""
    name = text(argument, value)
    if name not in LENSES:
        raise input_error(argument, f"one of {', '.join(LENSES)}", repr(name))
    return name


def lens_of(content: str, place: str) -> str:
    """The lens model that a YAML text of OpenCV or ROS names. Raises InputError for an unknown one."""
    names = {model.ros: name for name, model in LENSES.items()}
    found = DEFAULT_LENS
    for match in re.finditer(r"(?m)^(?:distortion|camera)_model\s*:\s*[\"']?(\w*)", content):
        if match.group(1) in _NO_MODEL:
            continue
        if match.group(1) not in names:
            raise input_error(f"{place}: distortion_model", f"{', '.join(names)} or none", match.group(1))
        found = names[match.group(1)]
    return found
