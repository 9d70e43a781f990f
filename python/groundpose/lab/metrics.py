"""Errors of a pose against the truth, and their summary over many trials. Pure functions on arrays.

Conventions, for every function: leading axes broadcast; a NaN estimate ("no answer") gives a NaN error, and
`summarise` decides what a missing answer costs. Angles come out in degrees, as the `_deg` in the names says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from groundpose import Options

Array = npt.NDArray[np.float64]

NO_ANSWER_E_R_DEG = 180.0
NO_ANSWER_E_T_PERCENT = 100.0
FAILURE_E_R_DEG = 10.0
FAILURE_E_T_PERCENT = 10.0
FAR_OFF_E_R_DEG = 15.0
RELATIVE_THRESHOLD = float(Options().relative_threshold)
"""Inlier threshold as a fraction of the longer side of the box (paper, sec. 4.2.2)."""


def rotation_error_deg(R_true: npt.ArrayLike, R: npt.ArrayLike) -> Array:
    """e_r of the paper (sec. 4.1.2): the largest angle between corresponding columns.

    `R_true`, `R`: (..., 3, 3) -> (...). At most the geodesic angle, and 0 to 180. The cosine is clipped, so
    rounding cannot make an identical pair NaN; the arc cosine resolves about 1e-6 deg near zero.
    """
    cosines = np.sum(np.asarray(R_true, float) * np.asarray(R, float), axis=-2)
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)).max(axis=-1)))


def translation_error_percent(t_true: npt.ArrayLike, t: npt.ArrayLike) -> Array:
    """e_t of the paper (sec. 4.1.2): 100 |t_true - t| / |t|. `t_true`, `t`: (..., 3) -> (...).

    The paper divides by the norm of the ESTIMATE, not of the truth; kept so that numbers compare. An estimate
    at the origin has an infinite error.
    """
    estimate = np.asarray(t, float)
    difference = np.linalg.norm(np.asarray(t_true, float) - estimate, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(100.0 * difference / np.linalg.norm(estimate, axis=-1))


def angular_translation_error_deg(t_true: npt.ArrayLike, t: npt.ArrayLike) -> Array:
    """e_a of the paper (sec. 4.3): the angle between the two translations. (..., 3) -> (...).

    It ignores the scale, which one image of an object of unknown size does not tell. Computed as an arc
    tangent, exact for small angles.
    """
    a, b = np.asarray(t_true, float), np.asarray(t, float)
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sine, np.sum(a * b, axis=-1))))


def yaw_error_deg(yaw_true: npt.ArrayLike, yaw: npt.ArrayLike) -> Array:
    """Smallest angle between two yaws given in RADIANS, 0 to 180 degrees."""
    difference = np.asarray(yaw, float) - np.asarray(yaw_true, float)
    return np.asarray(np.degrees(np.abs(np.arctan2(np.sin(difference), np.cos(difference)))))


def yaw_between_deg(R_from: npt.ArrayLike, R_to: npt.ArrayLike) -> Array:
    """Angle of `R_to` against `R_from`, both (..., 3, 3), about the y axis of the latter, 0 to 180 degrees;
    NaN where a rotation is."""
    relative = np.swapaxes(np.asarray(R_from, float), -1, -2) @ np.asarray(R_to, float)
    return np.asarray(np.abs(np.degrees(np.arctan2(relative[..., 0, 2], relative[..., 2, 2]))))


def percentage(mask: npt.NDArray[np.bool_]) -> float | None:
    """How many are true of a mask (N,); None of none."""
    return float(100.0 * mask.mean()) if len(mask) else None


def failed(e_r_deg: npt.ArrayLike, e_t_percent: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """A failure: e_r > 10 deg or e_t > 10 % or no answer (NaN)."""
    right = (np.asarray(e_r_deg) <= FAILURE_E_R_DEG) & (np.asarray(e_t_percent) <= FAILURE_E_T_PERCENT)
    return np.asarray(~right)


@dataclass(frozen=True)
class Summary:
    """Errors over all trials; e_r and e_t count a missing answer as 180 deg and 100 %."""

    trials: int
    answered: float
    """Fraction of trials with an answer."""
    mean_e_r_deg: float
    median_e_r_deg: float
    mean_e_t_percent: float
    median_e_t_percent: float
    failures: float
    """Fraction with e_r > 10 deg or e_t > 10 % or no answer."""
    above_15_deg: float
    """Fraction with e_r > 15 deg or no answer."""
    mean_e_r_ok_deg: float
    """Mean over the trials that are not failures; NaN when all are."""
    mean_e_t_ok_percent: float


def summarise(e_r_deg: npt.ArrayLike, e_t_percent: npt.ArrayLike) -> Summary:
    """Summary of two (N,) arrays of errors, NaN where a method gave no answer.

    A method must not look better by staying silent, so no answer counts as e_r = 180 deg and e_t = 100 %,
    as a failure, and as above 15 deg. ValueError when there are no trials or the shapes differ.
    """
    e_r, e_t = np.asarray(e_r_deg, float), np.asarray(e_t_percent, float)
    if e_r.shape != e_t.shape or e_r.ndim != 1 or e_r.size == 0:
        raise ValueError(
            f"errors: expected two equal shapes (N,) with N > 0, got {e_r.shape} and {e_t.shape}"
        )
    answered = ~(np.isnan(e_r) | np.isnan(e_t))
    e_r = np.where(answered, e_r, NO_ANSWER_E_R_DEG)
    e_t = np.where(answered, e_t, NO_ANSWER_E_T_PERCENT)
    fails = failed(e_r, e_t)
    return Summary(
        trials=e_r.size,
        answered=float(answered.mean()),
        mean_e_r_deg=float(e_r.mean()),
        median_e_r_deg=float(np.median(e_r)),
        mean_e_t_percent=float(e_t.mean()),
        median_e_t_percent=float(np.median(e_t)),
        failures=float(fails.mean()),
        above_15_deg=float((e_r > FAR_OFF_E_R_DEG).mean()),
        mean_e_r_ok_deg=float(e_r[~fails].mean()) if not fails.all() else float("nan"),
        mean_e_t_ok_percent=float(e_t[~fails].mean()) if not fails.all() else float("nan"),
    )
