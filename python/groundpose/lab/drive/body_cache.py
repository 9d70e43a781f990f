"""What drives need of bodies, from the cache on disk: making a mesh takes longer than drawing it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab import bodies
from groundpose.lab.bodies import Body
from groundpose.lab.bodies.catalogue import outline
from groundpose.lab.drive import cache as disk
from groundpose.vehicles import keypoints

_HERE = Path(__file__).parent
# A change of these files or folders makes all entries anew.
_SOURCES = (
    Path(bodies.__file__).parent,
    Path(keypoints.__file__),
    *(_HERE / name for name in ("body_cache.py", "solids.py", "silhouette.py", "render/levels.py")),
)


@cache
def _version() -> str:
    return disk.fingerprint(_SOURCES)


def of_body(
    what: str, class_name: str, seed: int, keys: frozenset[str], make: Callable[[], disk.Arrays]
) -> disk.Arrays:
    """The arrays called `what` of a body, from the disk or made."""
    return disk.arrays(f"{disk.version_folder('bodies', _version())}/{what}/{class_name}-{seed}", keys, make)


@lru_cache(maxsize=16)
def body(class_name: str, seed: int) -> Body:
    """`groundpose.lab.bodies.body`; the last ones are kept, because several entries are made of each."""
    return bodies.body(class_name, seed)


@dataclass(frozen=True, eq=False)
class Measures:
    """The fields of `Body` without its mesh."""

    style: str
    keypoints_3d: FloatArray
    bbox_3d: FloatArray
    wheels: FloatArray

    @property
    def size(self) -> tuple[float, float, float]:
        """`(length, height, width)` of the 3D box, metres."""
        width, height, length = (self.bbox_3d[1] - self.bbox_3d[0]).tolist()
        return length, height, width


@lru_cache(maxsize=8192)
def measures(class_name: str, seed: int) -> Measures:
    """The measures of `body(class_name, seed)`."""

    def make() -> disk.Arrays:
        made = body(class_name, seed)
        return {
            "style": np.array(made.style), "keypoints_3d": made.keypoints_3d, "bbox_3d": made.bbox_3d,
            "wheels": made.wheels,
        }  # fmt: skip

    keys = frozenset(("style", "keypoints_3d", "bbox_3d", "wheels"))
    kept = of_body("measures", class_name, seed, keys, make)
    return Measures(str(kept["style"]), kept["keypoints_3d"], kept["bbox_3d"], kept["wheels"])


@lru_cache(maxsize=8192)
def length_and_width(class_name: str, seed: int) -> tuple[float, float]:
    """Length and width of `body(class_name, seed)`, metres, computed without its mesh."""
    keys = frozenset(("bbox_3d",))
    kept = of_body("outline", class_name, seed, keys, lambda: {"bbox_3d": outline(class_name, seed)[1]})
    width, _, length = (kept["bbox_3d"][1] - kept["bbox_3d"][0]).tolist()
    return length, width
