"""What looks wrong in the input of one image, from the poses of all its objects.

A remark is "kind: details", as those of `groundpose.plausibility` are.
"""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.types import View

OBJECT_LEAN = np.radians(1.5)
"""Radians, standard deviation of an object's up axis about the ground's normal, as the solver takes it."""
FEWEST_OBJECTS = 3
"""One object may lean, and two may be wrong in the same way."""
LEAST_AGREEMENT = 0.6
"""Fraction of the objects that must lean the same way."""
SAME_LEAN = np.radians(8.0)
"""Radians between up axes that lean the same way."""
LEAST_TILT = np.radians(4.0)
"""Radians below which a nominal tilt is good enough for the prior of the poses."""
MOST_SIGMAS = 4.0
"""Standard deviations of the mean lean at which chance is no explanation."""
CONFLICT = 2.0
"""Standard deviations of a nominal tilt from which an estimated one disagrees with it."""
LEAST_SIGN = np.radians(1.0)
"""Radians from which the sign of a nominal tilt means something."""


def tilt_remarks(view: View, R: FloatArray, covariance: FloatArray) -> tuple[str, ...]:
    """Whether objects that should stand on the ground disagree with the nominal tilt.

    The lean of every object is known with the standard deviations of its covariance, and objects themselves
    lean by 1.5 degrees. Most must lean the same way, by more than chance.

    Args:
        view: with the nominal tilt.
        R: (N, 3, 3) of the objects; NaN: without a pose.
        covariance: (N, 6, 6) of their poses; NaN: the objects' own lean alone.

    Returns:
        One sentence for each of pitch and roll that is off, or none.
    """
    if len(R) < FEWEST_OBJECTS:
        return ()
    posed = np.isfinite(R[:, 0, 0])
    down, nominal, covariance = R[posed, :, 1], view.R_camera_from_ground[:, 1], covariance[posed]
    if len(down) < FEWEST_OBJECTS:
        return ()
    same = down @ down.T > np.cos(SAME_LEAN)
    group = same[np.argmax(same.sum(axis=1))]
    count = int(group.sum())
    if count < max(FEWEST_OBJECTS, LEAST_AGREEMENT * len(down)):
        return ()
    mean = down[group].sum(axis=0)
    mean /= np.linalg.norm(mean)
    off = float(_angles(mean, nominal))
    if off < LEAST_TILT:
        return ()
    # the rotation about the axis itself does not move it: with it, this is too much rather than too little
    stated = np.nan_to_num(np.trace(covariance[group, :3, :3], axis1=1, axis2=2))
    variances = stated + 2.0 * OBJECT_LEAN**2
    if off < MOST_SIGMAS * float(np.sqrt(variances.sum())) / count:
        return ()
    return _sentences(view, mean)


def _angles(a: FloatArray, b: FloatArray) -> FloatArray:
    """Radians between unit vectors along the last axis."""
    return np.asarray(np.arccos(np.clip((a * b).sum(axis=-1), -1.0, 1.0)))


def estimated_tilt_remarks(nominal: View, seen: View, sigmas: FloatArray) -> tuple[str, ...]:
    """Whether the tilt estimated from a frame is far from the nominal one.

    Args:
        nominal: with the tilt as given. seen: with the tilt as estimated.
        sigmas: (2,) radians, of the nominal pitch and roll.
    """
    far = {name: sigma for name, sigma in zip(_ANGLES, sigmas.tolist(), strict=True) if sigma > 0.0}
    return tuple(
        _sentence(name, getattr(nominal, name), getattr(seen, name))
        for name, sigma in far.items()
        if abs(_turn(getattr(seen, name) - getattr(nominal, name))) > CONFLICT * sigma
    )


def _sentences(view: View, down: FloatArray) -> tuple[str, ...]:
    if (down * view.R_camera_from_ground[:, 1]).sum() < 0.0:
        return ("upside down: the vehicles stand so; the image may be turned by half a turn",)
    seen = View.from_gravity(view.camera, down)
    off = {name: abs(_turn(getattr(seen, name) - getattr(view, name))) for name in _ANGLES}
    most = max(off.values())
    return tuple(
        _sentence(name, getattr(view, name), getattr(seen, name))
        for name, angle in off.items()
        if angle >= LEAST_TILT or angle == most
    )


_ANGLES = ("pitch", "roll")


def _sentence(name: str, nominal: float, seen: float) -> str:
    """With the degrees between them, and whether the sign may be that of another convention."""
    off = abs(_turn(seen - nominal))
    mirrored = abs(nominal) > LEAST_SIGN and abs(_turn(seen + nominal)) < 0.5 * off
    sign = "; is its sign of another convention?" if mirrored else ""
    return f"nominal {name}: the vehicles disagree with it by {np.degrees(off):.0f} deg{sign}"


def _turn(angle: float) -> float:
    """Between -pi and pi."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
