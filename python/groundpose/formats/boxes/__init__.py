"""2D boxes of images from files: the format is recognised by the content.

A format is a row of `BOXES`: what it is called, how it is recognised, how it is read. Boxes are `left, top,
right, bottom` pixels as the file has them; no half pixel is added or taken. An entry that is no box costs
itself alone: it is left out, counted and named in `BoxFile.skipped`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from groundpose.formats.boxes.box import ANY, Box, Boxes, BoxFile

if TYPE_CHECKING:
    from groundpose.formats.boxes.known import BOXES, BoxFormat, read_boxes

__all__ = ["ANY", "BOXES", "Box", "BoxFile", "BoxFormat", "Boxes", "read_boxes"]


def __getattr__(name: str) -> Any:
    """What reads files: who gives boxes to a pipeline needs no XML."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("groundpose.formats.boxes.known"), name)
