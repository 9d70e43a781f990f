"""How large vehicles are, by class and region of the world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from groundpose import _core
from groundpose._checks import FloatArray, finite, input_error, number, shaped, text, type_error
from groundpose._value import Value
from groundpose.shape import ShapeModel

_DEFAULTS = _core.default_frame_priors()
_CORRELATION = 0.36
"""Between the logarithms of length, height and width of vehicles of a class: 0.13 to 0.42 of KITTI's cars."""


@dataclass(frozen=True, eq=False)
class ClassSize(Value):
    """The sizes of a class of vehicles.

    Args:
        mean: `(length, height, width)`, metres.
        covariance: (3, 3) of the logarithms of length, height and width of a vehicle about the mean.
        mean_sigma: standard deviation of the logarithm of the mean size: how surely it is this.

    Raises:
        InputError: sizes that are not positive, a covariance that is none. TypeError: not numbers.
    """

    mean: tuple[float, float, float]
    covariance: FloatArray
    mean_sigma: float = _DEFAULTS["class_size_sigma"]

    def __post_init__(self) -> None:
        """Check the numbers."""
        mean = finite("mean", shaped("mean", self.mean, (3,)))
        if not (mean > 0.0).all():
            raise input_error("mean", "length, height and width above 0 metres", mean.tolist())
        covariance = finite("covariance", shaped("covariance", self.covariance, (3, 3))).copy()
        if not np.allclose(covariance, covariance.T) or np.linalg.eigvalsh(covariance).min() <= 0.0:
            raise input_error("covariance", "a symmetric, positive definite matrix", covariance.tolist())
        covariance.setflags(write=False)
        if not 0.0 < number("mean_sigma", self.mean_sigma) <= 1.0:
            raise input_error("mean_sigma", "a fraction above 0, at most 1", self.mean_sigma)
        self._set(mean=tuple(mean.tolist()), covariance=covariance, mean_sigma=float(self.mean_sigma))

    @property
    def own_sigma(self) -> float:
        """Standard deviation of the logarithm of a vehicle's size as a whole: what length, height and width
        have in common. The rest are proportions, which the modes of a shape model have."""
        shared = self.covariance[np.triu_indices(3, 1)].mean()
        return float(np.sqrt(np.clip(shared, 1e-6, 1.0)))


def _size(
    mean: tuple[float, float, float], sigmas: tuple[float, float, float], mean_sigma: float
) -> ClassSize:
    correlation = _CORRELATION + (1.0 - _CORRELATION) * np.eye(3)
    return ClassSize(mean, correlation * np.outer(sigmas, sigmas), mean_sigma)


# KITTI's labels (Karlsruhe, 2011): logarithms of length, height and width about their mean.
_CAR, _VAN, _TRUCK = (0.105, 0.08, 0.068), (0.165, 0.15, 0.095), (0.32, 0.16, 0.10)
_PICKUP = (0.08, 0.06, 0.05)

