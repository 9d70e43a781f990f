"""Contact sheets: one tile per object, for the worst cases or any others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from groundpose._checks import input_error
from groundpose.draw.colours import GRID, PAPER
from groundpose.draw.overlay import checked_image, draw_object, show
from groundpose.draw.picture import check_path
from groundpose.draw.save import save_figure
from groundpose.poses import PoseBatch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DPI = 100
# Width and height of a tile, of the strip with its title, pixels.
_TILE, _TITLE, _GAP = (300, 225), 22, 6
# Fraction of the box's sides that is shown around it.
_MARGIN = 0.25


@dataclass(frozen=True, eq=False)
class Tile:
    """Object `index` of `poses` over its image (H, W, 3), and what to say of it."""

    image: ArrayLike | None
    poses: PoseBatch
    index: int
    title: str = ""


def contact_sheet(tiles: Sequence[Tile], path: str | PathLike[str] | None = None, columns: int = 6) -> Figure:
    """Crops around the 2D boxes of objects with what was estimated, in the order given.

    Args:
        tiles: the objects; those without a 2D box show the whole image.
        path: where to write the picture, if anywhere.
        columns: tiles in a row.

    Raises:
        InputError: no tiles, or a picture that cannot be; see `draw_overlay`.
    """
    from matplotlib.figure import Figure

    if not tiles:
        raise input_error("tiles", "at least one", "none")
    if path is not None:
        check_path(path)
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    step = (_TILE[0] + _GAP, _TILE[1] + _TITLE + _GAP)
    width, height = columns * step[0] + _GAP, rows * step[1] + _GAP
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=PAPER)
    for number, tile in enumerate(tiles):
        row, column = divmod(number, columns)
        left, bottom = _GAP + column * step[0], height - (row + 1) * step[1]
        place = (left / width, bottom / height, _TILE[0] / width, _TILE[1] / height)
        axes = figure.add_axes(place, facecolor=GRID)
        _draw(axes, tile)
        axes.set_title(tile.title, fontsize=9, pad=3.0, loc="left")
    if path is not None:
        save_figure(figure, path, _DPI)
    return figure


def _draw(axes: Axes, tile: Tile) -> None:
    pixels = show(axes, checked_image(tile.image, tile.poses))
    bbox = tile.poses.bboxes[tile.index]
    if not np.isfinite(bbox).all():
        height, width = pixels.shape[:2]
        bbox = np.array([0.0, 0.0, width - 1.0, height - 1.0])
    middle, half = 0.5 * (bbox[:2] + bbox[2:]), (0.5 + _MARGIN) * np.maximum(bbox[2:] - bbox[:2], 1.0)
    half = (half / _TILE).max() * np.array(_TILE)
    axes.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] + half[1], middle[1] - half[1]))
    draw_object(axes, tile.poses, tile.index, labelled=False)
