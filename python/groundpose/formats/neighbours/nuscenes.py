"""nuScenes' detection results, for its evaluator: boxes in the frame of the map.

The tables of nuScenes say where the car and its camera were: `Context.tables`, the folder of
`sample_data.json`, `calibrated_sensor.json` and `ego_pose.json`. Frames are found by the names of their
pictures, else by their own. Velocities, which an image does not show, are 0. Boxes of tracks have theirs, and
are tracking results too.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose._writing import write_text
from groundpose.formats.cameras.driving import rotation_of
from groundpose.formats.content import read_content
from groundpose.formats.conversions import to_body_axes, to_quaternions
from groundpose.formats.fields import Field
from groundpose.formats.neighbours.context import Context, score
from groundpose.formats.scenes import Scene

_CLASSES = {"car": "car", "van_bus": "car", "bus": "bus", "pickup": "truck", "box_truck": "truck"}
"""nuScenes counts vans among the cars and pickups among the trucks."""
_META = {"use_camera": True} | dict.fromkeys(("use_lidar", "use_radar", "use_map", "use_external"), False)
_MOST = 500
"""Boxes of a sample that the evaluator takes."""
Place = tuple[FloatArray, FloatArray]


def write_nuscenes(scenes: Iterable[Scene], path: Path, context: Context) -> None:
    """Write the results; see `groundpose.formats.neighbours.write_scenes`."""
    if context.tables is None:
        raise input_error("nuscenes", "the folder of nuScenes' tables, as v1.0-mini", "none")
    tables = Tables(context.tables)
    results: dict[str, list[dict[str, Any]]] = {}
    for scene in scenes:
        with context.frame(scene):
            sample, place = tables.place_of(scene)
            results.setdefault(sample, []).extend(_boxes(scene, sample, place, context))
    for sample, boxes in results.items():
        boxes.sort(key=lambda box: -float(box["detection_score"]))
        context.left_out[f"box beyond the {_MOST} of a sample"] += max(0, len(boxes) - _MOST)
        results[sample] = boxes[:_MOST]
    write_text(path, json.dumps({"meta": _META, "results": results}, allow_nan=False) + "\n")


class Tables:
    """nuScenes' tables: from the name of a picture to its sample and to the camera's place on the map."""

    def __init__(self, folder: Path) -> None:
        """Read them. Raises OSError, InputError naming the file."""
        self._folder = folder
        rows = [(Path(row.need("filename").text()), row) for row in self._rows("sample_data")]
        self._shots = {path.stem: row for path, row in rows} | {path.name: row for path, row in rows}
        self._cameras = {row.need("token").text(): row for row in self._rows("calibrated_sensor")}
        self._cars = {row.need("token").text(): row for row in self._rows("ego_pose")}

    def _rows(self, name: str) -> list[Field]:
        content = read_content(self._folder / f"{name}.json")
        if len(content.json) != 1:
            raise input_error(content.place, f"nuScenes' table {name}", "something else")
        return content.json[0].items()

    def place_of(self, scene: Scene) -> tuple[str, Place]:
        """The sample, and rotation and translation from the camera to the map.

        Raises InputError for a picture that the tables do not have.
        """
        name = str(scene.id) if scene.image is None else scene.image.name
        if name not in self._shots:
            raise input_error(f"frame {scene.id}: image", f"a picture of {self._folder}", name)
        shot = self._shots[name]
        R, t = self._place(self._cameras, shot.need("calibrated_sensor_token"))
        R_car, t_car = self._place(self._cars, shot.need("ego_pose_token"))
        return shot.need("sample_token").text(), (R_car @ R, R_car @ t + t_car)

    def _place(self, table: dict[str, Field], token: Field) -> Place:
        row = table.get(token.text()) or token.fail("a token of the tables")
        return rotation_of(row.need("rotation").numbers(4)), np.array(row.need("translation").numbers(3))


def _boxes(scene: Scene, sample: str, place: Place, context: Context) -> list[dict[str, Any]]:
    R, t = place
    turns = to_quaternions(R @ to_body_axes(scene.R))
    speeds = np.nan_to_num(scene.velocity @ R.T)
    found = []
    for k in scene.rows:
        name = context.category(scene, k, _CLASSES)
        if name is None:
            continue
        length, height, width = scene.size[k].tolist()
        found.append(
            {
                **{"sample_token": sample, "translation": (R @ scene.centre[k] + t).tolist()},
                **{"size": [width, length, height], "rotation": turns[k].tolist()},
                **{"velocity": speeds[k, :2].tolist(), "attribute_name": ""},
                **{"detection_name": name, "detection_score": score(scene, k)},
                **({} if scene.motion is None else _tracked(scene, k, name)),
            }
        )
    return found


def _tracked(scene: Scene, k: int, name: str) -> dict[str, Any]:
    """What makes a box one of nuScenes' tracking results."""
    return {"tracking_id": str(scene.ids[k]), "tracking_name": name, "tracking_score": score(scene, k)}
