"""What looks wrong in the input of one image, from the poses of all its objects."""

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


def tilt_remarks(view: View, R: FloatArray, covariance: FloatArray) -> tuple[str, ...]:
    """Whether objects that should stand on the ground disagree with the nominal tilt.

    The lean of every object is known with the standard deviations of its covariance, and objects themselves
    lean by 1.5 degrees. Most must lean the same way, by more than chance.

    Args:
        view: with the nominal tilt.
        R: (N, 3, 3) of the objects with a pose.
        covariance: (N, 6, 6) of their poses; NaN: the objects' own lean alone.

    Returns:
        One sentence for each of pitch and roll that is off, or none.
    """
    down, nominal = R[:, :, 1], view.R_camera_from_ground[:, 1]
    if len(down) < FEWEST_OBJECTS:
        return ()
    same = _angles(down[:, None], down[None]) < SAME_LEAN
    group = same[np.argmax(same.sum(axis=1))]
    count = int(group.sum())
    if count < max(FEWEST_OBJECTS, LEAST_AGREEMENT * len(down)):
        return ()
    mean = down[group].sum(axis=0)
    mean /= np.linalg.norm(mean)
    # the rotation about the axis itself does not move it: with it, this is too much rather than too little
    stated = np.nan_to_num(np.trace(covariance[group, :3, :3], axis1=1, axis2=2))
    variances = stated + 2.0 * OBJECT_LEAN**2
    off = float(_angles(mean, nominal))
    if off < max(LEAST_TILT, MOST_SIGMAS * float(np.sqrt(variances.sum())) / count):
        return ()
    return _sentences(view, mean)


def _angles(a: FloatArray, b: FloatArray) -> FloatArray:
    """Radians between unit vectors along the last axis."""
    return np.asarray(np.arccos(np.clip((a * b).sum(axis=-1), -1.0, 1.0)))


def _sentences(view: View, down: FloatArray) -> tuple[str, ...]:
    if (down * view.R_camera_from_ground[:, 1]).sum() < 0.0:
        return ("the vehicles stand upside down: the image may be turned by half a turn",)
    seen = View.from_gravity(view.camera, down)
    angles = {"pitch": seen.pitch - view.pitch, "roll": seen.roll - view.roll}
    degrees = {
        name: abs(np.degrees((angle + np.pi) % (2.0 * np.pi) - np.pi)) for name, angle in angles.items()
    }
    most = max(degrees.values())
    return tuple(
        f"the vehicles disagree with the nominal {name} by {angle:.0f} deg"
        for name, angle in degrees.items()
        if np.radians(angle) >= LEAST_TILT or angle == most
    )