REGIONS: Mapping[str, Mapping[str, ClassSize]] = {
    # The bundled shape models as they are.
    "world": {},
    # Cars: three parts of KITTI's labels (3.89 x 1.51 x 1.62, Karlsruhe 2011) and two of the registrations of
    # 2013 to 2023 (4.47 x 1.55 x 1.82): roads are older than sales. Vans and trucks: KITTI's labels.
    "europe": {
        "car": _size((4.12, 1.53, 1.70), _CAR, 0.05),
        "van_bus": _size((4.92, 2.14, 1.90), _VAN, 0.10),
        "pickup": _size((5.30, 1.81, 1.86), _PICKUP, 0.05),
        "box_truck": _size((8.50, 3.30, 2.53), _TRUCK, 0.10),
    },
    # Cars: anchors of detectors for nuScenes (4.61 x 1.72 x 1.95), Lyft (4.75 x 1.71 x 1.92) and Waymo
    # (4.73 x 1.77 x 2.08), whose widths hold the mirrors; trucks: nuScenes (6.74 x 2.73 x 2.46) and Lyft
    # (10.24 x 3.44 x 2.84). Pickups: a full-size crew cab.
    "north_america": {
        "car": _size((4.70, 1.72, 1.90), _CAR, 0.06),
        "van_bus": _size((5.60, 2.20, 2.02), _VAN, 0.15),
        "pickup": _size((5.75, 1.93, 2.00), _PICKUP, 0.05),
        "box_truck": _size((8.30, 3.10, 2.55), _TRUCK, 0.12),
    },
    # More than a third of the cars are kei cars (at most 3.40 x 2.00 x 1.48), the others as in Europe.
    "japan": {
        "car": _size((4.00, 1.60, 1.62), (0.14, 0.08, 0.08), 0.06),
        "van_bus": _size((4.70, 1.98, 1.69), _VAN, 0.10),
        "box_truck": _size((6.50, 2.80, 2.15), _TRUCK, 0.12),
    },
    # Cars: Rope3D (4.59 x 1.69 x 1.96), whose boxes are those of lidar and hold the mirrors.
    "china": {
        "car": _size((4.59, 1.64, 1.85), _CAR, 0.06),
        "van_bus": _size((5.20, 2.10, 1.90), _VAN, 0.12),
        "box_truck": _size((8.00, 3.10, 2.45), _TRUCK, 0.12),
    },
}
"""Sizes by region; a class that is not there has that of its shape model."""


@dataclass(frozen=True, eq=False)
class SizePrior(Value):
    """How large the vehicles of each class are.

    Args:
        classes: the sizes of classes by the names of their shape models; classes left out are as large as
            their models, their mean within 8 %, a vehicle within 5 % of that.

    Raises:
        TypeError: something else.
    """

    classes: Mapping[str, ClassSize]

    def __post_init__(self) -> None:
        """Check the types."""
        if not isinstance(self.classes, Mapping):
            raise type_error("classes", "sizes by class", self.classes)
        for name, size in self.classes.items():
            if not isinstance(size, ClassSize):
                raise type_error(f"classes[{text('classes', name)!r}]", "a ClassSize", size)
        self._set(classes=dict(self.classes))

    @classmethod
    def region(cls, name: str = "world") -> SizePrior:
        """Sizes of the vehicles of a region, a name in `groundpose.sizes.REGIONS`."""
        if text("region", name) not in REGIONS:
            raise input_error("region", f"one of {', '.join(REGIONS)}", repr(name))
        return cls(REGIONS[name])

    @classmethod
    def from_dimensions(
        cls, dimensions: Mapping[str, tuple[float, float, float]], sigma: float = 0.02
    ) -> SizePrior:
        """Sizes that the caller knows: `(length, height, width)` in metres by class, each within `sigma` as
        a fraction."""
        if not isinstance(dimensions, Mapping):
            raise type_error("dimensions", "(length, height, width) by class", dimensions)
        if not 0.0 < number("sigma", sigma) <= 1.0:
            raise input_error("sigma", "a fraction above 0, at most 1", sigma)
        return cls({name: _size(size, (sigma,) * 3, sigma) for name, size in dimensions.items()})

    def sized(self, model: ShapeModel) -> ShapeModel:
        """The model with the mean size of its class."""
        size = self.classes.get(model.name)
        return model if size is None else _stretched(model, size.mean)

    def scale(self, class_name: str) -> tuple[float, float, float]:
        """Log of the mean size in sizes of `sized` models, its standard deviation, and that of a vehicle."""
        size = self.classes.get(class_name)
        if size is None:
            return 0.0, _DEFAULTS["class_size_sigma"], _DEFAULTS["own_size_sigma"]
        return 0.0, size.mean_sigma, size.own_sigma


@lru_cache(maxsize=64)
def _stretched(model: ShapeModel, size: tuple[float, float, float]) -> ShapeModel:
    return model.scaled(*size)
