"""A camera as traffic has calibrated it: `camera.json`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, input_error, number, shaped, type_error
from groundpose._core import InputError
from groundpose._value import Value
from groundpose._writing import whole_file
from groundpose.formats.fields import parse
from groundpose.formats.frames import read_view
from groundpose.frame import FramePriors
from groundpose.sizes import ClassSize, SizePrior
from groundpose.types import Camera, View
from groundpose.vehicles.shape_models import shape_model

NOTE = "_profile"
"""Member of the file that other readers of cameras pass over."""
_VERSION = 1
_OWN_SIZE = 0.05
_LEAST_SIGMA = 1e-4


@dataclass(frozen=True, eq=False)
class CameraProfile(Value):
    """A camera that stands still, and how surely it is known.

    A `CameraState` begins where a profile ends: `CameraState(profile.view, profile.priors())`.

    Args:
        view: camera, pitch, roll and height above the road.
        covariance: (3, 3) of pitch, roll (radians) and the logarithm of the height.
        focal_sigma: standard deviation of the logarithm of the focal length; 0: it was given.
        class_scales: log mean size of each class over that of its shape model, and its standard deviation.
        vehicles, sightings: how many it was learned from.
        source: what it was learned from.
        remarks: what could not be known.

    Raises:
        InputError: a view without a height, numbers that cannot be. TypeError: something else.
    """

    view: View
    covariance: FloatArray
    focal_sigma: float = 0.0
    class_scales: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    vehicles: int = 0
    sightings: int = 0
    source: str = ""
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not isinstance(self.view, View):
            raise type_error("view", "a View", self.view)
        if self.view.height is None:
            raise input_error("view", "a view with a height", "none")
        covariance = shaped("covariance", self.covariance, (3, 3)).copy()
        if not np.isfinite(covariance).all() or np.linalg.eigvalsh(covariance).min() <= 0.0:
            raise input_error("covariance", "a symmetric, positive definite matrix", covariance.tolist())
        if not 0.0 <= number("focal_sigma", self.focal_sigma) <= 10.0:
            raise input_error("focal_sigma", "0 to 10", self.focal_sigma)
        covariance.setflags(write=False)
        self._set(covariance=covariance, class_scales=dict(self.class_scales))

    @property
    def pitch_sigma(self) -> float:
        """Radians."""
        return float(math.sqrt(self.covariance[0, 0]))

    @property
    def roll_sigma(self) -> float:
        """Radians."""
        return float(math.sqrt(self.covariance[1, 1]))

    @property
    def height_sigma(self) -> float:
        """Metres."""
        assert self.view.height is not None
        return self.view.height * float(math.sqrt(self.covariance[2, 2]))

    def priors(self) -> FramePriors:
        """What is known of each frame: `estimate_poses(profile.view, ..., frame=profile.priors())`."""
        sizes = {name: _class_size(name, *scale) for name, scale in self.class_scales.items()}
        return FramePriors(
            pitch_sigma=max(self.pitch_sigma, _LEAST_SIGMA),
            roll_sigma=max(self.roll_sigma, _LEAST_SIGMA),
            height_sigma=max(float(math.sqrt(self.covariance[2, 2])), _LEAST_SIGMA),
            size=SizePrior(sizes) if sizes else None,
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write `path` (.json), a file of a camera with a note of the rest. Raises OSError."""
        camera = {f.name: getattr(self.view.camera, f.name) for f in fields(Camera) if f.init}
        content = {
            "camera": {name: value for name, value in camera.items() if value is not None},
            "pitch_deg": math.degrees(self.view.pitch),
            "roll_deg": math.degrees(self.view.roll),
            "camera_height": self.view.height,
            NOTE: {
                "version": _VERSION,
                "pitch_sigma_deg": math.degrees(self.pitch_sigma),
                "roll_sigma_deg": math.degrees(self.roll_sigma),
                "camera_height_sigma": self.height_sigma,
                "covariance": self.covariance.tolist(),
                "focal_sigma": self.focal_sigma,
                "class_scales": {name: list(scale) for name, scale in self.class_scales.items()},
                "vehicles": self.vehicles,
                "sightings": self.sightings,
                "source": self.source,
                "remarks": list(self.remarks),
            },
        }
        with whole_file(path) as file:
            file.write(json.dumps(content, indent=1) + "\n")

    @classmethod
    def load(cls, path: str | PathLike[str]) -> CameraProfile:
        """Read what `save` wrote. Raises OSError (no such file) or InputError (something else)."""
        root = parse(Path(path).read_text(encoding="utf-8", errors="surrogateescape"), str(path))
        if not isinstance(root.value, dict) or not isinstance(root.value.get(NOTE), dict):
            raise input_error(
                str(path), "what CameraProfile.save or groundpose calibrate writes", "another file"
            )
        try:
            return cls(read_view(root), **_stored(root.value[NOTE]))
        except InputError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise input_error(str(path), "a camera profile", f"a damaged one ({error})") from None


def _stored(note: dict[str, Any]) -> dict[str, Any]:
    if note["version"] != _VERSION:
        raise ValueError(f"version {note['version']}")
    scales = {str(name): (float(mean), float(sigma)) for name, (mean, sigma) in note["class_scales"].items()}
    return {
        "covariance": np.array(note["covariance"], dtype=float),
        "focal_sigma": float(note["focal_sigma"]),
        "class_scales": scales,
        "vehicles": int(note["vehicles"]),
        "sightings": int(note["sightings"]),
        "source": str(note["source"]),
        "remarks": tuple(map(str, note["remarks"])),
    }


def is_profile(path: Path) -> bool:
    """Whether a file is a camera profile. Raises OSError."""
    text = path.read_text(encoding="utf-8", errors="surrogateescape")
    try:
        value = json.loads(text)
    except ValueError:
        return False
    return isinstance(value, dict) and NOTE in value


def _class_size(name: str, mean: float, sigma: float) -> ClassSize:
    factor = math.exp(mean)
    length, height, width = shape_model(name).size
    covariance = _OWN_SIZE**2 * np.ones((3, 3)) + 1e-4 * np.eye(3)
    size = (factor * length, factor * height, factor * width)
    return ClassSize(size, covariance, min(max(sigma, _LEAST_SIGMA), 1.0))
