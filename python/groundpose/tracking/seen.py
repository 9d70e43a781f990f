"""The vehicles of one frame, as a tracker takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.poses import PoseBatch
from groundpose.types import View


@dataclass(frozen=True, eq=False, kw_only=True)
class SeenVehicles:
    """The vehicles of one frame, as a tracker takes them: of a `PoseBatch`, or of a file of poses.

    Attributes:
        view: the camera and its tilt.
        names: N class names.
        R, t, covariance: (N, 3, 3), (N, 3), (N, 6, 6) as those of a `PoseBatch`; NaN: no answer.
        other_R, other_t, other_covariance, other_probability: of the other readings; NaN: none.
        bottom_centres: (N, 3) metres, middle of the bottom face in the vehicle's own frame.
        size, size_sigma: (N, 3) metres, length, height, width; NaN: not known.
        bboxes: (N, 4) left, top, right, bottom pixels; NaN: not known.
        ambiguity: (N,) probability that it faces the half of the directions turned away.
        probability: (N,) that the answer is right.
        error_dof: degrees of freedom of Student's t of the errors.
    """

    view: View
    names: tuple[str, ...]
    R: FloatArray
    t: FloatArray
    covariance: FloatArray
    other_R: FloatArray
    other_t: FloatArray
    other_covariance: FloatArray
    other_probability: FloatArray
    bottom_centres: FloatArray
    size: FloatArray
    size_sigma: FloatArray
    bboxes: FloatArray
    ambiguity: FloatArray
    probability: FloatArray
    error_dof: float = np.inf

    @classmethod
    def of(cls, poses: PoseBatch) -> SeenVehicles:
        """Of the poses of one image."""
        size, size_sigma = poses._sizes()
        return cls(
            view=poses.view,
            names=tuple(model.name for model in poses.models),
            R=poses.R,
            t=poses.t,
            covariance=poses.covariance,
            other_R=poses.alternative_R,
            other_t=poses.alternative_t,
            other_covariance=poses.alternative_covariance,
            other_probability=poses.alternative_probability,
            bottom_centres=np.array([model.bottom_centre for model in poses.models]).reshape(-1, 3),
            size=size,
            size_sigma=size * np.sqrt(size_sigma),
            bboxes=poses.bboxes,
            ambiguity=poses.ambiguity,
            probability=poses.probability,
            error_dof=poses.error_dof,
        )

    def __len__(self) -> int:
        """Number of objects, N."""
        return len(self.names)

    def numbers(self) -> FloatArray:
        """(N, 13) for the core."""
        last = [part[:, None] for part in (self.ambiguity, self.other_probability, self.probability)]
        return np.concatenate([self.size, self.size_sigma, self.bboxes, *last], axis=1)
