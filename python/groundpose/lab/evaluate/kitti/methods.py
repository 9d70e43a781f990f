"""The methods of `groundpose evaluate kitti` by the names of its option."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from groundpose.lab.evaluate.methods import HRE_VEHICLE, paper_search
from groundpose.lab.evaluate.rivals import POSELIB_TUNED, Rival

LOWEST_SCORE = 0.1
"""The paper's methods do not weigh keypoints: those with a lower score are left out."""


@dataclass(frozen=True)
class KittiMethod:
    """One line of the table."""

    name: str
    options: dict[str, Any] = field(default_factory=dict)
    """Fields of `groundpose.Options`."""
    weights: bool = False
    """Whether scores weigh keypoints, or else cut them off."""
    rival: Rival | None = None
    """Another library instead of our core; it gets the mean shape."""
    threshold_factor: float = 1.0
    """On the paper's inlier threshold, for another library."""


def _paper(solver: str, refinement: str) -> KittiMethod:
    options = paper_search(solver, refinement, HRE_VEHICLE)
    return KittiMethod(f"RNSC-{solver.upper()}+{refinement.upper()}", options)


METHODS = {
    "default": KittiMethod("ours, default", weights=True),
    "default-cut": KittiMethod("ours, default, scores cut off"),
    **{
        f"{solver}+{refinement}": _paper(solver, refinement)
        for solver in ("p1p", "p3p")
        for refinement in ("re", "hre")
    },
    "poselib": KittiMethod("PoseLib tuned", rival=POSELIB_TUNED),
    "poselib-x4": KittiMethod("PoseLib tuned, threshold x 4", rival=POSELIB_TUNED, threshold_factor=4.0),
}
"""`RNSC-` ones are the paper's (four cases, inlier count, tilt and box forgotten after the search) in our
core."""
OWN = tuple(name for name, m in METHODS.items() if m.rival is None and name != "default-cut")
"""What `all` stands for."""
