"""Vehicles that a program makes up, for times and tests."""

from __future__ import annotations

import numpy as np

import groundpose as gp
from groundpose._checks import FloatArray


def seen_once(
    view: gp.View,
    names: tuple[str, ...],
    R: FloatArray,
    t: FloatArray,
    covariance: FloatArray,
    ambiguity: float = 0.1,
) -> gp.SeenVehicles:
    """N vehicles as large as cars, of which neither another reading nor a box is known."""
    n = len(names)

    def unknown(*shape: int) -> FloatArray:
        return np.full((n, *shape), np.nan)

    return gp.SeenVehicles(
        view=view,
        names=names,
        R=R,
        t=t,
        covariance=covariance,
        other_R=unknown(3, 3),
        other_t=unknown(3),
        other_covariance=unknown(6, 6),
        other_probability=unknown(),
        bottom_centres=np.zeros((n, 3)),
        size=np.tile([4.3, 1.5, 1.8], (n, 1)),
        size_sigma=np.full((n, 3), 0.1),
        bboxes=unknown(4),
        ambiguity=np.full(n, ambiguity),
        probability=np.full(n, 0.9),
    )
