"""Other libraries behind one interface, configured as well as they can be: no straw men.

Every library is imported when it is first needed; one that is not installed says so through `missing()`. All
get the same threshold, confidence and iteration limit as our own solver. `pip install groundpose[rivals]`.
"""

from __future__ import annotations

import importlib
import importlib.util
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from groundpose.lab.evaluate.scenes import Scene

Array = npt.NDArray[np.float64]

CONFIDENCE = 0.99
MAX_ITERATIONS = 10_000


@dataclass(frozen=True)
class Answer:
    """What a library gave for one scene; R and t are None when it gave nothing."""

    R: Array | None
    t: Array | None
    call_seconds: float
    """The library's own calls alone."""
    total_seconds: float
    """With building its inputs and reading its outputs."""


class Clock:
    """Adds up the time of the library's own calls."""

    def __init__(self) -> None:
        """No time yet."""
        self.seconds = 0.0

    def __call__(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The function's answer; its time is added."""
        start = time.perf_counter()
        result = function(*arguments)
        self.seconds += time.perf_counter() - start
        return result


Call = Callable[[Any, Scene, Clock], tuple[Array, Array] | None]


@dataclass(frozen=True)
class Rival:
    """One configuration of one library."""

    name: str
    options: str
    """What differs from the library's defaults, for the reader of a table."""
    package: str
    """Module to import."""
    call: Call = field(repr=False)
    """The library's module, a scene and a clock to a pose or None."""
    slow_with_outliers: bool = False
    """Needs a fifth of a second and more a call at 70 % outliers: left out of timings there."""

    def missing(self) -> str | None:
        """Why it cannot run, or None when it can."""
        found = importlib.util.find_spec(self.package) is not None
        return None if found else f"{self.package} is not installed"

    def solve(self, scene: Scene) -> Answer:
        """One scene. ImportError when the library is missing."""
        module = importlib.import_module(self.package)
        clock = Clock()
        start = time.perf_counter()
        pose = self.call(module, scene, clock)
        total = time.perf_counter() - start
        if pose is None or not (np.isfinite(pose[0]).all() and np.isfinite(pose[1]).all()):
            return Answer(None, None, clock.seconds, total)
        return Answer(pose[0], pose[1], clock.seconds, total)


def _poselib(tuned: bool) -> Call:
    def call(poselib: Any, scene: Scene, clock: Clock) -> tuple[Array, Array] | None:
        c = scene.camera
        width, height = c.image_size or (0, 0)
        camera = {"model": "PINHOLE", "width": width, "height": height, "params": [c.fx, c.fy, c.cx, c.cy]}
        ransac = {
            "max_reproj_error": scene.inlier_threshold,
            "success_prob": CONFIDENCE,
            "max_iterations": MAX_ITERATIONS,
        }
        bundle: dict[str, Any] = {}
        if tuned:
            # the defaults force 1000 iterations, three times the adaptive count and a Cauchy loss at 1 px
            ransac |= {"min_iterations": 0, "dyn_num_trials_mult": 1.0}
            bundle |= {"loss_type": "TRUNCATED", "loss_scale": scene.inlier_threshold}
        pose, info = clock(
            poselib.estimate_absolute_pose, scene.keypoints_2d, scene.keypoints_3d, camera, ransac, bundle
        )
        # its failure is an identity pose, told only by the count
        return (np.asarray(pose.R), np.asarray(pose.t)) if info["num_inliers"] > 0 else None

    return call


def opencv(flag: str) -> Call:
    """OpenCV's robust solver with a flag of its own, then Levenberg and Marquardt on the inliers."""

    def call(cv2: Any, scene: Scene, clock: Clock) -> tuple[Array, Array] | None:
        cv2.setNumThreads(1)  # as everybody here
        K = scene.camera.K
        X, x = scene.keypoints_3d, scene.keypoints_2d
        try:
            limits = (MAX_ITERATIONS, scene.inlier_threshold, CONFIDENCE)
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


POSELIB_TUNED = Rival(
    "PoseLib tuned",
    "min_iterations 0, dyn_num_trials_mult 1, truncated loss at the threshold",
    "poselib",
    _poselib(tuned=True),
)
WITH_LM = "solvePnPRansac, then solvePnPRefineLM on its inliers"
OPENCV_EPNP = Rival("OpenCV EPNP + LM", WITH_LM, "cv2", opencv("SOLVEPNP_EPNP"), slow_with_outliers=True)
RIVALS = (
    POSELIB_TUNED,
    Rival("PoseLib", "threshold, confidence and iteration limit only", "poselib", _poselib(tuned=False)),
    OPENCV_EPNP,
    Rival("OpenCV P3P + LM", WITH_LM, "cv2", opencv("SOLVEPNP_P3P")),
    Rival("OpenCV USAC MAGSAC + LM", WITH_LM, "cv2", opencv("USAC_MAGSAC")),
)
"""Every configuration that is compared with, the one to beat first."""


def described() -> dict[str, str]:
    """What every rival is, or why it is missing, {name: text}: stored with results."""
    return {rival.name: rival.missing() or rival.options for rival in RIVALS}
