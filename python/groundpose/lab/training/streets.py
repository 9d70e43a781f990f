"""Evaluation of a network on labelled KITTI frames: numbers and a contact sheet. Needs no torch.

`python -m groundpose.lab.training.streets NETWORK.onnx --data FOLDER --sheet sheet.png`. The frames are test
input and not part of this package; nothing is trained on them.
"""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from PIL import Image, ImageDraw

import groundpose as gp
from groundpose._checks import FloatArray, input_error
from groundpose.calibration import read_kitti_projection
from groundpose.formats.kitti.labels import CLASS_OF, KittiLabel, read_labels
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.image import as_rgb
from groundpose.keypoints.pipeline import Pipeline
from groundpose.keypoints.vehicle_poses import VehiclePoses
from groundpose.lab.data import data_folder, rotation_about_y
from groundpose.lab.metrics import rotation_error_deg

MIN_HEIGHT, MAX_TRUNCATION, MAX_OCCLUSION = 25.0, 0.15, 1
"""Limits of the evaluated vehicles: height of the box in pixels, KITTI's truncation and occlusion."""
EASY_HEIGHT = 40.0
_FAR_OFF_DEG = (15.0, 30.0)


@dataclass(frozen=True, eq=False)
class Street:
    """The labelled vehicles of one frame; N of them are evaluated."""

    name: str
    image: ByteArray
    view: gp.View
    bboxes: FloatArray
    R: FloatArray
    t: FloatArray
    classes: tuple[str, ...]
    easy: NDArray[np.bool_]


def looks(street: Street, count: int, seed: int = 0, noise: float = 0.03) -> list[Street]:
    """The frame and its mirror image, each `count` times: once with the boxes given, then with each side
    moved by a fraction `noise` (one standard deviation) of the box's sides, to get more from few vehicles.
    """
    rng = np.random.default_rng(seed)
    found = []
    for one in (street, _mirrored(street)):
        for i in range(count):
            moved = moved_boxes(one.bboxes, rng, noise)
            found.append(replace(one, bboxes=moved if i > 0 else one.bboxes))
    return found


def moved_boxes(boxes: FloatArray, rng: np.random.Generator, noise: float = 0.03) -> FloatArray:
    """Boxes (N, 4) whose sides are moved by a fraction `noise` (one standard deviation) of them."""
    sides = np.tile(boxes[:, 2:] - boxes[:, :2], 2)
    return np.asarray(boxes + noise * np.clip(rng.normal(size=boxes.shape), -2.0, 2.0) * sides)


def _mirrored(street: Street) -> Street:
    """The mirror image of a frame of a camera without distortion; vehicles are mirror-symmetric."""
    camera, last = street.view.camera, street.image.shape[1] - 1.0
    bboxes = street.bboxes.copy()
    bboxes[:, [0, 2]] = last - street.bboxes[:, [2, 0]]
    mirror = np.diag([-1.0, 1.0, 1.0])
    return replace(
        street,
        image=np.ascontiguousarray(street.image[:, ::-1]),
        view=replace(street.view, camera=replace(camera, cx=last - camera.cx), roll=-street.view.roll),
        bboxes=bboxes,
        R=mirror @ street.R @ mirror,
        t=street.t @ mirror,
    )


@dataclass(frozen=True, eq=False)
class Judged:
    """A frame's answers and their errors (N,) in degrees; 180 without an answer."""

    street: Street
    poses: VehiclePoses
    rotation_error: FloatArray
    yaw_error: FloatArray


def streets(folder: Path, types: tuple[str, ...] = ("Car",), pitch_deg: float = 0.0) -> list[Street]:
    """The frames of a folder in KITTI's object layout (image_2, label_2, calib).

    Raises:
        InputError: no frames there.
    """
    labels = sorted((folder / "label_2").glob("*.txt"))
    if not labels:
        raise input_error(str(folder), "frames in KITTI's layout (label_2/*.txt)", "none")
    return [_street(folder, path, types, math.radians(pitch_deg)) for path in labels]


def _street(folder: Path, path: Path, types: tuple[str, ...], pitch: float) -> Street:
    image = as_rgb(folder / "image_2" / f"{path.stem}.png")
    projection = read_kitti_projection(folder / "calib" / path.name, "P2")
    camera = gp.Camera.from_K(projection[:, :3], image_size=(image.shape[1], image.shape[0]))
    camera_from_labels = np.linalg.solve(projection[:, :3], projection[:, 3])
    rows = [label for label in read_labels(path) if label.type in types and is_judged(label)]
    angles = np.array([row.rotation_y for row in rows])
    return Street(
        path.stem,
        image,
        gp.View(camera, pitch),
        np.array([row.bbox for row in rows]).reshape(-1, 4),
        rotation_about_y(angles + math.pi / 2),
        np.array([row.location for row in rows]).reshape(-1, 3) + camera_from_labels,
        tuple(CLASS_OF[row.type] for row in rows),
        np.array([_height(row) >= EASY_HEIGHT and row.occluded == 0 for row in rows], dtype=bool),
    )


def is_judged(label: KittiLabel) -> bool:
    """Whether a vehicle is large and visible enough to be evaluated."""
    seen = label.truncated <= MAX_TRUNCATION and label.occluded <= MAX_OCCLUSION
    return seen and _height(label) >= MIN_HEIGHT


def _height(label: KittiLabel) -> float:
    return label.bbox[3] - label.bbox[1]


