"""REPPnP: Ferraz, Binefa, Moreno-Noguer, "Very Fast Solution to the PnP Problem with Algebraic Outlier
Rejection", CVPR 2014 (its algebraic outlier rejection).

Starting with all points, the kernel vector of the linear system of the points in use is found, and points
whose algebraic error exceeds max(quartile of all errors, delta_max) are left out of the next round; it ends
when the quartile does not fall any more. Then EPPnP on what is left. No random samples; half of the points
being outliers is its limit by design."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from groundpose.lab.contenders.baselines.control_points import System
from groundpose.lab.contenders.baselines.geometry import Array, Pose

DELTA_FACTOR = 1.4
"""k of delta_max = k t_in / f (groundpose paper, sec. 4.1.3, as recommended by Ferraz et al.)."""
QUANTILE = 0.25
ROUNDS = 100


def reppnp(X: Array, x: Array, delta_max: float) -> tuple[Pose | None, npt.NDArray[np.bool_], int]:
    """Pose, mask (n,) of the points in use and number of rounds; `delta_max` in the normalised image.

    The kernel vector has length 1, so an error is that of a normalised image at the depth |v| makes of it.
    """
    system = System.of(X, x)
    used = np.ones(len(X))
    kernel, best_quartile = system.kernel(used), float("inf")
    rounds = 0
    for _ in range(ROUNDS):
        errors = system.algebraic_errors(kernel[:, -1])
        quartile = float(np.quantile(errors, QUANTILE))
        if quartile >= best_quartile:
            break
        best_quartile, rounds = quartile, rounds + 1
        used_new = (errors <= max(quartile, delta_max)).astype(float)
        if used_new.sum() < 6:
            break
        used = used_new
        kernel = system.kernel(used)
    return system.pose(kernel, used), used > 0, rounds
