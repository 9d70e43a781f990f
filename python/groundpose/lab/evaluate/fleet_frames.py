"""Tables of frames for the measurements of fleets: cars with keypoints, pictures of the bundled street."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose.demo.street import IMAGE, example
from groundpose.formats.arrow_lists import nested
from groundpose.formats.arrow_schema import FRAMES, arrow_type, schema_of
from groundpose.formats.arrow_values import camera_value, model_text
from groundpose.formats.parquet import package
from groundpose.types import Camera, View
from groundpose.vehicles.shape_models import shape_model

VIEW = View(Camera(1000.0, 990.0, 640.0, 360.0, image_size=(1280, 720)), pitch=-0.02, roll=0.01)
_OUTLIERS, _NOISE = 0.3, 0.01


def keypoint_frames(frames: int, objects: int, seed: int) -> Any:
    """A table of frames of so many cars each at 8 to 40 m, with noise of 1 % of their boxes and 30 %
    outliers."""
    arrow, count, model = package(), frames * objects, shape_model("car")
    points, boxes = _seen(count, np.random.default_rng(seed))
    each = np.full(count, len(model.keypoints_3d))
    given = {
        "object": arrow.array([str(k % objects) for k in range(count)]),
        "class": arrow.array(["car"] * count),
        "score": arrow.nulls(count, arrow.float64()),
        "bbox": nested(boxes.reshape(-1), [np.full(count, 4)]),
        "model": arrow.array([model_text(model)] * count),
        "keypoints_2d": nested(points.reshape(-1), [each, np.full(count, 2)]),
        "keypoint_scores": arrow.nulls(count, arrow_type("double", ("P",))),
    }
    kind = arrow_type("objects").value_type
    structs = arrow.StructArray.from_arrays([given[f.name].cast(f.type) for f in kind], fields=list(kind))
    offsets = arrow.array(np.arange(0, count + 1, objects), type=arrow.int32())
    columns = {
        "frame": [f"{seed:04d}-{k:06d}" for k in range(frames)],
        "camera": [camera_value(VIEW.camera)] * frames,
        "pitch": [VIEW.pitch] * frames,
        "roll": [VIEW.roll] * frames,
    }
    schema = schema_of(FRAMES)
    arrays = [
        arrow.ListArray.from_arrays(offsets, structs).cast(f.type)
        if f.name == "objects"
        else arrow.array(columns.get(f.name, [None] * frames), type=f.type)
        for f in schema
    ]
    return arrow.Table.from_arrays(arrays, schema=schema)


def _seen(count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Keypoints (N, P, 2) and boxes (N, 4) of cars on the ground."""
    model, camera, ground = shape_model("car"), VIEW.camera, VIEW.R_camera_from_ground
    yaw, z = rng.uniform(-np.pi, np.pi, count), rng.uniform(8.0, 40.0, count)
    c, s, zero, one = np.cos(yaw), np.sin(yaw), np.zeros(count), np.ones(count)
    turn = np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=1).reshape(-1, 3, 3)
    place = np.stack([z * rng.uniform(-0.35, 0.35, count), np.full(count, 1.5), z], axis=1)
    body = model.keypoints_3d - model.bottom_centre
    points = (np.einsum("nij,pj->npi", turn, body) + place[:, None]) @ ground.T
    pixels = camera.project(points)
    boxes = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1)
    sides = (boxes[:, 2:] - boxes[:, :2]).max(axis=1)[:, None, None]
    pixels = pixels + _NOISE * sides * rng.normal(size=pixels.shape)
    wrong = rng.random(pixels.shape[:2]) < _OUTLIERS
    anywhere = boxes[:, None, :2] + rng.random(pixels.shape) * (boxes[:, None, 2:] - boxes[:, None, :2])
    pixels[wrong] = anywhere[wrong]
    return pixels, boxes


def picture_frames(frames: int) -> Any:
    """A table of the bundled street, with its bytes, so many times."""
    street, data = example(), IMAGE.read_bytes()
    boxes = [{"object": str(k), "bbox": box} for k, box in enumerate(street.bboxes.tolist())]
    row: dict[str, Any] = {"image_bytes": data, "camera": camera_value(street.view.camera), "objects": boxes}
    row |= {"pitch": street.view.pitch, "roll": street.view.roll}
    rows = [{"frame": str(k), **row} for k in range(frames)]
    return package().Table.from_pylist(rows, schema=schema_of(FRAMES))


def write(folder: Path, files: int, groups: int, frames: int, objects: int) -> None:
    """Files in partitions by day, each of so many row groups of so many frames of so many cars."""
    from pyarrow import parquet

    for number in range(files):
        place = folder / f"day={number % 4}" / f"{number:04d}.parquet"
        place.parent.mkdir(parents=True, exist_ok=True)
        schema = schema_of(FRAMES)
        with parquet.ParquetWriter(place, schema, compression="zstd") as writer:
            for group in range(groups):
                table = keypoint_frames(frames, objects, seed=number * groups + group)
                writer.write_table(table, row_group_size=frames)
