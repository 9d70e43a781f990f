"""Crossings and flows as tables (CSV). Seconds, metres, where the column says nothing else; empty: not
known."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from typing import Any

from groundpose.traffic import Crossing, Flow
from groundpose.vehicles import CLASSES
from groundpose.world import World

CROSSING_COLUMNS = (
    *("time", "time_sigma", "line", "lane", "direction", "id", "class", "x", "z", "heading_deg"),
    *("speed_kmh", "speed_sigma_kmh", "length", "headway", "spacing"),
)
"""Of the table of crossings, in order; a `World` adds its place."""
FLOW_COLUMNS = (
    *("begin", "end", "line", "lane", "direction", "count", *CLASSES, "other", "flow_per_hour"),
    *("mean_speed_kmh", "mean_speed_sigma_kmh", "speed_deviation_kmh"),
    *("mean_headway", "least_headway", "mean_spacing"),
)
"""Of the table of flows, in order."""
_KMH = 3.6


def crossing_head(world: World | None = None) -> str:
    """The first line of the table of crossings."""
    return ",".join((*CROSSING_COLUMNS, *(() if world is None else world.place_columns))) + "\n"


def crossing_lines(crossings: Iterable[Crossing], world: World | None = None) -> str:
    """A line for each."""
    return _lines(_crossing(crossing, world) for crossing in crossings)


def _crossing(crossing: Crossing, world: World | None) -> Sequence[Any]:
    c = crossing
    placed = () if world is None else world.place_of(c.place).tolist()
    return (
        *(c.time, c.time_sigma, c.line, c.lane, c.direction, c.id, c.name, *c.place, math.degrees(c.heading)),
        *(_KMH * c.speed, _KMH * c.speed_sigma, c.length, c.headway, c.spacing),
        *(f"{value:.9f}" for value in placed),
    )


def flow_head() -> str:
    """The first line of the table of flows."""
    return ",".join(FLOW_COLUMNS) + "\n"


def flow_lines(flows: Iterable[Flow]) -> str:
    """A line for each."""
    return _lines(map(_flow, flows))


def _flow(flow: Flow) -> Sequence[Any]:
    known = [flow.counts.get(name, 0) for name in CLASSES]
    return (
        *(flow.begin, flow.end, flow.line, flow.lane, flow.direction, flow.count),
        *(*known, flow.count - sum(known), flow.flow),
        *(_KMH * speed for speed in (flow.mean_speed, flow.mean_speed_sigma, flow.speed_deviation)),
        *(flow.mean_headway, flow.least_headway, flow.mean_spacing),
    )


def _lines(rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([_plain(value) for value in row] for row in rows)
    return text.getvalue()


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, 6) if math.isfinite(value) else None
    return value
