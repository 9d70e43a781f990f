"""What a boxy vehicle's shell is made from: horizontal outlines, the columns round them, wheel arches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray

_Pair = tuple[float, float]


@dataclass(frozen=True)
class Level:
    """One horizontal outline, metres.

    Args:
        name: by which it is looked up; unique in a shell.
        height: above the ground along the sides.
        half_width: of the widest part.
        front, rear: z of the outline on the middle plane.
        front_corner, rear_corner: radii across and along of the rounded corners.
        front_bow, rear_bow: distance of the corner behind (before) the middle.
        front_height: height at the front end, if not that of the sides.
        nose: half width at the front corner as a fraction of `half_width`.
    """

    name: str
    height: float
    half_width: float
    front: float
    rear: float
    front_corner: _Pair = (0.1, 0.1)
    rear_corner: _Pair = (0.1, 0.1)
    front_bow: float = 0.0
    rear_bow: float = 0.0
    front_height: float | None = None
    nose: float = 1.0


@dataclass(frozen=True)
class Columns:
    """Places of the columns, from the middle of the front to the middle of the rear.

    Args:
        front, rear: positions between the middle (0) and the corner (1), increasing.
        side: z of the columns on the side, decreasing; they hold where no level is stretched.
        front_stretch, rear_stretch: z before (behind) which the side follows the front (rear) of each level.
        corner: cells of each rounded corner.
    """

    front: FloatArray
    side: FloatArray
    rear: FloatArray
    front_stretch: float
    rear_stretch: float
    corner: int = 4

    def at_front(self, position: float) -> int:
        """Column on the front nearest to `position`; 1 is the start of the corner."""
        return int(np.argmin(np.abs(self.front - position)))

    def at_front_corner(self, step: int) -> int:
        """Column `step` cells round the front corner."""
        return len(self.front) - 1 + step

    def at_side(self, z: float) -> int:
        """Column on the side nearest to `z`."""
        return len(self.front) - 1 + self.corner + int(np.argmin(np.abs(self.side - z)))

    def at_rear_corner(self, step: int) -> int:
        """Column `step` cells round the rear corner, counted from the rear side as at the front."""
        return len(self.front) + len(self.side) - 2 + 2 * self.corner - step

    def at_rear(self, position: float) -> int:
        """Column on the rear nearest to `position`; 1 is the start of the corner."""
        return self.count - 1 - int(np.argmin(np.abs(self.rear - position)))

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.front) + len(self.side) + len(self.rear) - 2 + 2 * self.corner


@dataclass(frozen=True)
class Arch:
    """A wheel arch cut into the lower edge of the side."""

    z: float
    radius: float
    height: float  # of the wheel's centre

    def columns(self, steps: int = 8) -> FloatArray:
        """z of the columns that draw the arch, decreasing."""
        return self.z + self.radius * np.cos(np.linspace(0.0, np.pi, steps + 1))

    def edge(self, z: FloatArray) -> FloatArray:
        """Height of the arch at z; minus infinity beside it."""
        inside = self.radius**2 - (z - self.z) ** 2
        # The outermost columns stand on the lower edge of the body.
        return np.where(inside > 1e-6, self.height + np.sqrt(np.maximum(inside, 0.0)), -np.inf)