def judge(pipeline: Pipeline, street: Street) -> Judged:
    """The poses of a frame and their errors."""
    poses = pipeline(street.image, street.bboxes, street.view)
    rotation = np.where(poses.ok, rotation_error_deg(street.R, poses.R), 180.0)
    yaw = np.degrees(_yaw(poses.R) - _yaw(street.R))
    yaw = np.where(poses.ok, np.abs((yaw + 180.0) % 360.0 - 180.0), 180.0)
    return Judged(street, poses, rotation, yaw)


def _yaw(R: FloatArray) -> FloatArray:
    return np.asarray(np.arctan2(R[:, 0, 2], R[:, 2, 2]))


def summary(judged: list[Judged]) -> dict[str, float]:
    """Metrics by name, for all vehicles and for the easy ones."""
    rotation, yaw = (np.concatenate([getattr(j, n) for j in judged]) for n in ("rotation_error", "yaw_error"))
    easy = np.concatenate([j.street.easy for j in judged])
    right = np.concatenate([j.poses.classes == np.array(j.street.classes, dtype=np.str_) for j in judged])
    numbers: dict[str, float] = {}
    for name, chosen in (("all", np.ones(len(easy), dtype=bool)), ("easy", easy)):
        numbers[f"{name}: vehicles"] = int(chosen.sum())
        numbers[f"{name}: median e_r deg"] = float(np.median(rotation[chosen]))
        numbers[f"{name}: mean e_r deg"] = float(np.mean(rotation[chosen]))
        for limit in _FAR_OFF_DEG:
            numbers[f"{name}: yaw above {limit:g} deg %"] = float(100 * np.mean(yaw[chosen] > limit))
        numbers[f"{name}: class right %"] = float(100 * np.mean(right[chosen]))
    return numbers


_TILE = Codec(256, 192, margin=0.2)
_GOOD, _BAD, _BOX, _FRONT = (0, 200, 140), (230, 90, 0), (90, 190, 255), (255, 220, 0)
_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))
_EDGES = [(a, b) for a, b in itertools.combinations(range(8), 2) if abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]


def sheet(judged: list[Judged], columns: int = 6) -> Image.Image:
    """A picture of every vehicle, worst first: keypoints (high scores green), box (front yellow), error."""
    tiles = [(j.rotation_error[i], j, i) for j in judged for i in range(len(j.poses))]
    tiles.sort(key=lambda tile: -tile[0])
    rows = -(-len(tiles) // columns)
    whole = Image.new("RGB", (columns * _TILE.width, rows * _TILE.height))
    for n, (_, j, i) in enumerate(tiles):
        whole.paste(_tile(j, i), (n % columns * _TILE.width, n // columns * _TILE.height))
    return whole


def _tile(j: Judged, i: int) -> Image.Image:
    bbox = j.street.bboxes[i]
    window = _TILE.windows(bbox[None])
    picture = Image.fromarray(_TILE.crop(j.street.image, bbox))
    draw = ImageDraw.Draw(picture)
    pose = j.poses[i]
    if pose.ok:
        box = pose.model.bbox_3d
        corners = (box[0] + _CORNERS * (box[1] - box[0])) @ pose.R.T + pose.t
        if np.all(corners[:, 2] > 0.1):
            pixels = corners @ j.street.view.camera.K.T
            places = _TILE.crop_from_image((pixels[:, :2] / pixels[:, 2:])[None], window)[0]
            for a, b in _EDGES:
                front = _CORNERS[a, 2] == _CORNERS[b, 2] == 1
                draw.line([*places[a], *places[b]], fill=_FRONT if front else _BOX, width=1)
    places = _TILE.crop_from_image(pose.keypoints_2d[None], window)[0]
    for (x, y), score in zip(places.tolist(), j.poses.keypoint_scores[i], strict=False):
        if math.isfinite(x) and score > 0.1:
            colour = tuple(int(score * g + (1 - score) * b) for g, b in zip(_GOOD, _BAD, strict=True))
            draw.ellipse([x - 2, y - 2, x + 2, y + 2], fill=colour)
    caption = f"{j.street.name} {j.poses.classes[i]} {j.rotation_error[i]:.1f}"
    draw.text(
        (4, 4),
        caption + (" easy" if j.street.easy[i] else ""),
        fill=(255, 255, 255),
        stroke_width=1,
        stroke_fill=0,
    )
    return picture


def main(
    network: Path,
    data: Annotated[Path | None, typer.Option(help="Folder in KITTI's object layout.")] = None,
    picture: Annotated[Path | None, typer.Option("--sheet", help="Contact sheet to write.")] = None,
    pitch_deg: float = 0.0,
    count: Annotated[
        int | None,
        typer.Option("--looks", help="Repetitions of each frame and mirror image with moved boxes."),
    ] = None,
) -> None:
    """Evaluate a network on labelled boxes of real streets."""
    folder = data_folder() / "kitti" / "training" if data is None else data
    pipeline = Pipeline(network, threads=1)
    seen = streets(folder, pitch_deg=pitch_deg)
    if count is not None:
        seen = [look for street in seen for look in looks(street, count)]
    judged = [judge(pipeline, street) for street in seen]
    print(json.dumps({name: round(value, 2) for name, value in summary(judged).items()}, indent=1))
    if picture is not None:
        sheet(judged).save(picture)


if __name__ == "__main__":
    typer.run(main)
