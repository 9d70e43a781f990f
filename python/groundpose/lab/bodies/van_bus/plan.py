"""Layout of a van or bus, drawn once per body and read by shell, paint, keypoints and fittings."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.common import PLATE_RISE
from groundpose.lab.bodies.dimensions import Dimensions, draw_dimensions
from groundpose.lab.bodies.outlines import Level
from groundpose.lab.bodies.parts.wheels import STEEL_RIMS, Rim

CLASS = "van_bus"


@dataclass(frozen=True)
class Window:
    """A pane of the side: z of both ends, levels, sides; `sharp` leaves its corners square."""

    front: float
    rear: float
    levels: tuple[str, str] = ("belt", "top")
    sides: str = "both"
    sharp: bool = False


@dataclass
class Plan:
    """Lengths in metres, heights above the ground; positions on front and rear run from 0 (middle) to 1."""

    style: str
    dimensions: Dimensions
    bus: bool
    heights: dict[str, float] = field(default_factory=dict)
    fronts: tuple[list[float], list[float]] = field(default_factory=lambda: ([], []))
    top_fraction: float = 1.0  # half width at the window top over that at the belt
    corner: tuple[float, float] = (0.2, 0.2)
    bow: float = 0.1
    nose: float = 1.0
    crown: float = 0.04
    eave: float = 0.12
    hull_height: float = 0.0
    lean: float = 0.0
    arch: float = 0.4
    front_stretch: float = 0.0
    windows: list[Window] = field(default_factory=list)
    seams: list[float] = field(default_factory=list)
    seam_top: str = "belt"
    screen_step: int = 2
    lamp_inner: float = 0.66
    lamp_step: int = 2
    lamp_top: str = "lamp_high"
    grille: float = 0.66
    tall_grille: bool = False
    tail: tuple[str, str] = ("lamp_high", "belt")
    tail_middle: str = "screen"
    tail_step: int = 2
    tail_inner: float = 0.94
    rear_glass: float = 0.8
    rear_glass_top: str = "top"
    rear_plate: str = "lamp_mid"
    split_rear: bool = False
    band: bool = False
    mask: str = ""
    display: bool = False
    two_tone: tuple[str, str] | None = None
    plastic_bumpers: bool = False
    tyre_width: float = 0.2
    twin: bool = False
    front_rim: Rim = STEEL_RIMS[0]
    rear_rim: Rim = STEEL_RIMS[0]
    seats: tuple[float, ...] = ()
    strip: bool = False
    engine_grille: bool = False

    @property
    def well(self) -> float:
        """Half width between the inner walls of the wheel wells."""
        return 0.5 * self.dimensions.width - (2.4 if self.twin else 1.35) * self.tyre_width - 0.06


def wheel_centres(p: Plan) -> FloatArray:
    """(4, 4) centre and radius of the outer wheels: front right, front left, rear right, rear left."""
    d = p.dimensions
    x = 0.5 * d.width - 0.5 * p.tyre_width - (0.06 if p.bus else 0.03)
    return np.array(
        [[s * x, -d.wheel_radius, z, d.wheel_radius] for z in (d.front_axle, d.rear_axle) for s in (1, -1)]
    )


def levels(p: Plan) -> list[Level]:
    """The outlines from the bottom up."""
    d = p.dimensions
    half, low, high = 0.5 * d.width, p.heights["belt"], p.hull_height - p.crown
    rows = []
    names = sorted(p.heights, key=lambda name: p.heights[name])
    for name in names:
        h = p.heights[name]
        fraction = min(max((h - low) / (p.heights["top"] - low), 0.0), 1.3)
        narrow = 1.0 - (1.0 - p.top_fraction) * fraction**1.3
        tuck = {"skirt": 0.975, "sill": 0.992}.get(name, 1.0)
        # A plate's face is the rearmost point.
        rear = -0.5 * d.length + PLATE_RISE + (0.03 if name == "skirt" else p.lean * fraction)
        rows.append(_level(p, name, h, half * narrow * tuck, float(np.interp(h, *p.fronts)), rear))
    top = rows[-1]
    for name, inset, drop in (("eave_low", 0.0, 1.0), ("eave", 0.26, 0.32), ("roof", 1.0, 0.0)):
        narrow = 1.0 - (1.0 - p.top_fraction) * (high - drop * p.eave - low) / (p.heights["top"] - low)
        front = float(np.interp(high - drop * p.eave, *p.fronts)) - 1.2 * inset * p.eave
        width = half * narrow - inset * p.eave
        rows.append(_level(p, name, high - drop * p.eave, width, front, top.rear + inset * p.eave))
    return rows


def _level(p: Plan, name: str, height: float, half: float, front: float, rear: float) -> Level:
    fx, fz = p.corner
    rear_corner = (0.22, 0.16) if p.bus else (0.11, 0.11)
    return Level(name, height, half, front, rear, (fx, fz), rear_corner, p.bow, 0.03, nose=p.nose)


def plan(style: str, rng: np.random.Generator) -> Plan:
    """All choices of one body."""
    p = Plan(style, draw_dimensions(CLASS, style, rng), style in ("city_bus", "coach"))
    p.hull_height = p.dimensions.height
    _heights(p, rng)
    if p.bus:
        _bus(p, rng)
    else:
        _van(p, rng)
    return p


def _heights(p: Plan, rng: np.random.Generator) -> None:
    """Heights of the levels below the eaves."""
    d, u = p.dimensions, rng.uniform
    if p.style == "city_bus":
        screen, belt, top = (
            u(0.88, 1.02),
            max(u(1.06, 1.2), 2 * d.wheel_radius + 0.15),
            0.775 * d.height + u(-0.03, 0.05),
        )
        lamp, size, plate = u(0.58, 0.68), u(0.17, 0.24), 0.42
    elif p.style == "coach":
        screen, belt, top = u(1.18, 1.38), u(1.62, 1.85), 0.835 * d.height + u(-0.03, 0.05)
        lamp, size, plate = u(0.62, 0.78), u(0.2, 0.3), 0.45
    else:
        belt = 0.90 + 0.13 * d.height + u(-0.03, 0.03)
        screen, top = belt - u(0.04, 0.08), 1.20 + 0.27 * d.height + u(-0.03, 0.03)
        lamp, size, plate = u(0.64, 0.72), u(0.17, 0.24), 0.43
    h = {"skirt": d.clearance, "sill": d.clearance + 0.09, "plate": plate, "bumper": lamp - 0.05}
    h |= {
        "bumper_gap": lamp - 0.042,
        "lamp_low": lamp,
        "lamp_mid": lamp + 0.5 * size,
        "lamp_high": lamp + size,
    }
    if not p.bus:
        step = (screen - lamp - size) / 3
        h |= {"lid": lamp + size + 0.008, "bonnet_1": lamp + size + step, "bonnet_2": lamp + size + 2 * step}
    h |= {"screen": screen, "belt": belt, "belt_cut": belt + 0.06, "top_cut": top - 0.06, "top": top}
    p.heights = h


def _van(p: Plan, rng: np.random.Generator) -> None:
    d, h = p.dimensions, p.heights
    u, nose = rng.uniform, 0.5 * d.length
    cowl, slope = nose - u(0.52, 0.80), u(0.82, 1.05)
    top = cowl - slope * (h["top"] - h["screen"])
    roof = p.hull_height
    edge = [
        h["skirt"],
        h["plate"],
        h["bumper"],
        h["lamp_low"],
        h["lamp_mid"],
        h["lamp_high"],
        h["bonnet_1"],
        h["bonnet_2"],
    ]
    at = [
        nose - 0.05,
        nose - 0.012,
        nose,
        nose - 0.012,
        nose - 0.04,
        nose - 0.09,
        nose - 0.09 - 0.3 * (nose - cowl),
        0.0,
    ]
    at[-1] = 0.45 * at[-2] + 0.55 * cowl
    p.fronts = ([*edge, h["screen"], h["top"], roof], [*at, cowl, top, top - 0.9 * slope * (roof - h["top"])])
    p.top_fraction, p.corner, p.bow, p.nose = (
        u(0.90, 0.945),
        (u(0.2, 0.28), u(0.16, 0.22)),
        u(0.08, 0.13),
        u(0.95, 0.98),
    )
    p.crown, p.eave, p.lean = 0.035, min(0.13, 0.5 * (roof - 0.035 - h["top"])), u(0.03, 0.1)
    p.arch = d.wheel_radius + u(0.05, 0.075)
    p.front_stretch = d.front_axle - p.arch - 0.06
    pillar = p.front_stretch - u(0.85, 1.0)
    start = nose - 0.3
    p.windows = [Window(start - 0.13 * (start - p.front_stretch), pillar, sharp=True)]
    rear = -nose + u(0.2, 0.35)
    glazed = p.style == "minibus" or rng.random() < 0.4
    if glazed:
        panes = max(1, round((pillar - rear) / (1.35 if p.style == "van" else 1.15)))
        edges = np.linspace(pillar - 0.07, rear + 0.07, panes + 1)
        p.windows += [Window(a - 0.035, b + 0.035) for a, b in pairwise(edges.tolist())]
    p.band = bool(glazed and rng.random() < 0.5)
    p.seams = [p.front_stretch + 0.01, pillar - 0.035, max(pillar - u(1.0, 1.2), d.rear_axle + p.arch + 0.02)]
    p.split_rear = bool(rng.random() < 0.6)
    p.tall_grille = bool(rng.random() < 0.3)
    p.lamp_step = int(rng.integers(2, 4))
    p.screen_step, p.tail_step = 2, 2
    p.plastic_bumpers = bool(rng.random() < (0.5 if p.style == "van" else 0.3))
    p.two_tone = ("plate", "bumper") if rng.random() < 0.12 else None
    p.tyre_width, p.rear_plate = 0.215, "lamp_high"
    rims = STEEL_RIMS[int(rng.integers(len(STEEL_RIMS)))]
    p.front_rim = p.rear_rim = rims
    p.strip = bool(rng.random() < 0.45)
    p.lamp_inner, p.grille = (
        (0.82, 0.66) if rng.random() < 0.4 else (0.66, 0.4 if rng.random() < 0.3 else 0.66)
    )
    p.lamp_top = "bonnet_1" if rng.random() < 0.35 else "lamp_high"
    if glazed:
        p.seats = tuple(float(z) for z in np.arange(pillar - 0.55, rear + 0.5, -0.85))


def _bus(p: Plan, rng: np.random.Generator) -> None:
    d, h = p.dimensions, p.heights
    u, nose, coach = rng.uniform, 0.5 * d.length, p.style == "coach"
    lean = u(0.25, 0.5) if coach else u(0.05, 0.22)
    p.hull_height = d.height - (0.0 if coach and rng.random() < 0.5 else u(0.12, 0.2))
    fraction = np.linspace(0.0, 1.0, 7)
    top = p.hull_height
    p.fronts = (
        [h["skirt"], h["plate"], h["bumper"], *(h["screen"] + fraction * (top - h["screen"]))],
        [nose - 0.03, nose - 0.012, nose, *(nose - 0.01 - lean * fraction**1.8)],
    )
    p.top_fraction, p.bow = u(0.965, 0.99), u(0.12, 0.2) if coach else u(0.05, 0.14)
    p.corner = (u(0.3, 0.5), u(0.2, 0.34)) if coach else (u(0.18, 0.34), u(0.14, 0.26))
    p.crown, p.eave = 0.05, min(u(0.14, 0.24), 0.6 * (top - 0.05 - h["top"]))
    p.display = not coach or bool(rng.random() < 0.25)
    if p.display:
        space = top - p.crown - p.eave - h["top"]
        h |= {"display_low": h["top"] + 0.15 * space, "display_high": h["top"] + 0.9 * space}
    p.lean, p.arch = 0.02, d.wheel_radius + u(0.06, 0.09)
    p.front_stretch = d.front_axle + p.arch + 0.12
    door = p.front_stretch + 0.04
    start = nose - p.bow - p.corner[1] - 0.08
    low = "screen" if coach else "bumper"
    p.windows = [Window(start, door, sides="left"), Window(start, door, (low, "top"), "right")]
    rear = -nose + u(0.35, 0.7)
    panes = round((door - rear) / u(1.3, 1.65))
    edges = np.linspace(door - 0.05, rear, panes + 1)
    p.windows += [Window(a - 0.04, b + 0.04) for a, b in pairwise(edges.tolist())]
    p.seams = [door, start + 0.03]
    if coach:
        p.seams += [float(z) for z in np.linspace(d.front_axle - p.arch - 0.1, d.rear_axle + p.arch + 0.1, 4)]
    else:
        middle = panes // 2
        p.windows.append(Window(edges[middle] - 0.05, edges[middle + 1] + 0.05, ("bumper", "top"), "right"))
    p.seam_top = "belt"
    p.band, p.mask = bool(rng.random() < 0.75), "lamp_high" if rng.random() < 0.6 else ""
    p.screen_step, p.tail_step, p.lamp_step = 3, 2, 2
    p.grille, p.lamp_inner = 0.4, 0.66
    p.tail, p.tail_middle = ("lamp_low", "screen"), "lamp_high"
    p.rear_glass, p.rear_plate, p.tail_inner, p.engine_grille = 0.8, "bumper", 0.8, bool(rng.random() < 0.6)
    p.two_tone = [None, ("skirt", "belt"), ("skirt", "bumper"), ("lamp_high", "belt")][int(rng.integers(4))]
    p.tyre_width, p.twin = 0.29, True
    p.front_rim = Rim(10, 0.66, 0.6, hole_in=0.62, hole_out=0.78, dish=-0.03)
    p.rear_rim = Rim(10, 0.62, 0.56, hole_in=0.64, hole_out=0.8, dish=0.13)
    p.seats = tuple(float(z) for z in np.arange(door - 0.9, rear + 0.4, -0.82))
