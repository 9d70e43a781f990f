"""Wheels: a tyre, and a rim whose spokes and openings are one grid in polar coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.loft import grid_faces, lathe
from groundpose.lab.bodies.geometry.mesh import ByteArray, Component, component
from groundpose.lab.bodies.parts.materials import MATERIAL


class Rim(NamedTuple):
    """A rim design; lengths along the spoke are fractions of the rim's radius.

    Args:
        spokes: number of spokes (or of webs between the holes of a cover).
        inner, outer: fraction of the circle that spokes cover at the inner and outer end of the openings.
        hole_in, hole_out: where the openings start and end.
        dish: distance of the hub behind the lip, metres (negative: in front of it).
        twist: angle by which the spokes turn from hub to lip, radians.
        twin: fraction of each spoke's width that is open in the middle; 0: solid.
    """

    spokes: int
    inner: float
    outer: float
    hole_in: float = 0.30
    hole_out: float = 0.90
    dish: float = 0.02
    twist: float = 0.0
    twin: float = 0.0


CAR_RIMS: tuple[Rim, ...] = (
    Rim(5, 0.60, 0.36),
    Rim(5, 0.72, 0.52, twin=0.42),
    Rim(7, 0.58, 0.34),
    Rim(9, 0.56, 0.34, dish=0.03),
    Rim(8, 0.66, 0.42, twist=0.25),
    Rim(6, 0.62, 0.40, hole_in=0.34),
    Rim(8, 0.70, 0.58, hole_in=0.46, hole_out=0.82, dish=0.0),
    Rim(10, 0.62, 0.62, hole_in=0.62, hole_out=0.80, dish=-0.01),
    Rim(5, 0.74, 0.66, hole_in=0.40, hole_out=0.86, twist=0.35),
)
"""Rims of cars: light alloy, then covers of steel wheels."""

FIRST_COVER = 6
"""The first row of `CAR_RIMS` that is a cover."""

STEEL_RIMS: tuple[Rim, ...] = (
    Rim(8, 0.70, 0.60, hole_in=0.66, hole_out=0.80, dish=0.05),
    Rim(10, 0.66, 0.58, hole_in=0.62, hole_out=0.78, dish=0.09),
    Rim(12, 0.60, 0.55, hole_in=0.68, hole_out=0.80, dish=0.02),
)
"""Steel wheels of vans, trucks and buses."""

_TYRE_SEGMENTS = 19


def wheel(
    radius: float, width: float, rim_radius: float, rim: Rim, phase: float = 0.0, hub_cap: str = "chrome"
) -> list[Component]:
    """Tyre and rim about the origin, axis x, the outer face towards +x (mirror it for the left side).

    Args:
        radius, width: of the tyre, metres.
        rim_radius: radius of the bead.
        phase: rotation angle of the wheel, radians.
        hub_cap: material of the cap in the middle.
    """
    return [
        part.turned("x", phase)
        for part in (_tyre(radius, width, rim_radius), _rim(width, rim_radius, rim, hub_cap))
    ]


def hub_x(width: float, rim: Rim) -> float:
    """x of the middle of the outer face, relative to the middle of the wheel."""
    return 0.44 * width - rim.dish + _CAP_RISE


def place_wheels(wheels: FloatArray, outer: list[Component]) -> list[Component]:
    """Copies of one wheel at centres (W, 4) `[x, y, z, radius]`, those at x < 0 mirrored."""
    return [
        (part if x > 0.0 else part.mirrored()).moved(x, y, z)
        for x, y, z, _ in wheels.tolist()
        for part in outer
    ]


_CAP_RISE = 0.006


def _tyre(radius: float, width: float, bead: float) -> Component:
    wall, half = radius - bead, 0.5 * width
    shoulder = min(0.022, 0.35 * wall)
    right = [
        (0.86 * half, radius),
        (0.955 * half, radius - shoulder),
        (half, bead + 0.45 * wall),
        (0.92 * half, bead - 0.006),
    ]
    profile = np.array([(-x, r) for x, r in right[::-1]] + right)
    return lathe(profile, _TYRE_SEGMENTS, MATERIAL["tyre"], crease_deg=50.0, closed=True)


def _rim(width: float, bead: float, rim: Rim, hub_cap: str) -> Component:
    """Rings of points from the back over the lip and the spokes to the cap in the middle."""
    angle, open_ = _spoke_angles(rim)
    face, deep = 0.44 * width, -0.12 * width
    hub = face - rim.dish
    start, end = rim.hole_in, rim.hole_out
    rings = [  # fraction of the radius, x of spokes, x of openings
        (0.99, -0.43 * width, -0.43 * width),
        (1.01, 0.46 * width, 0.46 * width),
        (0.965, 0.47 * width, 0.47 * width),
        (min(0.945, end + 0.03), face - 0.008, face - 0.008),
        (end, face - 0.010, deep),
        (start, hub, deep),
        (start - 0.03, hub, hub),
        (0.16, hub + _CAP_RISE, hub + _CAP_RISE),
    ]
    fraction, solid, hole = np.array(rings).T
    x = np.where(open_[None, :], hole[:, None], solid[:, None])
    turn = _turned(rim, angle, fraction)
    points = np.stack(
        [x, bead * fraction[:, None] * np.cos(turn), bead * fraction[:, None] * np.sin(turn)], axis=-1
    )
    return _closed_disc(points, _rim_paint(fraction, open_, rim, hub_cap))


def _turned(rim: Rim, angle: FloatArray, fraction: FloatArray) -> FloatArray:
    """Angles (rings, samples): spokes narrow from `inner` to `outer` and twist on their way out."""
    way = np.clip((fraction - rim.hole_in) / (rim.hole_out - rim.hole_in), 0.0, 1.0)[:, None]
    pitch = 2.0 * np.pi / rim.spokes
    cover = rim.inner + (rim.outer - rim.inner) * way
    spoke = np.floor(angle / pitch + 0.499)
    local = (
        angle / pitch - spoke
    )  # -0.5 to 0.5; |local| < 0.25 is the spoke before it is stretched to its cover
    inside = np.abs(local) <= 0.25
    stretched = np.where(
        inside,
        local * (2.0 * cover),
        np.sign(local) * (0.5 * cover + (np.abs(local) - 0.25) * 2.0 * (1.0 - cover)),
    )
    return np.asarray((spoke + stretched) * pitch + rim.twist * way)


def _spoke_angles(rim: Rim) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Angles of the samples and whether each is over an opening; a spoke covers |local| < 0.25 of a pitch."""
    locals_ = [(-0.275, True), (-0.25, False), (0.25, False), (0.275, True)]
    if rim.twin > 0.0:
        gap = 0.25 * rim.twin
        locals_[2:2] = [(-gap - 0.02, False), (-gap, True), (gap, True), (gap + 0.02, False)]
    elif rim.spokes < 7:  # a rounder lip
        locals_ = [*locals_[:2], (0.0, False), *locals_[2:], (0.5, True)]
    pitch = 2.0 * np.pi / rim.spokes
    angle = np.concatenate(
        [(spoke + np.array([a for a, _ in locals_])) * pitch for spoke in range(rim.spokes)]
    )
    return angle, np.tile([is_open for _, is_open in locals_], rim.spokes)


