"""What follows a search: PnP methods on the points it kept, by their names in the paper's figures."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from groundpose.lab.evaluate.baselines import aspnp, eppnp, gauss_newton, opnp, rpnp
from groundpose.lab.evaluate.baselines.geometry import Array, Pose

Fit = Callable[[Array, Array, Pose], Pose | None]
"""Kept points X (n, 3), x (n, 2) normalised, and the pose of the search, to a pose."""


@dataclass(frozen=True)
class Polish:
    """One method; `name` is appended to that of the search."""

    name: str
    note: str
    fit: Fit = field(repr=False)
    package: str | None = None

    def missing(self) -> str | None:
        """Why it cannot run, or None when it can."""
        absent = self.package is not None and importlib.util.find_spec(self.package) is None
        return f"{self.package} is not installed" if absent else None


def _epnp_gn(X: Array, x: Array, start: Pose) -> Pose | None:
    cv2 = importlib.import_module("cv2")
    try:
        found, r, t = cv2.solvePnP(X, x, np.eye(3), None, flags=cv2.SOLVEPNP_EPNP)
    except cv2.error:  # too few or degenerate points
        return None
    if not found or not (np.isfinite(r).all() and np.isfinite(t).all()):
        return None
    return gauss_newton(X, x, (np.asarray(cv2.Rodrigues(r)[0]), np.asarray(t).ravel()))


GN = Polish("GN", "Gauss-Newton from the pose of the search", gauss_newton)
PNPS = (
    Polish("EPnP+GN", "EPnP of OpenCV, then Gauss-Newton", _epnp_gn, "cv2"),
    Polish("RPnP", "Li et al. 2012, NumPy", lambda X, x, start: rpnp(X, x)),
    Polish("ASPnP", "Zheng et al., IEICE 2013, NumPy", lambda X, x, start: aspnp(X, x)),
    Polish("OPnP+N", "Zheng et al., ICCV 2013, NumPy", lambda X, x, start: opnp(X, x)),
    Polish("EPPnP", "Ferraz et al. 2014, NumPy", lambda X, x, start: eppnp(X, x)),
)
LEAST_POINTS = 6
"""Points a PnP needs (EPnP and EPPnP: twelve equations); with fewer there is no answer."""
