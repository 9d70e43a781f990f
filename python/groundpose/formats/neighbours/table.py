"""The table of formats."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from groundpose.formats.neighbours.coco_3d import write_coco
from groundpose.formats.neighbours.context import Context
from groundpose.formats.neighbours.cvat import write_cvat
from groundpose.formats.neighbours.fiftyone import write_fiftyone
from groundpose.formats.neighbours.gltf import write_gltf
from groundpose.formats.neighbours.label_studio import write_label_studio
from groundpose.formats.neighbours.mcap import write_mcap
from groundpose.formats.neighbours.nuscenes import write_nuscenes
from groundpose.formats.neighbours.ros import write_ros
from groundpose.formats.scenes import Scene


@dataclass(frozen=True)
class Neighbour:
    """A format.

    Attributes:
        name, endings: how it is called, and the ends of file names that say it.
        write: its writer.
        one_frame: whether a file holds one frame alone.
        needs: what every frame must have beside camera and poses: "size" of the picture, "picture".
    """

    name: str
    endings: tuple[str, ...]
    write: Callable[[Iterable[Scene], Path, Context], None]
    one_frame: bool = False
    needs: tuple[str, ...] = ()


_ROWS = (
    Neighbour("mcap", (".mcap",), write_mcap),
    Neighbour("ros2", (".ros2", "_ros2"), write_ros),
    Neighbour("nuscenes", (".nuscenes.json",), write_nuscenes),
    Neighbour("coco", (".coco.json",), write_coco, needs=("size",)),
    Neighbour("label-studio", (".label-studio.json",), write_label_studio, needs=("size",)),
    Neighbour("cvat", (".xml",), write_cvat, needs=("size",)),
    Neighbour("fiftyone", (".fiftyone", "_fiftyone"), write_fiftyone, needs=("size", "picture")),
    Neighbour("gltf", (".glb", ".gltf"), write_gltf, one_frame=True),
)
NEIGHBOURS = {row.name: row for row in _ROWS}
"""The formats by name."""