def _rim_paint(fraction: FloatArray, open_: NDArray[np.bool_], rim: Rim, hub_cap: str) -> ByteArray:
    """Materials (rings - 1, samples): dark where both ends of a cell lie in an opening."""
    paint = np.full((len(fraction) - 1, len(open_)), MATERIAL["rim"], dtype=np.uint8)
    both = open_ & np.roll(open_, -1)
    within = (fraction[1:] > rim.hole_in - 0.001) & (fraction[:-1] < rim.hole_out - 0.001)
    paint[np.ix_(within, both)] = MATERIAL["underbody"]
    paint[-1] = MATERIAL[hub_cap]
    return paint


def _closed_disc(points: FloatArray, paint: ByteArray) -> Component:
    """Rings (N, M, 3) about the x axis closed by discs at both ends."""
    n, m = points.shape[:2]
    wrapped = np.concatenate([points, points[:, :1]], axis=1)
    centres = np.zeros((2, 3))
    centres[:, 0] = points[0, 0, 0], points[-1, 0, 0]
    ring = np.arange(m)
    last = ring + (n - 1) * (m + 1)
    grid = grid_faces(n, m + 1)[:, ::-1]
    back = np.stack([np.full(m, n * (m + 1)), ring + 1, ring], axis=1)
    cap = np.stack([np.full(m, n * (m + 1) + 1), last, last + 1], axis=1)
    materials = np.concatenate([np.repeat(paint.ravel(), 2), np.full(m, MATERIAL["underbody"]), paint[-1]])
    return component(
        np.concatenate([wrapped.reshape(-1, 3), centres]), np.concatenate([grid, back, cap]), materials, 35.0
    )
