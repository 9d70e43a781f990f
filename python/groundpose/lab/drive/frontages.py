"""What stands along the sides of a road and in its middle."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Frontage:
    """The things along a section of one side: `line` at the edge of the property, `behind` farther away.

    line, behind: kinds of things, None for nothing; setback: metres from the pavement to the things behind;
    height, depth: of the things behind (a house, trees); top: greatest height of the line.
    """

    line: str | None
    behind: str | None
    setback: tuple[float, float] = (0.0, 0.5)
    height: tuple[float, float] = (6.0, 16.0)
    depth: tuple[float, float] = (8.0, 14.0)
    top: float = 9.0


HOUSES = Frontage(None, "building")
TOWN = Frontage(None, "building", (0.0, 1.0), (10.0, 24.0), (10.0, 16.0))
GARDEN = Frontage("hedge", "building", (4.0, 9.0), (5.5, 10.0))
FENCED = Frontage("fence", "building", (3.0, 8.0), (5.5, 11.0))
WALLED = Frontage("wall", "tree", (2.0, 5.0), (7.0, 14.0))
HEDGED = Frontage("hedge", "tree", (2.0, 6.0), (6.0, 13.0))
GREEN = Frontage("bush", "tree", (2.0, 10.0), (6.0, 16.0))
WOOD = Frontage("tree", "tree", (3.0, 9.0), (8.0, 18.0))
BARRIER = Frontage("barrier", "tree", (3.0, 8.0), (6.0, 14.0))
HALL = Frontage("fence", "building", (6.0, 16.0), (5.0, 9.0), (15.0, 25.0))
OPEN = Frontage(None, None)

# Before a car park: nothing, or what the cars are seen over or through.
LOTS = (
    OPEN, Frontage("fence", None), Frontage("fence", None, top=1.4), Frontage("hedge", None, top=1.3),
    Frontage("wall", None, top=1.2), Frontage("bush", None), Frontage("tree", None),
)  # fmt: skip
# In the middle of a road with two carriageways, with its probability.
MEDIANS: dict[str, dict[str, float]] = {
    "motorway": {"rail": 0.45, "wall": 0.2, "hedge": 0.1, "none": 0.25},
    "avenue": {"fence": 0.25, "hedge": 0.25, "rail": 0.1, "none": 0.4},
}
MEDIAN_TOP = 1.25
"""Greatest height of it, metres: the upper half of an oncoming car stays visible."""

# By kind of road: frontages and their weights.
FRONTAGES: dict[str, tuple[tuple[Frontage, float], ...]] = {
    "street": (
        (HOUSES, 5),
        (TOWN, 3),
        (GARDEN, 4),
        (FENCED, 3),
        (WALLED, 2),
        (HEDGED, 2),
        (GREEN, 1),
        (OPEN, 0.3),
    ),
    "avenue": (
        (TOWN, 4),
        (HOUSES, 2),
        (GREEN, 3),
        (HEDGED, 2),
        (FENCED, 1),
        (HALL, 2),
        (WALLED, 1),
        (OPEN, 1),
    ),
    "country": ((WOOD, 3), (GREEN, 3), (HEDGED, 1), (OPEN, 3), (FENCED, 0.5)),
    "motorway": ((BARRIER, 2), (GREEN, 4), (WOOD, 2), (OPEN, 3)),
    "yard": ((HALL, 4), (HEDGED, 2), (TOWN, 1), (FENCED, 1), (GREEN, 2)),
}
