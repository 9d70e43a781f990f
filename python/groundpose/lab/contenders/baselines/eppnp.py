"""EPPnP: the PnP method without outlier rejection of Ferraz, Binefa, Moreno-Noguer, "Very Fast Solution to
the PnP Problem with Algebraic Outlier Rejection", CVPR 2014 (its Procrustes-based PnP)."""

from __future__ import annotations

import numpy as np

from groundpose.lab.contenders.baselines.control_points import System
from groundpose.lab.contenders.baselines.geometry import Array, Pose


def eppnp(X: Array, x: Array) -> Pose | None:
    """`X` (n, 3), `x` (n, 2) normalised image, n >= 6 (planar: n >= 5)."""
    system, everything = System.of(X, x), np.ones(len(X))
    return system.pose(system.kernel(everything), everything)
