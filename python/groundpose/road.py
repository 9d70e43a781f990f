"""All vehicles of a frame on one road: poses, shapes and sizes of objects follow those of the frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose import _core
from groundpose._checks import FloatArray, input_error, type_error
from groundpose._given import Models
from groundpose.camera_state import CameraState
from groundpose.frame import EstimatedView, FramePriors
from groundpose.poses import PoseBatch
from groundpose.types import View

FAR_TILT = np.radians(1.0)
"""Radians; objects are estimated again when the frame's tilt is farther than this from theirs."""
MOST_DEVIATION = 3.0
"""Shapes that follow their pose stay within so many standard deviations of the mean."""


@dataclass(frozen=True)
class _Rows:
    """The objects of a batch that have a pose, and their classes."""

    poses: PoseBatch
    at: NDArray[np.intp]
    names: list[str]

    @classmethod
    def of(cls, poses: PoseBatch, known: Sequence[str] = ()) -> _Rows:
        """Those that have a pose; classes that are `known` come first."""
        at = np.flatnonzero(poses.ok)
        return cls(poses, at, list(dict.fromkeys([*known, *(poses.models[k].name for k in at)])))

    def solved(self, view: View, frame: FramePriors | CameraState) -> dict[str, Any]:
        """The core's answer."""
        poses, at = self.poses, self.at
        models = [poses.models[k] for k in at]
        state = frame if isinstance(frame, CameraState) else None
        priors = _priors(frame)
        return _core.solve_frame(
            view._handle,
            *priors.numbers(self.names),
            [self.names.index(model.name) for model in models],
            np.array([model.bottom_centre for model in models]).reshape(-1, 3),
            poses.R[at],
            poses.t[at],
            poses.covariance[at],
            None if state is None else state.carried(self.names),
        )


def sized(frame: FramePriors | CameraState, models: Models) -> Models:
    """Models with the sizes of their classes."""
    return _priors(frame).sized(models)


def _priors(frame: FramePriors | CameraState) -> FramePriors:
    """What is known before anything is seen."""
    return frame.priors if isinstance(frame, CameraState) else frame


def estimate_frame(
    view: View, frame: FramePriors | CameraState, estimate: Callable[[View], PoseBatch]
) -> PoseBatch:
    """Poses of a frame's objects on one road; `estimate` gives those of the objects alone in a view."""
    state = frame if isinstance(frame, CameraState) else None
    seen = view if state is None else state.mean_view(view)
    names = [] if state is None else state.names
    rows = _Rows.of(estimate(seen), names)
    solved = rows.solved(view, frame)
    tilt = {"pitch": solved["pitch"], "roll": solved["roll"]}
    if max(abs(tilt["pitch"] - seen.pitch), abs(tilt["roll"] - seen.roll)) > FAR_TILT:
        rows = _Rows.of(estimate(replace(view, **tilt)), names)
        solved = rows.solved(view, frame)
    if state is not None:
        state.take(rows.names, solved)
    priors = _priors(frame)
    return _corrected(rows, solved, view, np.array([priors.pitch_sigma, priors.roll_sigma]))


def _corrected(rows: _Rows, solved: dict[str, Any], nominal: View, sigmas: FloatArray) -> PoseBatch:
    poses, at = rows.poses, rows.at
    view = EstimatedView.of(nominal, solved, rows.names)
    follows = _follows(rows)
    shapes = _shapes(rows, solved, follows)
    values = {name: getattr(poses, name).copy() for name in ("R", "t", "yaw", "covariance", *shapes)}
    for name in ("R", "t", "yaw", "covariance"):
        values[name][at] = solved[name]
    for name, rows_of_shape in shapes.items():
        values[name][at] = rows_of_shape
    models = list(poses.models)
    for k, factor in zip(at, np.exp(solved["log_size"]), strict=True):
        models[k] = models[k].resized(factor)
    values |= {"models": tuple(models), "scale_covariance": _scale_covariance(rows, solved, follows)}
    tilt = {"view": view, "tilt_covariance": solved["view_covariance"][:2, :2]}
    given = {"nominal_view": nominal, "nominal_tilt_sigma": sigmas}
    return type(poses)._of(vars(poses) | values | tilt | given)


def _shapes(rows: _Rows, solved: dict[str, Any], follows: FloatArray) -> dict[str, FloatArray]:
    """Shapes that follow their poses."""
    poses, at = rows.poses, rows.at
    own = poses.covariance[at]
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


def _scale_covariance(rows: _Rows, solved: dict[str, Any], follows: FloatArray) -> FloatArray:
    """(N, M + 1) covariance of the log size with the coefficients, and its variance."""
    joint = solved["moved_covariance"]
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


def check_frame(frame: object, frame_tilt_sigma: float | None, covariance: bool) -> FramePriors | CameraState:
    """What can be used with these arguments. Raises InputError, TypeError."""
    if not isinstance(frame, (FramePriors, CameraState)):
        raise type_error("frame", "FramePriors or a CameraState", frame)
    if frame_tilt_sigma is not None:
        raise input_error("frame_tilt_sigma", "None with `frame`, which has its own", frame_tilt_sigma)
    if not covariance:
        raise input_error("options.covariance", "True with `frame`", covariance)
    return frame
