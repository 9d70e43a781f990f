"""Recordings for the Rerun viewer (`pip install groundpose[rerun]`): a sequence to scrub through.

The world is the ground frame of each image (x right, y down, z forward). Below `world/camera` are the image
with 2D boxes and keypoints (inliers, outliers, not seen), and the estimated 3D boxes and shapes, with the
truth beside them.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from contextlib import ExitStack
from os import PathLike
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose._writing import whole_path
from groundpose.draw.colours import BOX, INLIER, MISSING, OUTLIER, POSE, POSE_LIGHT, TRUTH
from groundpose.formats.conversions import to_quaternions
from groundpose.formats.records import boxes_3d
from groundpose.poses import PoseBatch
from groundpose.vehicles.skeleton import skeleton_of

_CAMERA = "world/camera"
_IMAGE = f"{_CAMERA}/image"
_OBJECTS = f"{_CAMERA}/objects"
Truth = tuple[FloatArray, FloatArray, FloatArray]
"""`(R, t, size)`: (N, 3, 3), (N, 3) bottom centres and (N, 3) height, width, length; camera frame, NaN =
none."""


def package() -> Any:
    """The package `rerun`. Raises InputError when it is not installed."""
    try:
        return importlib.import_module("rerun")
    except ModuleNotFoundError as error:
        wanted = "rerun-sdk (pip install 'groundpose[rerun]')"
        raise input_error("rerun", wanted, f"no package {error.name}") from None


class RerunLog:
    """One recording; frames are written as they come."""

    def __init__(self, path: str | PathLike[str]) -> None:
        """Begin the file. Raises InputError when rerun-sdk is not installed, OSError for a bad path."""
        self._rr = package()
        self._place = ExitStack()
        part = self._place.enter_context(whole_path(path))
        part.open("wb").close()  # a path that cannot be is an OSError, not a message of the library
        self._stream = self._rr.RecordingStream("groundpose")
        self._stream.save(str(part))
        self._stream.log("world", self._rr.ViewCoordinates.RDF, static=True)

    def __enter__(self) -> RerunLog:
        """The log itself."""
        return self

    def __exit__(self, *error: Any) -> None:
        """Complete the file; without it when the block ends with an error."""
        self._end()
        self._place.__exit__(*error)

    def close(self) -> None:
        """Complete the file."""
        self._end()
        self._place.close()

    def _end(self) -> None:
        self._stream.flush()
        self._stream.disconnect()

    def add(
        self,
        number: int,
        poses: PoseBatch,
        image: Any = None,
        names: Sequence[str] | None = None,
        truth: Truth | None = None,
    ) -> None:
        """One frame.

        Args:
            number: its place in the sequence.
            poses: of its objects.
            image: (H, W, 3) uint8, or None.
            names: of the objects; None: their numbers.
            truth: see `Truth`.
        """
        words = [str(k) for k in range(len(poses))] if names is None else list(names)
        self._stream.set_time("frame", sequence=number)
        self._log_camera(poses, image)
        self._log_image(poses, words)
        self._log_objects(poses, words)
        self._log_truth(truth)

    def _log_camera(self, poses: PoseBatch, image: Any) -> None:
        camera, rr = poses.view.camera, self._rr
        turn = poses.view.R_camera_from_ground.T
        self._stream.log(_CAMERA, rr.Transform3D(mat3x3=turn))
        size = None if camera.image_size is None else list(camera.image_size)
        if size is None and image is not None:
            size = [image.shape[1], image.shape[0]]
        pinhole = rr.Pinhole(image_from_camera=camera.K, resolution=size, camera_xyz=rr.ViewCoordinates.RDF)
        self._stream.log(_IMAGE, pinhole)
        if image is None:
            self._stream.log(f"{_IMAGE}/picture", rr.Clear(recursive=False))
        else:
            self._stream.log(f"{_IMAGE}/picture", rr.Image(image).compress(jpeg_quality=85))

    def _log_image(self, poses: PoseBatch, words: list[str]) -> None:
        rr = self._rr
        boxed = np.asarray(np.isfinite(poses.bboxes).all(axis=1))
        said = [w if ok else f"{w}: {s}" for w, ok, s in zip(words, poses.ok, poses.status, strict=True)]
        self._stream.log(
            f"{_IMAGE}/boxes",
            rr.Boxes2D(
                array=poses.bboxes[boxed],
                array_format=rr.Box2DFormat.XYXY,
                labels=[word for word, known in zip(said, boxed, strict=True) if known],
                colors=rgb(BOX),
                show_labels=False,
            ),
        )
        given = np.asarray(np.isfinite(poses.keypoints_2d).all(axis=2))
        hidden = [
            poses.view.camera.image_of(pose.keypoints_3d[~seen[: len(pose.keypoints_3d)]] @ pose.R.T + pose.t)
            for pose, seen in zip(poses, given, strict=True)
            if pose.ok
        ]
        for name, points, colour, radius in (
            ("inliers", poses.keypoints_2d[poses.inlier_mask], INLIER, 2.0),
            ("outliers", poses.keypoints_2d[given & ~poses.inlier_mask], OUTLIER, 2.0),
            ("not_seen", np.concatenate([np.empty((0, 2)), *hidden]), MISSING, 1.2),
        ):
            dots = rr.Points2D(points[np.isfinite(points).all(axis=1)], colors=rgb(colour), radii=-radius)
            self._stream.log(f"{_IMAGE}/keypoints/{name}", dots)

    def _log_objects(self, poses: PoseBatch, words: list[str]) -> None:
        rr, rows = self._rr, np.flatnonzero(poses.ok).tolist()
        boxes = list(boxes_3d(poses)[rows])
        middles = [poses.R[k] @ box.mean(axis=0) + poses.t[k] for k, box in zip(rows, boxes, strict=True)]
        self._log_boxes(
            "boxes", middles, [np.ptp(b, axis=0) for b in boxes], poses.R[rows], POSE, rows, words
        )
        shapes = [poses[k].keypoints_3d @ poses.R[k].T + poses.t[k] for k in rows]
        points = np.concatenate([np.empty((0, 3)), *shapes])
        self._stream.log(f"{_OBJECTS}/shape", rr.Points3D(points, colors=rgb(POSE_LIGHT), radii=0.05))
        lines = [
            shape[[a, b]]
            for k, shape in zip(rows, shapes, strict=True)
            for a, b in skeleton_of(poses.models[k].name, poses.models[k].keypoint_names)
        ]
        self._stream.log(
            f"{_OBJECTS}/shape_lines", rr.LineStrips3D(lines, colors=rgb(POSE_LIGHT), radii=0.02)
        )

    def _log_boxes(
        self,
        name: str,
        middles: Sequence[FloatArray],
        sizes: Sequence[FloatArray],
        R: FloatArray,
        colour: str,
        rows: Sequence[int],
        words: list[str],
    ) -> None:
        rr = self._rr
        turns = to_quaternions(R)[:, [1, 2, 3, 0]]  # x, y, z, w there
        boxes = rr.Boxes3D(
            centers=np.reshape(middles, (-1, 3)),
            half_sizes=np.reshape(sizes, (-1, 3)) / 2.0,
            quaternions=[rr.Quaternion(xyzw=q) for q in turns],
            labels=[words[k] for k in rows],
            colors=rgb(colour),
            show_labels=False,
        )
        self._stream.log(f"{_OBJECTS}/{name}", boxes)

    def _log_truth(self, truth: Truth | None) -> None:
        if truth is None:
            return
        known = np.asarray(np.isfinite(truth[1]).all(axis=1))
        R, t, size = (part[known] for part in truth)
        middles = t - 0.5 * size[:, :1] * R[:, :, 1]  # y is down: half the height above the bottom
        sides = size[:, [1, 0, 2]]
        rows = np.flatnonzero(known).tolist()
        self._log_boxes(
            "truth", list(middles), list(sides), R, TRUTH, rows, [str(k) for k in range(len(known))]
        )


def rgb(colour: str) -> list[int]:
    """Of `#RRGGBB`, 0 to 255."""
    return [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
