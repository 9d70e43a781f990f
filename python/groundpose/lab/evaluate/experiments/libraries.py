"""Today's libraries as families of one method, with fewer trials where one needs too long."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from groundpose.lab.evaluate.experiments.outcome import Outcome, missing
from groundpose.lab.evaluate.experiments.settings import Setting
from groundpose.lab.evaluate.rivals import CONFIDENCE, MAX_ITERATIONS, RIVALS, WITH_LM, Clock, Rival, opencv
from groundpose.lab.evaluate.scenes import Array, Scene, Scenes


def _pycolmap(pycolmap: Any, scene: Scene, clock: Clock) -> tuple[Array, Array] | None:
    c = scene.camera
    width, height = c.image_size or (0, 0)
    # its pixel centres are at half-integers; a common shift of points and principal point changes nothing
    camera = pycolmap.Camera(model="PINHOLE", width=width, height=height, params=[c.fx, c.fy, c.cx, c.cy])
    estimation = pycolmap.AbsolutePoseEstimationOptions()
    estimation.ransac.max_error = scene.inlier_threshold
    estimation.ransac.confidence = CONFIDENCE
    estimation.ransac.max_num_trials = MAX_ITERATIONS
    estimation.ransac.min_num_trials = 0
    estimation.ransac.dyn_num_trials_multiplier = 1.0
    estimation.ransac.min_inlier_ratio = 0.01
    estimation.ransac.random_seed = 0
    found = clock(
        pycolmap.estimate_and_refine_absolute_pose, scene.keypoints_2d, scene.keypoints_3d, camera, estimation
    )
    if found is None:
        return None
    matrix = np.asarray(found["cam_from_world"].matrix())
    return matrix[:, :3], matrix[:, 3]


PYCOLMAP = Rival(
    "pycolmap",
    "estimate_and_refine_absolute_pose, min_num_trials 0, dyn_num_trials_multiplier 1, random_seed 0",
    "pycolmap",
    _pycolmap,
)
EVERY_RIVAL = (
    *RIVALS,
    Rival("OpenCV USAC ACCURATE + LM", WITH_LM, "cv2", opencv("USAC_ACCURATE")),
    Rival("OpenCV SQPNP + LM", WITH_LM, "cv2", opencv("SOLVEPNP_SQPNP"), slow_with_outliers=True),
    PYCOLMAP,
)
# most trials from an outlier share on: 5-point kernels of OpenCV need 17 ms an object at a half, 0.2 s at
# 0.7; its P3P 0.15 s at 0.9
CAPS_SLOW = ((0.8, 20), (0.6, 30), (0.45, 200))
CAPS = {"OpenCV P3P + LM": ((0.85, 100),)}
# E2 to E4 have the same share of outliers in 88 settings: methods of 7 ms and more an object get fewer trials
OFTEN, FEW = "OpenCV", 200


@dataclass(frozen=True)
class Library:
    """One configuration of one library."""

    rival: Rival

    @property
    def name(self) -> str:
        """The rival's."""
        return self.rival.name

    def methods(self) -> dict[str, str]:
        """Itself, when it is installed."""
        return {} if self.rival.missing() else {self.name: self.rival.options}

    def trials(self, setting: Setting, trials: int) -> int:
        """Fewer at high outlier shares for the slow ones."""
        if self.name.startswith(OFTEN) and setting.curve != "outlier_ratio":
            trials = min(trials, FEW)
        ratio = setting.options.get("outlier_ratio", 0.5)
        caps = CAPS_SLOW if self.rival.slow_with_outliers else CAPS.get(self.name, ())
        return min([trials, *(cap for share, cap in caps if ratio >= share)])

    def run(self, scenes: Scenes, wanted: list[str]) -> dict[str, Outcome]:
        """See `Family`. The library's own calls are timed, not building its inputs."""
        R, t = missing(len(scenes))
        seconds = np.zeros(len(scenes))
        self.rival.solve(scenes.singles[0])  # imports, first allocations
        for k, scene in enumerate(scenes.singles):
            answer = self.rival.solve(scene)
            seconds[k] = answer.call_seconds
            if answer.R is not None and answer.t is not None:
                R[k], t[k] = answer.R, answer.t
        return {self.name: Outcome(R, t, seconds)}
