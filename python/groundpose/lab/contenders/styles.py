"""How figures draw contenders: one colour, line and marker each, the same in every figure.

For the paper's methods colour says what follows a search, the line which search: solid RNSC-P1P, dashed
RNSC-P3P, dotted REPPnP. Colours are those of Okabe and Ito, which colour-blind readers tell apart; markers
repeat what colours say. Ours is red.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

BLACK, GREY = "#000000", "#999999"
RED, BLUE, SKY, ORANGE = "#D00000", "#0072B2", "#56B4E9", "#E69F00"
GREEN, PURPLE, VERMILION, BROWN = "#009E73", "#CC79A7", "#D55E00", "#8C6D00"
Line = str | tuple[int, tuple[int, ...]]


@dataclass(frozen=True)
class Style:
    """Of a curve."""

    colour: str
    line: Line = "-"
    marker: str = ""

    def curve(self) -> dict[str, Any]:
        """As Matplotlib's `plot` takes it."""
        marker = {"marker": self.marker} if self.marker else {}
        return {"color": self.colour, "linestyle": self.line, **marker}


_AFTER_A_SEARCH = {
    "": (BLACK, "o"),
    "GN": (BLUE, "s"),
    "RE": (SKY, "p"),
    "HRE": (BROWN, "*"),
    "EPnP+GN": (SKY, "^"),
    "RPnP": (ORANGE, "v"),
    "ASPnP": (PURPLE, "D"),
    "OPnP+N": (GREEN, "P"),
    "EPPnP": (VERMILION, "X"),
}
_SEARCHES = {"RNSC-P1P": "-", "RNSC-UP2P": "-.", "RNSC-P3P": "--", "REPPnP": ":"}
_DOTTED, _DASHED = (0, (1, 1)), (0, (5, 1, 1, 1))
STYLES: dict[str, Style] = {
    "oracle 6-DoF": Style(GREY, _DOTTED),
    "oracle 4-DoF": Style(GREY, _DASHED),
    "ours, default": Style(RED, "-", "o"),
    "ours, 2 threads": Style(RED, ":", "o"),
    "ours, default, score >= 0.1": Style(RED, ":", "h"),
    "ours, no priors": Style(RED, "--", "s"),
    "ours, UP2P search": Style(BLACK, "--", "v"),
    **{
        f"{search}+{after}" if after else search: Style(colour, line, marker)
        for search, line in _SEARCHES.items()
        for after, (colour, marker) in _AFTER_A_SEARCH.items()
    },
    "PoseLib tuned": Style(BLUE, "-", "s"),
    "PoseLib tuned, score >= 0.1, threshold x 4": Style(BLUE, "--", "X"),
    "PoseLib": Style(SKY, "--", "s"),
    "OpenCV EPNP + LM": Style(ORANGE, "-", "^"),
    "OpenCV P3P + LM": Style(GREEN, "-", "v"),
    "OpenCV USAC MAGSAC + LM": Style(PURPLE, "-", "P"),
    "OpenCV USAC ACCURATE + LM": Style(PURPLE, "--", "X"),
    "OpenCV SQPNP + LM": Style(ORANGE, ":", "D"),
    "pycolmap": Style(VERMILION, "-.", "o"),
}
"""By the contender's name, in the order of legends."""
_UNKNOWN = Style(GREY, "-", ".")


def in_legend_order(names: Iterable[str]) -> list[str]:
    """As in the table; what is not in it comes last."""
    order = list(STYLES)
    return sorted(names, key=lambda name: order.index(name) if name in STYLES else len(order))


def style_of(name: str) -> Style:
    """Grey for one that has none of its own."""
    return STYLES.get(name, _UNKNOWN)
