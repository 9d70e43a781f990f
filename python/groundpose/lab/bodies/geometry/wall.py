"""The upright outer surface of a body: an outline seen from above, inset by a profile at every height.

A wall is a smooth function of `u`, the length along the outline from the middle of the front over the right
side to the middle of the rear (metres), and `h`, the height above the ground. Lamps, grilles, plates and
seams are slabs on it; the shell of the body is a grid of its points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.loft import Table, along
from groundpose.lab.bodies.geometry.mesh import cross, unit

Profile = tuple[FloatArray | list[float], FloatArray | list[float]]
"""Heights above the ground, increasing, and the inset at each, metres."""

# Points of the sampled outline; between them it is straight (2 cm on a car).
_SAMPLES = 241

# Heights at which the inset profiles are tabulated, metres.
_HEIGHTS = np.linspace(0.0, 4.2, 841)

# Step of the differences that give normals, metres.
_STEP = 2e-3


@dataclass(eq=False)
class Wall:
    """See the module.

    Args:
        outline: (K, 2) control points `[x, z]` from (0, front) over the right side to (0, rear); the outline
            is their uniform quadratic B-spline, so it rounds every corner and touches the middle of each leg.
            z must fall along it.
        front, side, rear: inset profiles of the three faces; round the corners they fade into each other.
        bulge: extra metres outward as a function of (points (..., 2) `[x, z]` of the outline, heights (...)).
    """

    outline: FloatArray
    front: Profile
    side: Profile
    rear: Profile
    bulge: Callable[[FloatArray, FloatArray], FloatArray] | None = None
    _u: FloatArray = field(init=False)
    _plan: FloatArray = field(init=False)
    _outline: Table = field(init=False)  # of u: x, z and the normal's x, z
    _insets: Table = field(init=False)  # of the height: side, front, rear

    def __post_init__(self) -> None:
        """Sample the outline."""
        plan = quadratic_spline(self.outline, _SAMPLES)
        plan[[0, -1], 0] = 0.0
        tangent = np.gradient(plan, axis=0)
        normal = unit(np.stack([-tangent[:, 1], tangent[:, 0]], axis=1))
        normal[0], normal[-1] = (0.0, 1.0), (0.0, -1.0)
        lengths = np.hypot(*np.diff(plan, axis=0).T)
        self._u, self._plan = np.concatenate([[0.0], np.cumsum(lengths)]), plan
        even = np.linspace(0.0, self.length, 2 * _SAMPLES)
        columns = [np.interp(even, self._u, column) for column in (*plan.T, *normal.T)]
        self._outline = Table(0.0, float(even[1]), np.stack(columns, axis=1))
        insets = [
            along(np.asarray(p[1]), np.asarray(p[0]), _HEIGHTS) for p in (self.side, self.front, self.rear)
        ]
        self._insets = Table(0.0, float(_HEIGHTS[1]), np.stack(insets, axis=1))

    @property
    def length(self) -> float:
        """u of the middle of the rear."""
        return float(self._u[-1])

    def z_at_u(self, u: object) -> FloatArray:
        """z of the outline at u."""
        return np.asarray(self._outline(u)[..., 1])

    def u_at_z(self, z: object) -> FloatArray:
        """u where the outline passes z."""
        return np.interp(-np.asarray(z, dtype=np.float64), -self._plan[:, 1], self._u)

    def u_at_x(self, x: object, rear: bool = False) -> FloatArray:
        """u where the front (or rear) of the outline, before its widest point, passes x."""
        widest = int(np.argmax(self._plan[:, 0]))
        part = slice(len(self._plan), widest, -1) if rear else slice(0, widest + 1)
        return np.interp(np.asarray(x, dtype=np.float64), self._plan[part, 0], self._u[part])

    def points(self, u: object, h: object) -> FloatArray:
        """Points (..., 3) of the body frame at u and h, broadcast together; beyond the middle of the front
        (u < 0) and of the rear (u > length) lies the left side."""
        u, h = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(h, dtype=np.float64))
        left = np.where((u < 0.0) | (u > self.length), -1.0, 1.0)
        u = np.where(u < 0.0, -u, np.where(u > self.length, 2.0 * self.length - u, u))
        outline = self._outline(u)
        plan, normal = outline[..., :2], unit(outline[..., 2:])
        # Inset along x by the side's profile and along z by the front's; both fade round the corners.
        side, front, rear = np.moveaxis(self._insets(h), -1, 0)
        inset = np.stack([side, np.where(normal[..., 1] > 0.0, front, rear)], axis=-1)
        if self.bulge is not None:
            inset -= self.bulge(plan, h)[..., None]
        plan = plan - inset * normal
        return np.stack([left * plan[..., 0], -h, plan[..., 1]], axis=-1)

    def normals(self, u: object, h: object) -> FloatArray:
        """Outward unit normals (..., 3), by central differences."""
        u, h = np.asarray(u, dtype=np.float64), np.asarray(h, dtype=np.float64)
        u, h = np.broadcast_arrays(u, h)
        ahead, behind, over, under = self.points(
            np.stack([u + _STEP, u - _STEP, u, u]), np.stack([h, h, h + _STEP, h - _STEP])
        )
        return unit(cross(over - under, ahead - behind))


def quadratic_spline(control: FloatArray, samples: int) -> FloatArray:
    """Uniform quadratic B-spline (samples, D) through the first and last control point (ends doubled)."""
    control = np.asarray(control, dtype=np.float64)
    middle = 0.5 * (control[1:-2] + control[2:-1])
    joints = np.concatenate([control[:1], middle, control[-1:]])
    pieces = len(control) - 2
    t = np.linspace(0.0, pieces, samples)
    i = np.minimum(t.astype(int), pieces - 1)
    s = (t - i)[:, None]
    return np.asarray(joints[i] * (1 - s) ** 2 + control[1:-1][i] * 2 * s * (1 - s) + joints[i + 1] * s**2)
