"""`python -m groundpose.lab.bodies.make_real_meshes SOURCE.npz`: vehicles drawn by hand become bodies.

Reads the vehicles of the SMARTS simulator, whose glass, lamps, tyres and hubs are parts of their own, brings
them into the object frame, stretches them to the size of real vehicles, adds mirrors, plates and seats, and
finds the keypoints by rules on the parts. The other vehicles of the file lack lamps as parts, and all but
one of them glass: their keypoints cannot be found. A keypoint that its rule puts off the surface is an error.
Writes `assets/real_meshes.npz`, which `real.py` reads.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.common import block, driving_place, number_plate, plate_middle
from groundpose.lab.bodies.geometry.mesh import Component, component, cross, face_normals
from groundpose.lab.bodies.parts import trim
from groundpose.lab.bodies.parts.cabin import seat
from groundpose.lab.bodies.parts.materials import MATERIAL
from groundpose.lab.bodies.real import ASSET
from groundpose.lab.bodies.real_keypoints import Parts, largest_distance, right_keypoints
from groundpose.vehicles.keypoints import KEYPOINTS, keypoint_indices

# Farthest that a keypoint may lie from the surface, metres.
_TOLERANCE = 0.05
# The lining is the body's inner side, drawn in towards the origin so that no coarse level shows it outside.
# Under the sloping rear windows of cars it would show.
_LINING, _LINED = (0.97, 0.985, 0.985), ("minibus", "van", "single_cab")
# Depth of the panes behind the body's surface, at most, metres.
_RECESS = 0.1
_MIRROR = np.array([-1.0, 1.0, 1.0])
# Their frame has y up and the front at -z.
_OBJECT_FROM_SOURCE = np.diag([1.0, -1.0, -1.0])


class Use(NamedTuple):
    """How a vehicle is used: class, style, and factors on its width and on its height and length."""

    class_name: str
    style: str
    across: float
    along: float


USES: dict[str, Use] = {
    "smarts_simple_car": Use("car", "hatchback", 1.15, 1.08),
    "smarts_muscle_car": Use("car", "coupe", 1.19, 1.13),
    "smarts_bus": Use("van_bus", "minibus", 1.25, 1.08),
    "smarts_coach": Use("van_bus", "minibus", 1.24, 1.10),
    "smarts_moving_truck": Use("van_bus", "van", 0.86, 1.00),
    "smarts_trailer": Use("van_bus", "van", 1.12, 1.05),
    "smarts_truck": Use("pickup", "single_cab", 0.98, 1.04),
}
"""The vehicles that become bodies."""

_MATERIALS = {
    "body": "paint", "windows": "glass", "lights": "headlamp", "metal": "rim", "tires": "tyre",
    "lights.red": "taillamp", "lights.orange": "indicator",
}  # fmt: skip


def convert(source: Mapping[str, np.ndarray], name: str) -> dict[str, np.ndarray]:
    """Arrays of one body: vertices, faces, materials, parts, keypoints, bbox, wheels.

    Raises:
        ValueError: a keypoint lies farther than 5 cm from the surface.
    """
    use = USES[name]
    whole = _parts(source, name, use)
    high = max(part.vertices[:, 2].max() for part in whole.values())
    low = min(part.vertices[:, 2].min() for part in whole.values())
    whole = {key: part.moved(z=-0.5 * float(high + low)) for key, part in whole.items()}
    right, left = Parts(whole), Parts({key: part.mirrored() for key, part in whole.items()})
    added, places = _added(right)
    added += _inside(right, use.style)
    sides = {"right": right_keypoints(right, use.class_name), "left": right_keypoints(left, use.class_name)}
    rows = []
    for i in keypoint_indices(use.class_name):
        side, _, place = KEYPOINTS[i].name.partition("_")
        if KEYPOINTS[i].partner is None:
            rows.append(places.get(KEYPOINTS[i].name, sides["right"].get(KEYPOINTS[i].name)))
        else:
            point = places["mirror"] if place == "mirror" else sides[side][place]
            rows.append(point * (_MIRROR if side == "left" else 1.0))
    keypoints = np.array(rows, float)
    components = [*whole.values(), *added]
    away, keypoints = largest_distance(components, keypoints)
    if away > _TOLERANCE:
        raise ValueError(f"{name}: a keypoint lies {away:.3f} m from the surface")
    return {**_arrays(components), "keypoints": keypoints, "bbox": _box(whole), "wheels": right.wheels(left)}


def _parts(source: Mapping[str, np.ndarray], name: str, use: Use) -> dict[str, Component]:
    """The parts by name, in the object frame and at their final size."""
    stretch = np.diag([use.across, use.along, use.along])
    vertices = source[f"{name}_V"] @ (stretch @ _OBJECT_FROM_SOURCE).T
    vertices = vertices - [0.0, float(vertices[:, 1].max()), 0.0]
    faces, part = source[f"{name}_F"], source[f"{name}_part"]
    found = {}
    for row, label in enumerate(str(x) for x in source[f"{name}_partnames"]):
        found[label] = component(vertices, faces[part == row], MATERIAL[_MATERIALS[label]], 30.0)
    hubs = found["metal"]
    across = np.abs(hubs.vertices[hubs.faces][..., 0]).max(axis=1)
    hubs.materials[across < 0.7 * across.max()] = MATERIAL["grille"]
    return found | {"windows": _flush(found["windows"], found["body"])}


def _flush(windows: Component, body: Component) -> Component:
    """The panes moved out of their recesses to the rims of the body: what is seen as their corners."""
    rims = body.vertices[np.unique(body.faces)]
    normals = face_normals(windows.vertices, windows.faces)
    corners = windows.vertices[windows.faces]
    for corner, normal in zip(corners, normals, strict=True):
        for row, point in enumerate(corner.copy()):
            away = rims - point
            out, far = away @ normal, np.linalg.norm(away, axis=1)
            near = (far < _RECESS) & (out > 0.01)
            if near.any():
                corner[row] = rims[near][(far - 2.0 * out)[near].argmin()]
    faces = np.arange(corners.size // 3, dtype=np.int32).reshape(-1, 3)
    return replace(windows, vertices=corners.reshape(-1, 3), faces=faces)


def _added(parts: Parts) -> tuple[list[Component], dict[str, FloatArray]]:
    """Mirrors and number plates, and the keypoints on them."""
    foot = parts.mirror_foot() + np.array([-0.02, -0.01, -0.06])
    mirror = [part.moved(*foot.tolist()) for part in trim.mirror(0.19, 0.16, 0.11, "plastic", 0.06)]
    housing = mirror[0].vertices
    places = {"mirror": housing[np.argmax(housing[:, 0])]}
    plates = []
    for name, facing in (("front_plate", 1.0), ("rear_plate", -1.0)):
        at = parts.plate_place(facing)
        plates.append(number_plate(at))
        places[name] = plate_middle(at, facing)
    return [*mirror, *(part.mirrored() for part in mirror), *plates], places


def _inside(parts: Parts, style: str) -> list[Component]:
    """What is seen through the windows: the lining, a floor, seats, a driver, a wall in vans."""
    screen, first, last = parts.pane_ends(1.0)[1], parts.side_panes[0], parts.side_panes[-1]
    rear = parts.pane_ends(-1.0)[1][2] if style == "single_cab" else parts.body[:, 2].min()
    belt, low = float(first[:, 1].max()), float(parts.body[:, 1].max())
    roof = float(parts.body[:, 1].min())
    half = 0.8 * float(parts.hubs()[0][:, 0].min()) - 0.1
    ends, top = (0.85 * float(parts.body[:, 2].max()), float(rear) + 0.12), max(belt + 0.42, roof + 0.98)
    size = (2.0 * half, low - top, ends[0] - ends[1])
    place = 0.5 * half, -top, float(first[:, 2].min()) + 0.25
    body = parts.whole["body"]
    lining = replace(body, faces=body.faces[:, ::-1]).scaled(*_LINING).painted(MATERIAL["rubber"])
    found = [
        *([lining] if style in _LINED else []),
        block(*size, "underbody", (0.0, 0.5 * (low + top), 0.5 * sum(ends))),
        *driving_place(-place[0], place[1], place[2], screen, driver=True),
        *[part.moved(place[0], top, place[2]) for part in seat(0.5, 0.55)],
    ]
    if style == "van":
        return [*found, block(2.0 * half, 1.0, 0.03, "interior", (0.0, top - 0.5, place[2] - 0.35))]
    benches = [float(pane[:, 2].min()) for pane in parts.side_panes[1:-1]] + [float(last[:, 2].min()) + 0.3]
    rows = [] if style in ("single_cab", "coupe") else benches
    return found + [part.moved(0.0, top, z) for z in rows for part in seat(1.8 * half, 0.5, 2)]


def _box(whole: Mapping[str, Component]) -> FloatArray:
    points = np.concatenate([part.vertices[part.faces].reshape(-1, 3) for part in whole.values()])
    width = float(np.abs(points[:, 0]).max())
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([[-width, low[1], low[2]], [width, 0.0, high[2]]])


def _arrays(components: list[Component]) -> dict[str, np.ndarray]:
    """Vertices, faces, materials and parts of all components, without unused vertices."""
    vertices, faces, start = [], [], 0
    components = [_with_area(part) for part in components]
    for part in components:
        used, rows = np.unique(part.faces, return_inverse=True)
        vertices.append(part.vertices[used])
        faces.append(rows.reshape(-1, 3) + start)
        start += len(used)
    return {
        "vertices": np.concatenate(vertices).astype("f4"),
        "faces": np.concatenate(faces).astype("u2"),
        "materials": np.concatenate([part.materials for part in components]),
        "parts": np.repeat(np.arange(len(components)), [len(c.faces) for c in components]).astype("u1"),
    }


def _with_area(part: Component) -> Component:
    """The component without triangles that have no area."""
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    kept = np.linalg.norm(cross(b - a, c - a), axis=1) > 1e-7
    return replace(part, faces=part.faces[kept], materials=part.materials[kept])


def main(source: str) -> None:
    """Convert all vehicles of `USES`."""
    with np.load(source) as loaded:
        arrays = dict(loaded)
    written: dict[str, Any] = {}
    for name, use in USES.items():
        made = convert(arrays, name)
        print(
            name,
            use.class_name,
            use.style,
            "length, height, width",
            np.ptp(made["bbox"], axis=0)[::-1].round(2),
        )
        written |= {f"{name}_{key}": value for key, value in made.items()}
        written[f"{name}_class"] = np.array([use.class_name, use.style])
    np.savez_compressed(ASSET, **written)
    print(ASSET, Path(ASSET).stat().st_size)


if __name__ == "__main__":
    main(sys.argv[1])
