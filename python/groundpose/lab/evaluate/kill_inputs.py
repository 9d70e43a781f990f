"""Inputs for the commands that `groundpose.lab.evaluate.kills` interrupts and `.load` times."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np

from groundpose._writing import whole_file, write_text
from groundpose.demo.street import IMAGE, LABELS
from groundpose.lab.evaluate.kitti.bench import make_folder
from groundpose.types import Camera, View
from groundpose.vehicles.shape_models import shape_model

_CAMERA = Camera(1000.0, 1000.0, 640.0, 360.0, image_size=(1280, 720))


def drawn_frames(path: Path, count: int, seed: int = 0, vehicles: int = 4) -> None:
    """Frames with the keypoints of cars at random places, as `groundpose estimate` reads them."""
    rng, view = np.random.default_rng(seed), View(_CAMERA, pitch=0.01)
    camera = {name: getattr(_CAMERA, name) for name in ("fx", "fy", "cx", "cy")}
    head = {"camera": camera, "pitch_deg": float(np.degrees(view.pitch)), "models": {"car": "bundled:car"}}
    lines = ({"id": number, **head, "objects": _cars(rng, view, vehicles)} for number in range(count))
    with whole_file(path, "w") as file:
        file.writelines(json.dumps(line) + "\n" for line in lines)


def _cars(rng: np.random.Generator, view: View, count: int) -> list[dict[str, object]]:
    points = shape_model("car").keypoints_3d
    cars = []
    for _ in range(count):
        yaw, z = rng.uniform(-np.pi, np.pi), rng.uniform(8.0, 40.0)
        c, s = np.cos(yaw), np.sin(yaw)
        R = view.R_camera_from_ground @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        t = view.R_camera_from_ground @ [rng.uniform(-0.4, 0.4) * z, 1.6, z]
        pixels = view.project(points @ R.T + t) + rng.normal(0.0, 0.7, (len(points), 2))
        bbox = [*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist()]
        cars.append({"model": "car", "keypoints_2d": pixels.tolist(), "bbox": bbox})
    return cars


def pictures(folder: Path, count: int) -> None:
    """`images`, `boxes` and `camera.json`: the street of the demo, several times."""
    content = json.loads(LABELS.read_text(encoding="utf-8"))
    boxes = [item["bbox"] for item in content["objects"]]
    copies(folder, count, IMAGE, boxes, content["camera"])


def copies(folder: Path, count: int, image: Path, boxes: list[list[float]], camera: dict[str, float]) -> None:
    """`images`, `boxes` and `camera.json`: one picture, several times."""
    for name in ("images", "boxes"):
        (folder / name).mkdir()
    for number in range(count):
        shutil.copyfile(image, folder / "images" / f"{number:06d}.jpg")
        write_text(folder / "boxes" / f"{number:06d}.json", json.dumps(boxes), sync=False)
    write_text(folder / "camera.json", json.dumps({name: camera[name] for name in ("fx", "fy", "cx", "cy")}))


def labels(folder: Path, count: int) -> None:
    """Labels and calibrations in KITTI's layout."""
    make_folder(folder, count)
