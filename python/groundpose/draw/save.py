"""Figures become files: whole ones, or none."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from groundpose._writing import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figure(figure: Figure, path: str | PathLike[str], dpi: int, **options: Any) -> None:
    """Write a figure in the format of the name's ending; `options` are those of `Figure.savefig`.

    Raises:
        OSError: naming `path`.
    """
    with whole_file(path, "wb", sync=False) as file:
        figure.savefig(file, format=Path(path).suffix.lstrip(".").lower(), dpi=dpi, **options)
