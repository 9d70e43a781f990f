"""What is known of a frame before its vehicles are looked at, and its view after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from groundpose import _core
from groundpose._checks import FloatArray, number, type_error
from groundpose._value import Value
from groundpose.shape import ShapeModel
from groundpose.sizes import SizePrior
from groundpose.types import View

_DEFAULTS = _core.default_frame_priors()
_SIGMAS = ("pitch_sigma", "roll_sigma", "height_sigma", "roughness", "slope", "curvature")

CONFLICT = 2.0
"""Standard deviations between the nominal height and the vehicles from which there is a remark."""


@dataclass(frozen=True, eq=False)
class FramePriors(Value):
    """What is known of a frame before its vehicles are looked at: standard deviations.

    Args:
        pitch_sigma: radians, of the frame's pitch about the nominal one of the view.
        roll_sigma: radians, of its roll.
        height_sigma: of the view's height, as a fraction of it; not used where the view has none.
        roughness: metres, of the road under a vehicle about the plane through all.
        slope: radians, the same in proportion to the distance.
        size: how large vehicles are; None: as large as their shape models, within 8 %.
        curvature: 1 / metres, how the road bends up and down: the plane is off by half of it times the
            squared distance.

    Raises:
        InputError: a standard deviation that is not positive or absurdly large. TypeError: not a number.
    """

    pitch_sigma: float = _DEFAULTS["pitch_sigma"]
    roll_sigma: float = _DEFAULTS["roll_sigma"]
    height_sigma: float = _DEFAULTS["height_sigma"]
    roughness: float = _DEFAULTS["roughness"]
    slope: float = _DEFAULTS["slope"]
    size: SizePrior | None = None
    curvature: float = _DEFAULTS["curvature"]
    _prior: SizePrior = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check types here and values in the core."""
        values = {name: number(name, getattr(self, name)) for name in _SIGMAS}
        if self.size is not None and not isinstance(self.size, SizePrior):
            raise type_error("size", "a SizePrior", self.size)
        _core.check_frame_priors(tuple(values.values()), np.zeros((0, 3)))
        self._set(**values, _prior=self.size or SizePrior.region())

    def sized(self, models: ShapeModel | Sequence[ShapeModel]) -> ShapeModel | list[ShapeModel]:
        """Shape models with the sizes of their classes."""
        if isinstance(models, ShapeModel):
            return self._prior.sized(models)
        return [self._prior.sized(model) for model in models]

    def numbers(self, names: Sequence[str]) -> tuple[tuple[float, ...], FloatArray]:
        """For the core: the standard deviations, and (C, 3) the sizes of these classes."""
        sigmas = tuple(getattr(self, name) for name in _SIGMAS)
        return sigmas, np.array([self._prior.scale(name) for name in names]).reshape(-1, 3)


@dataclass(frozen=True)
class EstimatedView(View):
    """A view as the vehicles of a frame show it, with standard deviations.

    Args:
        camera, pitch, roll, height: as in `View`.
        pitch_sigma, roll_sigma: radians.
        height_sigma: metres; NaN without a height.
        covariance: (3, 3) of pitch, roll and the logarithm of the height.
        class_scales: log mean size and its standard deviation by class, in sizes of the shape models.
        agreeing: effective number of vehicles; those that disagree with all others count little.
        height_conflict: standard deviations by which vehicles and nominal height disagree, positive when the
            vehicles say that the camera is higher; NaN when one of them is missing.
    """

    pitch_sigma: float = np.nan
    roll_sigma: float = np.nan
    height_sigma: float = np.nan
    covariance: FloatArray = field(default_factory=lambda: np.full((3, 3), np.nan), compare=False)
    class_scales: dict[str, tuple[float, float]] = field(default_factory=dict, compare=False)
    agreeing: float = 0.0
    height_conflict: float = np.nan

    @classmethod
    def of(cls, nominal: View, solved: dict[str, Any], names: Sequence[str]) -> EstimatedView:
        """From the core's answer; `names` of the classes in its order."""
        covariance, height, conflict = (
            solved[name] for name in ("view_covariance", "height", "height_conflict")
        )
        pitch_sigma, roll_sigma, log_height_sigma = np.sqrt(np.diag(covariance)).tolist()
        scales = solved["scales"][: len(names)].tolist()
        return cls(
            nominal.camera,
            solved["pitch"],
            solved["roll"],
            height,
            pitch_sigma=pitch_sigma,
            roll_sigma=roll_sigma,
            height_sigma=np.nan if height is None else log_height_sigma * height,
            covariance=covariance,
            class_scales={name: (mean, sigma) for name, (mean, sigma) in zip(names, scales, strict=True)},
            agreeing=solved["agreeing"],
            height_conflict=np.nan if conflict is None else conflict,
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What looks wrong in the nominal view."""
        return remarks(self.height_conflict, CONFLICT)


def remarks(height_conflict: float, least: float) -> tuple[str, ...]:
    """What is to be said when vehicles and nominal height disagree by more than `least` standard
    deviations."""
    if not abs(height_conflict) > least:
        return ()
    where = "higher" if height_conflict > 0.0 else "lower"
    by = f"{abs(height_conflict):.1f} standard deviations"
    return (f"height: the vehicles say that the camera is {where}, by {by}",)
