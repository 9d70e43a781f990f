"""A frame as a whole: tilt, height, sizes and poses from all vehicles together, which stand on one road."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose import _core
from groundpose._checks import FloatArray, input_error, number, type_error
from groundpose._value import Value
from groundpose.poses import PoseBatch
from groundpose.shape import ShapeModel
from groundpose.sizes import SizePrior
from groundpose.types import View

_DEFAULTS = _core.default_frame_priors()
_SIGMAS = ("pitch_sigma", "roll_sigma", "height_sigma", "roughness", "slope")

FAR_TILT = np.radians(1.0)
"""Radians; objects are estimated again when the frame's tilt is farther than this from the nominal one."""
CONFLICT = 2.0
"""Standard deviations between the nominal height and the vehicles from which there is a remark."""
MOST_DEVIATION = 3.0
"""Shapes that follow their pose stay within so many standard deviations of the mean."""


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

    Raises:
        InputError: a standard deviation that is not positive or absurdly large. TypeError: not a number.
    """

    pitch_sigma: float = _DEFAULTS["pitch_sigma"]
    roll_sigma: float = _DEFAULTS["roll_sigma"]
    height_sigma: float = _DEFAULTS["height_sigma"]
    roughness: float = _DEFAULTS["roughness"]
    slope: float = _DEFAULTS["slope"]
    size: SizePrior | None = None
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

    @property
    def remarks(self) -> tuple[str, ...]:
        """What looks wrong in the nominal view."""
        if not abs(self.height_conflict) > CONFLICT:
            return ()
        where = "higher" if self.height_conflict > 0.0 else "lower"
        by = f"{abs(self.height_conflict):.1f} standard deviations"
        return (f"height: the vehicles say that the camera is {where}, by {by}",)


@dataclass(frozen=True)
class _Rows:
    """The objects of a batch that have a pose, and their classes."""

    poses: PoseBatch
    at: NDArray[np.intp]
    names: list[str]

    @classmethod
    def of(cls, poses: PoseBatch) -> _Rows:
        at = np.flatnonzero(poses.ok)
        return cls(poses, at, list(dict.fromkeys(poses.models[k].name for k in at)))

    def solved(self, view: View, priors: FramePriors) -> dict[str, Any]:
        """The core's answer."""
        poses, at = self.poses, self.at
        models = [poses.models[k] for k in at]
        return _core.solve_frame(
            view._handle,
            tuple(getattr(priors, name) for name in _SIGMAS),
            np.array([priors._prior.scale(name) for name in self.names]).reshape(-1, 3),
            [self.names.index(model.name) for model in models],
            np.array([model.bottom_centre for model in models]).reshape(-1, 3),
            poses.R[at],
            poses.t[at],
            poses.covariance[at],
        )


def estimate_frame(view: View, priors: FramePriors, estimate: Callable[[View], PoseBatch]) -> PoseBatch:
    """Poses of a frame's objects on one road; `estimate` gives those of the objects alone in a view."""
    rows = _Rows.of(estimate(view))
    solved = rows.solved(view, priors)
    tilt = {"pitch": solved["pitch"], "roll": solved["roll"]}
    if max(abs(tilt["pitch"] - view.pitch), abs(tilt["roll"] - view.roll)) > FAR_TILT:
        rows = _Rows.of(estimate(replace(view, **tilt)))
        solved = rows.solved(view, priors)
    return _corrected(rows, solved, view)


def _corrected(rows: _Rows, solved: dict[str, Any], nominal: View) -> PoseBatch:
    poses, at = rows.poses, rows.at
    view = _view(nominal, solved, rows.names)
    shapes = _shapes(rows, solved)
    values = {name: getattr(poses, name).copy() for name in ("R", "t", "yaw", "covariance", *shapes)}
    for name in ("R", "t", "yaw", "covariance"):
        values[name][at] = solved[name]
    for name, rows_of_shape in shapes.items():
        values[name][at] = rows_of_shape
    models = list(poses.models)
    for k, factor in zip(at, np.exp(solved["log_size"]), strict=True):
        models[k] = models[k].resized(factor)
    values |= {"models": tuple(models), "scale_covariance": _scale_covariance(rows, solved)}
    tilt = {"view": view, "tilt_covariance": solved["view_covariance"][:2, :2]}
    return type(poses)._of(vars(poses) | values | tilt)


