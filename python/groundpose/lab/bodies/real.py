"""Bodies of vehicles drawn by hand, converted by `make_real_meshes`; see assets/ATTRIBUTION.md."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.body import Body
from groundpose.lab.bodies.geometry.mesh import Component, assemble

ASSET = Path(__file__).parent / "assets" / "real_meshes.npz"
FIRST_SEED = 900_000
"""Seeds from here on are those of `SEEDS`; the generators use smaller ones."""

_CREASE = float(np.deg2rad(30.0))


@cache
def _table() -> dict[tuple[str, int], tuple[str, dict[str, np.ndarray]]]:
    """Style and arrays of each body by class and seed."""
    with np.load(ASSET) as loaded:
        names = [key.removesuffix("_class") for key in loaded if key.endswith("_class")]
        found = {}
        for i, name in enumerate(names):
            class_name, style = loaded[f"{name}_class"].tolist()
            arrays = {k.removeprefix(f"{name}_"): loaded[k] for k in loaded if k.startswith(f"{name}_")}
            found[class_name, FIRST_SEED + i] = style, arrays
    return found


@cache
def seeds(class_name: str) -> tuple[int, ...]:
    """Seeds of the bodies of a class, may be empty."""
    return tuple(seed for name, seed in _table() if name == class_name)


def style(class_name: str, seed: int) -> str:
    """Style of the body with this seed."""
    return _table()[class_name, seed][0]


def outline(class_name: str, seed: int) -> tuple[FloatArray, FloatArray]:
    """Keypoints (P, 3) and 3D box (2, 3)."""
    arrays = _table()[class_name, seed][1]
    return arrays["keypoints"].copy(), arrays["bbox"].copy()


def _component(arrays: dict[str, np.ndarray], part: int) -> Component:
    mine = arrays["parts"] == part
    used, rows = np.unique(arrays["faces"][mine], return_inverse=True)
    faces = rows.reshape(-1, 3).astype(np.int32)
    return Component(arrays["vertices"][used].astype(float), faces, arrays["materials"][mine], _CREASE)


def build(class_name: str, seed: int) -> Body:
    """The body with this seed; its parts need not be closed."""
    style_name, arrays = _table()[class_name, seed]
    mesh = assemble([_component(arrays, part) for part in range(int(arrays["parts"].max()) + 1)])
    return Body(
        class_name,
        style_name,
        seed,
        mesh.vertices,
        mesh.normals,
        mesh.faces,
        mesh.materials,
        mesh.parts,
        *outline(class_name, seed),
        arrays["wheels"].copy(),
    )
