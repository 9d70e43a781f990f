"""What is known of one camera, and grows from frame to frame."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields, replace
from os import PathLike
from typing import Any

import numpy as np

from groundpose import _core
from groundpose._checks import FloatArray, input_error, read_text, type_error
from groundpose._core import InputError
from groundpose._writing import write_text
from groundpose.frame import FramePriors, remarks
from groundpose.sizes import ClassSize, SizePrior
from groundpose.types import Camera, View

CONFLICT = 1.2
"""Standard deviations between the nominal height and the vehicles of all frames from which there is a remark.
So little of each frame's information is taken that at right heights they disagree by half a one, root mean
square."""
_VERSION = 1
_CLASSES = 3
"""Numbers before those of the classes: pitch, roll, log height."""


class CameraState:
    """Height and mean tilt of a camera and the sizes of the vehicles before it, learned from the frames that
    are estimated with `frame=` this state.

    A small part of each frame's information is taken: frames of a drive show the same vehicles. Without a
    height only the tilt is learned.

    >>> view = gp.View(gp.Camera(fx=1000, fy=1000, cx=640, cy=360), height=1.65)
    >>> state = gp.CameraState(view, gp.FramePriors(size=gp.SizePrior.region("europe")))
    >>> state.height, state.remarks
    (1.65, ())
    """

    def __init__(self, view: View, priors: FramePriors | None = None) -> None:
        """A camera of which only the nominal view is known.

        Args:
            view: camera and nominal tilt, and a height if it is known.
            priors: of each frame; None: the defaults.

        Raises:
            InputError: a height that cannot be. TypeError: something else.
        """
        if not isinstance(view, View):
            raise type_error("view", "a View", view)
        if priors is not None and not isinstance(priors, FramePriors):
            raise type_error("priors", "FramePriors", priors)
        self.view, self.priors = view, priors or FramePriors()
        self.names: list[str] = []
        self._take(_core.camera_state(view._handle, *self.priors.numbers([])))

    def _take(self, solved: dict[str, Any]) -> None:
        self._mean: FloatArray = solved["state_mean"]
        self._covariance: FloatArray = solved["state_covariance"]
        self._conflict: float | None = solved["state_conflict"]

    def __repr__(self) -> str:
        """What is known."""
        height = "unknown" if self.height is None else f"{self.height:.3f} m"
        pitch, roll = np.degrees(self._mean[:2])
        return f"CameraState(pitch={pitch:.2f} deg, roll={roll:.2f} deg, height={height})"

    @property
    def height(self) -> float | None:
        """Metres, as learned; None without a nominal one."""
        return None if self.view.height is None else float(self.view.height * np.exp(self._mean[2]))

    @property
    def class_scales(self) -> dict[str, tuple[float, float]]:
        """Log mean size and its standard deviation by class, in sizes of the shape models."""
        sigmas = np.sqrt(np.diag(self._covariance))
        return {
            name: (float(self._mean[_CLASSES + k]), float(sigmas[_CLASSES + k]))
            for k, name in enumerate(self.names)
        }

    @property
    def remarks(self) -> tuple[str, ...]:
        """What looks wrong in the nominal view, from all frames."""
        return remarks(np.nan if self._conflict is None else self._conflict, CONFLICT)

    def start_drive(self) -> None:
        """The mean tilt is open again: another drive, or the camera was touched. Height and sizes stay."""
        self._take(
            _core.camera_state(self.view._handle, *self.priors.numbers(self.names), self.carried(self.names))
        )

    def mean_view(self, view: View) -> View:
        """`view`, which must be the nominal one, with the mean tilt. Raises InputError for another view."""
        same = ("pitch", "roll", "height")
        if any(getattr(view, name) != getattr(self.view, name) for name in same):
            got = ", ".join(f"{name} {getattr(view, name)}" for name in same)
            raise input_error("view", "pitch, roll and height of the camera's state", got)
        return replace(view, pitch=float(self._mean[0]), roll=float(self._mean[1]))

    def carried(self, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Mean (11,) and covariance (11, 11) for the core, with prior sizes of classes that are new."""
        mean, covariance = self._mean.copy(), self._covariance.copy()
        _, scales = self.priors.numbers(names)
        for k in range(len(self.names), min(len(names), len(mean) - _CLASSES)):
            row = _CLASSES + k
            covariance[row], covariance[:, row] = 0.0, 0.0
            mean[row], covariance[row, row] = scales[k, 0], scales[k, 1] ** 2
        return mean, covariance

    def take(self, names: Sequence[str], solved: dict[str, Any]) -> None:
        """What the core knows after a frame; `names` of the classes, those known before first."""
        self.names = list(names)
        self._take(solved)

    def save(self, path: str | PathLike[str]) -> None:
        """Write everything to `path` (.json)."""
        size = {} if self.priors.size is None else self.priors.size.classes
        content = {
            "version": _VERSION,
            "camera": {f.name: getattr(self.view.camera, f.name) for f in fields(Camera) if f.init},
            **{name: getattr(self.view, name) for name in ("pitch", "roll", "height")},
            "priors": {f.name: getattr(self.priors, f.name) for f in fields(FramePriors) if f.name in _KEPT},
            "sizes": {
                name: {"mean": s.mean, "covariance": s.covariance.tolist(), "mean_sigma": s.mean_sigma}
                for name, s in size.items()
            },
            "classes": self.names,
            "mean": self._mean.tolist(),
            "covariance": self._covariance.tolist(),
        }
        write_text(path, json.dumps(content))

    @classmethod
    def load(cls, path: str | PathLike[str]) -> CameraState:
        """Read what `save` wrote. Raises OSError (no such file) or InputError (something else)."""
        try:
            content = json.loads(read_text(path))
            if content["version"] != _VERSION:
                raise input_error(str(path), f"version {_VERSION}", content["version"])
            state = cls(_stored_view(content), _stored_priors(content))
            state.names = [str(name) for name in content["classes"]]
            state._mean, state._covariance = (np.array(content[name]) for name in ("mean", "covariance"))
            state._take(
                _core.camera_state(
                    state.view._handle, *state.priors.numbers(state.names), state.carried(state.names), False
                )
            )
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            if isinstance(error, _core.InputError):
                raise InputError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None
            raise input_error(str(path), "what CameraState.save writes", "something else") from None
        return state


_KEPT = ("pitch_sigma", "roll_sigma", "height_sigma", "roughness", "slope", "curvature")


def _stored_view(content: dict[str, Any]) -> View:
    camera = content["camera"]
    listed = {name: tuple(v) for name, v in camera.items() if isinstance(v, list)}
    return View(Camera(**{**camera, **listed}), content["pitch"], content["roll"], content["height"])


def _stored_priors(content: dict[str, Any]) -> FramePriors:
    sizes = {
        name: ClassSize(tuple(s["mean"]), np.array(s["covariance"]), s["mean_sigma"])
        for name, s in content["sizes"].items()
    }
    return FramePriors(**content["priors"], size=SizePrior(sizes) if sizes else None)