def _view(nominal: View, solved: dict[str, Any], names: list[str]) -> EstimatedView:
    covariance, height = solved["view_covariance"], solved["height"]
    sigmas = np.sqrt(np.diag(covariance))
    scales = solved["scales"][: len(names)].tolist()
    conflict = solved["height_conflict"]
    return EstimatedView(
        nominal.camera,
        solved["pitch"],
        solved["roll"],
        height,
        pitch_sigma=float(sigmas[0]),
        roll_sigma=float(sigmas[1]),
        height_sigma=np.nan if height is None else float(sigmas[2] * height),
        covariance=covariance,
        class_scales={name: (mean, sigma) for name, (mean, sigma) in zip(names, scales, strict=True)},
        agreeing=solved["agreeing"],
        height_conflict=np.nan if conflict is None else conflict,
    )


def _shapes(rows: _Rows, solved: dict[str, Any]) -> dict[str, FloatArray]:
    """Shapes that follow their poses."""
    poses, at = rows.poses, rows.at
    own, follows = poses.covariance[at], _follows(rows)
    coefficients = poses.shape_coefficients[at]
    moved = coefficients + (follows @ solved["moved"][..., None])[..., 0]
    limit = np.maximum(np.abs(coefficients), MOST_DEVIATION * _deviations(rows, coefficients.shape[1]))
    after, joint = follows.transpose(0, 2, 1), solved["moved_covariance"]
    by_pose = _pose_by_moved(solved)
    return {
        "shape_coefficients": np.clip(moved, -limit, limit),
        "shape_covariance": poses.shape_covariance[at] + follows @ (joint[:, :6, :6] - own) @ after,
        "shape_pose_covariance": follows @ joint[:, :6] @ by_pose.transpose(0, 2, 1),
    }


def _follows(rows: _Rows) -> FloatArray:
    """(n, M, 6) how shapes follow their poses: `cov(shape, pose) cov(pose)^-1` of the objects alone."""
    between = rows.poses.shape_pose_covariance[rows.at].transpose(0, 2, 1)
    return np.asarray(np.linalg.solve(rows.poses.covariance[rows.at], between).transpose(0, 2, 1))


def _scale_covariance(rows: _Rows, solved: dict[str, Any]) -> FloatArray:
    """(N, M + 1) covariance of the log size with the coefficients, and its variance."""
    follows, joint = _follows(rows), solved["moved_covariance"]
    found = np.full((len(rows.poses), follows.shape[1] + 1), np.nan)
    found[rows.at, :-1] = (follows @ joint[:, :6, 6:])[..., 0]
    found[rows.at, -1] = joint[:, 6, 6]
    return found


def _deviations(rows: _Rows, modes: int) -> FloatArray:
    """(n, M) standard deviations of the shape coefficients of each object's class."""
    deviations = np.zeros((len(rows.at), modes))
    for row, k in zip(deviations, rows.at, strict=True):
        own = np.sqrt(rows.poses.models[k].eigenvalues)
        row[: len(own)] = own
    return deviations


def _pose_by_moved(solved: dict[str, Any]) -> FloatArray:
    """(n, 6, 7) derivatives of a pose by how it was moved and its log size."""
    found = np.zeros((len(solved["t"]), 6, 7))
    found[:, range(6), range(6)] = 1.0
    found[:, range(3, 6), range(3, 6)] = np.exp(solved["log_size"])[:, None]
    found[:, 3:, 6] = solved["t"]
    return found


def check_frame(frame: object, frame_tilt_sigma: float | None, covariance: bool) -> FramePriors:
    """Priors that can be used with these arguments. Raises InputError, TypeError."""
    if not isinstance(frame, FramePriors):
        raise type_error("frame", "FramePriors", frame)
    if frame_tilt_sigma is not None:
        raise input_error("frame_tilt_sigma", "None with `frame`, which has its own", frame_tilt_sigma)
    if not covariance:
        raise input_error("options.covariance", "True with `frame`", covariance)
    return frame
