"""Data sets of FiftyOne, with the package fiftyone (extra `fiftyone`): a folder that its
`fo.Dataset.from_dir(dataset_dir=..., dataset_type=fo.types.FiftyOneDataset)` opens.

Fields of a sample: `boxes` (2D detections), `vehicles` (3D detections: location, dimensions, rotation),
`cuboids` (the 3D boxes on the picture, as polylines).
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import input_error
from groundpose._writing import naming
from groundpose.formats.columns import corner
from groundpose.formats.conversions import to_body_axes
from groundpose.formats.extras import extra_package
from groundpose.formats.neighbours.context import Context, score
from groundpose.formats.scenes import Motion, Scene
from groundpose.formats.tracks import KMH

_ROUND = (("bottom", "left"), ("bottom", "right"), ("top", "right"), ("top", "left"))
_CUBOID = [corner(end, height, side) for end in ("front", "rear") for height, side in _ROUND]
"""The corners in FiftyOne's order: the front face from its bottom left corner on, then the rear one."""


def write_fiftyone(scenes: Iterable[Scene], path: Path, context: Context) -> None:
    """Write the data set; see `groundpose.formats.neighbours.write_scenes`."""
    fo = extra_package("fiftyone", "fiftyone", "fiftyone")
    if path.exists():
        raise input_error(str(path), "a folder that is not there yet, for the data set", "one that is there")
    part = path.with_name(f".{path.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    data = _data_set(fo)
    try:
        for scene in scenes:
            with context.frame(scene):
                data.add_sample(sample(fo, scene, context))
        with naming(path, part):
            data.export(
                export_dir=str(part), dataset_type=fo.types.FiftyOneDataset, export_media=context.pictures
            )
            part.rename(path)
    finally:
        data.delete()
        with suppress(OSError):
            shutil.rmtree(part)


def _data_set(fo: Any) -> Any:
    """A new one. Raises InputError where FiftyOne has no database to put it into."""
    try:
        return fo.Dataset()
    except Exception as error:  # its own class for each of half a dozen ways in which MongoDB does not start
        said = " ".join((str(error) or type(error).__name__).split())
        raise input_error("fiftyone", "FiftyOne's database to start", said) from None


def sample(fo: Any, scene: Scene, context: Context) -> Any:
    """One frame as a sample; `fo` is the package. Raises InputError for a frame without a picture."""
    if scene.image is None or not scene.image.is_file():
        raise input_error(f"frame {scene.id}: image", "a picture that is there", str(scene.image or "none"))
    width, height = scene.image_size()
    made = fo.Sample(filepath=str(scene.image.resolve()), frame=str(scene.id))
    scale = np.array([width, height])
    flat = []
    for k, box in enumerate(scene.bboxes):
        if not np.isfinite(box).all():
            context.left_out["2D box that is not known"] += 1
            continue
        corner, far = box.reshape(2, 2) / scale
        parts = {"bounding_box": [*corner.tolist(), *(far - corner).tolist()], "status": scene.status[k]}
        flat.append(fo.Detection(**_said(scene, k), **parts))
    made["boxes"] = fo.Detections(detections=flat)
    made["vehicles"] = fo.Detections(detections=[_solid(fo, scene, k) for k in scene.rows])
    made["cuboids"] = fo.Polylines(polylines=_cuboids(fo, scene, (width, height), context))
    return made


def _said(scene: Scene, k: int) -> dict[str, Any]:
    return {
        "label": scene.classes[k] or "vehicle",
        "confidence": score(scene, k),
        "object": str(scene.ids[k]),
        **({} if scene.motion is None else _tracked(scene, scene.motion, k)),
    }


def _tracked(scene: Scene, motion: Motion, k: int) -> dict[str, Any]:
    """FiftyOne's `index` says which labels of several samples are one vehicle."""
    speed = float(KMH * motion.speed[k])
    return {"index": scene.ids[k], "speed_kmh": speed, "seen": bool(motion.seen[k])}


def _solid(fo: Any, scene: Scene, k: int) -> Any:
    """FiftyOne's rotation is by Euler angles x, y, z about the fixed axes; location is the middle."""
    length, height, width = scene.size[k].tolist()
    R = to_body_axes(scene.R[k][None])[0]
    angles = [np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1, 1)), np.arctan2(R[1, 0], R[0, 0])]
    return fo.Detection(
        **_said(scene, k),
        location=scene.centre[k].tolist(),
        dimensions=[length, width, height],
        rotation=[float(angle) for angle in angles],
    )


def _cuboids(fo: Any, scene: Scene, size: tuple[int, int], context: Context) -> list[Any]:
    found = []
    pixels = scene.corner_pixels
    for k in scene.rows:
        if not np.isfinite(pixels[k]).all():
            context.left_out["cuboid that is partly behind the camera"] += 1
            continue
        vertices = pixels[k][_CUBOID].tolist()
        found.append(fo.Polyline.from_cuboid(vertices, frame_size=size, **_said(scene, k)))
    return found
