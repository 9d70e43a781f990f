"""Results: the poses of one image."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, type_error
from groundpose.shape import ShapeModel
from groundpose.types import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Pose:
    """The answer for one object; the fields are those of `PoseBatch` without the leading N, cut to
    the object's own P keypoints and M modes."""

    status: str
    ok: bool
    R: FloatArray
    t: FloatArray
    yaw: float
    keypoints_2d: FloatArray
    bbox: FloatArray
    model: ShapeModel
    inlier_mask: NDArray[np.bool_]
    residuals: FloatArray
    reprojection_rmse: float
    score: float
    log10_nfa: float
    inlier_count: int
    inlier_threshold: float
    noise_sigma: float
    covariance: FloatArray
    shape_coefficients: FloatArray
    shape_covariance: FloatArray
    confidence: float
    ambiguity: float
    iterations: int
    hypotheses: int
    stop_reason: str
    solver: str
    stage_iterations: NDArray[np.int64]
    stage_costs: FloatArray

    @property
    def keypoints_3d(self) -> FloatArray:
        """(P, 3) metres in the object frame, the estimated shape applied; NaN without an answer."""
        return self.model.keypoints(self.shape_coefficients)


@dataclass(frozen=True, eq=False)
class PoseBatch:
    """The poses of the N objects of one image, in the order given.

    An object without an answer has a status other than "ok", NaN numbers and no inliers. P is the
    largest number of keypoints of a model here, M that of modes; beyond an object's own there is
    NaN for keypoints (False in the mask) and 0 for modes.

    Attributes:
        view: camera and tilt the poses belong to: as told, or as estimated from the whole frame.
        tilt_covariance: (2, 2) radians^2 of the estimated pitch and roll; NaN when the tilt is as told.
        keypoints_2d: (N, P, 2) pixels as given, NaN = not seen.
        bboxes: (N, 4) `left, top, right, bottom` pixels as given, NaN = not known.
        models: N shape models.
        status: (N,) str, "ok" or why there is no pose.
        ok: (N,) bool.
        R, t: (N, 3, 3) and (N, 3) metres, `X_camera = R @ X_object + t`.
        yaw: (N,) radians about the ground's normal, 0 = facing away; KITTI's rotation_y + pi/2.
        inlier_mask: (N, P) bool, `residuals <= inlier_threshold` of the pose returned.
        residuals: (N, P) undistorted pixels between keypoint and projection, NaN = not seen.
        reprojection_rmse: (N,) pixels, over the inliers.
        score: (N,) mean over the keypoints of `min(residual^2 / inlier_threshold^2, 1)`, weighed by
            their scores: 0 is perfect, 1 explains nothing.
        log10_nfa: (N,) log10 of the number of poses as good as this to expect among random
            keypoints (number of false alarms): the lower, the surer that it is no accident.
        inlier_count: (N,) int. inlier_threshold: (N,) pixels, the one used.
        noise_sigma: (N,) pixels, estimated standard deviation of a coordinate of an inlier.
        covariance: (N, 6, 6) of `[rotation vector (radians, perturbs R from the left), t (metres)]`.
        shape_coefficients: (N, M). shape_covariance: (N, M, M).
        confidence: (N,) probability of having drawn a good sample.
        ambiguity: (N,) 0 to 1, how well a clearly different pose (front and back exchanged, say)
            explains the keypoints compared with the pose returned.
        iterations, hypotheses: (N,) int, samples drawn and poses scored.
        stop_reason, solver: (N,) str.
        stage_iterations, stage_costs: (N, 3) of the refinement's stages.
    """

    view: View
    tilt_covariance: FloatArray
    keypoints_2d: FloatArray
    bboxes: FloatArray
    models: tuple[ShapeModel, ...]
    status: NDArray[np.str_]
    ok: NDArray[np.bool_]
    R: FloatArray
    t: FloatArray
    yaw: FloatArray
    inlier_mask: NDArray[np.bool_]
    residuals: FloatArray
    reprojection_rmse: FloatArray
    score: FloatArray
    log10_nfa: FloatArray
    inlier_count: NDArray[np.int64]
    inlier_threshold: FloatArray
    noise_sigma: FloatArray
    covariance: FloatArray
    shape_coefficients: FloatArray
    shape_covariance: FloatArray
    confidence: FloatArray
    ambiguity: FloatArray
    iterations: NDArray[np.int64]
    hypotheses: NDArray[np.int64]
    stop_reason: NDArray[np.str_]
    solver: NDArray[np.str_]
    stage_iterations: NDArray[np.int64]
    stage_costs: FloatArray

    @classmethod
    def _of(cls, values: dict[str, Any]) -> PoseBatch:
        """From all fields by name; at a sixth of the time that a frozen dataclass takes to set thirty."""
        made = object.__new__(cls)
        vars(made).update(values)
        return made

    def __len__(self) -> int:
        """Number of objects, N."""
        return len(self.status)

    def __repr__(self) -> str:
        """How many have an answer."""
        return f"PoseBatch({int(self.ok.sum())} of {len(self)} ok)"

    def __iter__(self) -> Iterator[Pose]:
        """The answers one by one."""
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int) -> Pose:
        """The answer for object `index`. Raises IndexError, TypeError (a slice: use the arrays)."""
        try:
            i = operator.index(index)
        except TypeError:
            raise type_error("index", "a whole number", index) from None
        if not -len(self) <= i < len(self):
            raise IndexError(f"index: expected {-len(self)} to {len(self) - 1}, got {i}")
        model = self.models[i]
        return Pose(**{f.name: _one(self, f.name, i, model) for f in fields(Pose)})

    def keypoints_3d(self, index: int) -> FloatArray:
        """(P, 3) metres in the object frame of object `index`, its shape applied; NaN without an answer."""
        return self[index].keypoints_3d

    def to_kitti(self, names: Sequence[str] | None = None, scores: object = None) -> str:
        """Lines of KITTI's object result format, one an object (`groundpose.formats.kitti.results`).

        Args:
            names: N class names; None: the models' names, "Car" for those without.
            scores: (N,) detection scores, higher is better; None: share of the seen keypoints that
                are inliers, 0 without an answer.
        """
        from groundpose.formats.kitti.results import format_results  # stands above this file

        return format_results(self, names, scores)

    def draw(
        self,
        image: object = None,
        path: str | PathLike[str] | None = None,
        *,
        truth: tuple[object, ...] | None = None,
        title: str = "",
    ) -> Figure:
        """Picture: overlay on the image at the left, bird's-eye view at the right.

        Args:
            image: (H, W, 3) uint8 or float 0 to 1, or (H, W); None: a blank one.
            path: where to write it (.png, .svg, .pdf), if anywhere.
            truth: `(R, t)` arrays (N, 3, 3) and (N, 3) to show beside the estimates, NaN = none; or
                `(R, t, bbox_3d)` with the true 3D boxes (N, 2, 3).
        """
        from groundpose.draw import draw_poses  # stands above this file

        return draw_poses(self, image, path, truth=truth, title=title)


# How far a Pose's field is cut: to the model's keypoints or modes, along how many axes.
_KEYPOINT_FIELDS = ("keypoints_2d", "inlier_mask", "residuals")
_MODE_FIELDS = {"shape_coefficients": 1, "shape_covariance": 2}


def _one(batch: PoseBatch, name: str, i: int, model: ShapeModel) -> Any:
    if name == "model":
        return model
    value = getattr(batch, "bboxes" if name == "bbox" else name)[i]
    if name in _KEYPOINT_FIELDS:
        return value[: len(model.keypoints_3d)]
    if name in _MODE_FIELDS:
        return value[(slice(model.modes),) * _MODE_FIELDS[name]]
    return value if isinstance(value, np.ndarray) else value.item()
