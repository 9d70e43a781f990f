"""Other libraries, configured as well as they can be.

Every library is imported when it is first needed; one that is not installed says so through `missing()`. All
get the same threshold, confidence and iteration limit as our own solver. `pip install groundpose[rivals]`.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from groundpose.lab.contenders.contender import Answers, nothing
from groundpose.lab.contenders.objects import Array, Objects, Single
from groundpose.lab.timing import Clock

CONFIDENCE = 0.99
MAX_ITERATIONS = 10_000
Call = Callable[[Any, Single, Clock], tuple[Array, Array] | None]


@dataclass(frozen=True)
class Library:
    """One configuration of one library: one call per object, the rigid shape where a model has modes."""

    name: str
    note: str
    """What differs from the library's defaults."""
    package: str
    """Module to import."""
    call: Call = field(repr=False)
    """The library's module, an object and a clock to a pose or None."""
    slow_with_outliers: bool = False
    weighs_scores: bool = False

    def missing(self) -> str | None:
        """Why it cannot run, or None when it can."""
        found = importlib.util.find_spec(self.package) is not None
        return None if found else f"{self.package} is not installed"

    def solve(self, objects: Objects, clock: Clock) -> Answers:
        """See `Contender`. Its own calls are timed, not building its inputs: the time most in its favour.

        ImportError when the library is missing.
        """
        module = importlib.import_module(self.package)
        R, t = nothing(len(objects))
        seconds = np.zeros(len(objects))
        for k, single in enumerate(objects.singles):
            if len(single.keypoints_2d) < objects.fewest_points:
                continue
            before = clock.seconds
            pose = self.call(module, single, clock)
            seconds[k] = clock.seconds - before
            if pose is not None and np.isfinite(pose[0]).all() and np.isfinite(pose[1]).all():
                R[k], t[k] = pose
        return Answers(R, t, seconds)


def _poselib(tuned: bool) -> Call:
    def call(poselib: Any, single: Single, clock: Clock) -> tuple[Array, Array] | None:
        c = single.camera
        width, height = c.image_size or (0, 0)
        camera = {"model": "PINHOLE", "width": width, "height": height, "params": [c.fx, c.fy, c.cx, c.cy]}
        ransac = {
            "max_reproj_error": single.inlier_threshold,
            "success_prob": CONFIDENCE,
            "max_iterations": MAX_ITERATIONS,
        }
        bundle: dict[str, Any] = {}
        if tuned:
            # the defaults force 1000 iterations, three times the adaptive count and a Cauchy loss at 1 px
            ransac |= {"min_iterations": 0, "dyn_num_trials_mult": 1.0}
            bundle |= {"loss_type": "TRUNCATED", "loss_scale": single.inlier_threshold}
        pose, info = clock(
            poselib.estimate_absolute_pose, single.keypoints_2d, single.keypoints_3d, camera, ransac, bundle
        )
        # its failure is an identity pose, which only the count gives away
        return (np.asarray(pose.R), np.asarray(pose.t)) if info["num_inliers"] > 0 else None

    return call


def _opencv(flag: str) -> Call:
    """OpenCV's robust solver with a flag of its own, then Levenberg and Marquardt on the inliers."""

    def call(cv2: Any, single: Single, clock: Clock) -> tuple[Array, Array] | None:
        cv2.setNumThreads(1)  # as everybody here
        K = single.camera.K
        X, x = single.keypoints_3d, single.keypoints_2d
        try:
            limits = (MAX_ITERATIONS, single.inlier_threshold, CONFIDENCE)
            no_start = (None, None, None, False)  # distortion, r, t, whether those are a guess
            kernel = getattr(cv2, flag)
            found, r, t, inliers = clock(cv2.solvePnPRansac, X, x, K, *no_start, *limits, None, kernel)
            if not found or inliers is None or len(inliers) < 3:
                return None
            rows = np.asarray(inliers).ravel()
            r, t = clock(cv2.solvePnPRefineLM, X[rows], x[rows], K, None, r, t)
        except cv2.error:  # too few or degenerate points: an answer it does not have
            return None
        return np.asarray(cv2.Rodrigues(r)[0]), np.asarray(t).ravel()

    return call


def _pycolmap(pycolmap: Any, single: Single, clock: Clock) -> tuple[Array, Array] | None:
    c = single.camera
    width, height = c.image_size or (0, 0)
    # its pixel centres are at half-integers; a common shift of points and principal point changes nothing
    camera = pycolmap.Camera(model="PINHOLE", width=width, height=height, params=[c.fx, c.fy, c.cx, c.cy])
    estimation = pycolmap.AbsolutePoseEstimationOptions()
    estimation.ransac.max_error = single.inlier_threshold
    estimation.ransac.confidence = CONFIDENCE
    estimation.ransac.max_num_trials = MAX_ITERATIONS
    estimation.ransac.min_num_trials = 0
    estimation.ransac.dyn_num_trials_multiplier = 1.0
    estimation.ransac.min_inlier_ratio = 0.01
    estimation.ransac.random_seed = 0
    found = clock(
        pycolmap.estimate_and_refine_absolute_pose,
        single.keypoints_2d,
        single.keypoints_3d,
        camera,
        estimation,
    )
    if found is None:
        return None
    matrix = np.asarray(found["cam_from_world"].matrix())
    return matrix[:, :3], matrix[:, 3]


WITH_LM = "solvePnPRansac, then solvePnPRefineLM on its inliers"
POSELIB_TUNED = Library(
    "PoseLib tuned",
    "min_iterations 0, dyn_num_trials_mult 1, truncated loss at the threshold",
    "poselib",
    _poselib(tuned=True),
)
POSELIB = Library(
    "PoseLib", "threshold, confidence and iteration limit only", "poselib", _poselib(tuned=False)
)
OPENCV_EPNP = Library("OpenCV EPNP + LM", WITH_LM, "cv2", _opencv("SOLVEPNP_EPNP"), slow_with_outliers=True)
OPENCV_P3P = Library("OpenCV P3P + LM", WITH_LM, "cv2", _opencv("SOLVEPNP_P3P"))
OPENCV_MAGSAC = Library("OpenCV USAC MAGSAC + LM", WITH_LM, "cv2", _opencv("USAC_MAGSAC"))
OPENCV_ACCURATE = Library("OpenCV USAC ACCURATE + LM", WITH_LM, "cv2", _opencv("USAC_ACCURATE"))
OPENCV_SQPNP = Library(
    "OpenCV SQPNP + LM", WITH_LM, "cv2", _opencv("SOLVEPNP_SQPNP"), slow_with_outliers=True
)
PYCOLMAP = Library(
    "pycolmap",
    "estimate_and_refine_absolute_pose, min_num_trials 0, dyn_num_trials_multiplier 1, random_seed 0",
    "pycolmap",
    _pycolmap,
)
