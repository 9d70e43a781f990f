"""Lens models: their names here and in other tools' files, and their coefficients.

The mathematics of each stands in a file of the Rust core's `geometry/lens`. A new model is a row of `LENSES`.
"""

from __future__ import annotations

from dataclasses import dataclass

from groundpose._checks import input_error, shaped, text

DEFAULT_LENS = "brown_conrady"
"""Moves no point when its coefficients are 0, which other models may."""


@dataclass(frozen=True)
class LensModel:
    """One lens model.

    Args:
        coefficients: names of its coefficients in order.
        counts: how many of them can be given; the others are then 0.
        ros: its name as `distortion_model` of ROS's calibration files and camera_info messages; of a model
            that ROS has not, ours.
        names: what other tools call it, in small letters and digits alone.
        is_wide: whether it maps directions, also those of 90 degrees and more from the optical axis, and no
            coefficients of 0 make it ideal.
    """

    coefficients: tuple[str, ...]
    counts: tuple[int, ...]
    ros: str
    names: tuple[str, ...]
    is_wide: bool = False

    def checked(self, argument: str, value: object) -> tuple[float, ...]:
        """As many coefficients as the model has. Raises InputError, TypeError."""
        given = shaped(argument, value, *((n,) for n in self.counts)).tolist()
        return (*given, *[0.0] * (len(self.coefficients) - len(given)))

    def shortest(self, coefficients: tuple[float, ...]) -> tuple[float, ...]:
        """The coefficients without zeros at the end, as far as the model's counts allow."""
        return next(coefficients[:n] for n in self.counts if not any(coefficients[n:]))


_BROWN = ("k1", "k2", "p1", "p2", "k3")
LENSES: dict[str, LensModel] = {
    "brown_conrady": LensModel(
        _BROWN, (4, 5), "plumb_bob", ("plumbbob", "radtan", "radialtangential", "brownconrady", "opencv")
    ),
    "rational": LensModel(
        (*_BROWN, "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"),
        (8, 12, 14),
        "rational_polynomial",
        ("rationalpolynomial", "rational", "fullopencv", "thinprism", "tilted"),
    ),
    "equidistant": LensModel(
        ("k1", "k2", "k3", "k4"),
        (4,),
        "equidistant",
        (
            *("equidistant", "equi", "fisheye", "opencvfisheye"),
            *("kannalabrandt", "kannalabrandt4", "kannalabrandt8", "kb4"),
        ),
        is_wide=True,
    ),
    "double_sphere": LensModel(("xi", "alpha"), (2,), "double_sphere", ("doublesphere", "ds"), is_wide=True),
    "field_of_view": LensModel(("omega",), (1,), "field_of_view", ("fieldofview", "fov"), is_wide=True),
    "omnidirectional": LensModel(
        ("xi", "k1", "k2", "p1", "p2"),
        (5,),
        "omnidirectional",
        ("omnidirectional", "omni", "mei"),
        is_wide=True,
    ),
}


def lens_name(argument: str, value: object) -> str:
    """A name in `LENSES`. Raises InputError, TypeError."""
    name = text(argument, value)
    if name not in LENSES:
        raise input_error(argument, f"one of {', '.join(LENSES)}", repr(name))
    return name
