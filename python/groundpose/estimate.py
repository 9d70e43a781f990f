"""`estimate_poses`: from keypoints, boxes and models of one image to poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from groundpose._core import InputError
from groundpose._given import Boxes, Given, Keypoints, Models
from groundpose.estimator import DEFAULT_OPTIONS, Estimator
from groundpose.options import Options
from groundpose.poses import PoseBatch
from groundpose.types import View

if TYPE_CHECKING:
    from groundpose.camera_state import CameraState
    from groundpose.frame import FramePriors


def estimate_poses(
    view: View,
    keypoints_2d: Keypoints,
    bboxes: Boxes,
    models: Models,
    keypoint_scores: ArrayLike | Sequence[ArrayLike] | None = None,
    options: Options = DEFAULT_OPTIONS,
    threads: int | None = None,
    frame_tilt_sigma: float | None = None,
    vehicle_probability: ArrayLike | None = None,
    viewing_angle_probabilities: ArrayLike | None = None,
    frame: FramePriors | CameraState | None = None,
) -> PoseBatch:
    """The pose (and shape) of every object of one image.

    Args:
        view: camera and its tilt against the ground.
        keypoints_2d: pixels, (N, P, 2) of any float dtype, stride and order, NaN = not seen; or a
            sequence of N arrays or lists (P_i, 2), in which None stands for a point not seen.
        bboxes: (N, 4) `left, top, right, bottom` pixels; in a list None for an object without box;
            NaN (None) for one unknown side; None: no boxes at all.
        models: one model for all objects or N models. With models of different numbers of keypoints
            an array `keypoints_2d` is as wide as the largest and NaN beyond an object's own.
        keypoint_scores: (N, P), or N sequences (P_i,), weights of a detector, at least 0; 0 or
            NaN: not seen. None: all weigh the same.
        options: see `Options`.
        threads: 1 or more, at most one for each core; None: all cores. The result is the same bit for bit.
        frame_tilt_sigma: radians, standard deviation of the frame's true tilt about the nominal tilt
            of `view`. The tilt is then estimated first, from all objects together, and stands in
            the result's `view`; this doubles the time. None: the nominal tilt is taken as true.
        vehicle_probability: (N,) that there is a vehicle at all, as a network says it; NaN, None: not said.
        viewing_angle_probabilities: (N, 16) of the angle from which a network sees the object, KITTI's alpha,
            bin b centred on b * 22.5 degrees; they give `ambiguity` and `alternatives`. NaN, None: not said.
        frame: what is known of tilt, height, road and sizes; a `CameraState` learns from the frame. All
            objects then stand on one road: poses, sizes and covariances are those of the whole frame,
            `models` have the estimated sizes and `view` is an `EstimatedView`; residuals and what follows
            from them stay those of the objects alone. None: every object alone.

    Returns:
        N answers, in order. An object without an answer has a `status` that says why, and NaN; its
        data never raise an error.

    Raises:
        InputError: an argument of the wrong shape or length. TypeError: of the wrong type.

    Method: one-point RANSAC and robust refinement with the tilt as a prior (Lee et al., CVPR
    Workshops 2021, sec. 3, and beyond).
    """
    given = Given(
        keypoints_2d, bboxes, keypoint_scores, None, vehicle_probability, viewing_angle_probabilities
    )
    try:
        estimator = Estimator(view, models, options, threads, frame_tilt_sigma, frame)
    except (InputError, TypeError):
        # of several mistakes that of the argument which comes first is told
        if isinstance(view, View) and isinstance(options, Options) and frame is None:
            given.converted(models, options._thresholds)
        raise
    return estimator(*given)
