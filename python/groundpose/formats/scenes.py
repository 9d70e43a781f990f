"""Poses of a frame as other tools want them: camera, tilt and 3D boxes, of a batch or of a written line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose._checks import FloatArray, blamed, input_error, regular_file
from groundpose._core import InputError
from groundpose.formats.columns import CORNERS, corners_of
from groundpose.formats.conversions import covariance_at
from groundpose.formats.fields import Field, parse
from groundpose.formats.frames import Frame, read_view
from groundpose.formats.records import boxes_3d
from groundpose.poses import PoseBatch
from groundpose.types import View

_NUMBERS = {
    "R": (3, 3),
    "t": (3,),
    "bbox_3d": (2, 3),
    "bboxes": (4,),
    "scores": (),
    "probability": (),
    "ambiguity": (),
    "yaw": (),
    "covariance": (6, 6),
}
"""The arrays of a `Scene`, and the shape of each for one object."""
_MEMBERS = {"bboxes": "bbox", "scores": "detection_score"}
"""What a line calls them, where it is not the same."""
_OPTIONAL = ("bboxes", "scores")


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """How the N vehicles of a frame move, as tracks say it; NaN: not known.

    Attributes:
        speed, speed_sigma: (N,) m/s along the heading, negative: it reverses.
        yaw_rate, yaw_rate_sigma: (N,) rad/s, positive to the right.
        acceleration, acceleration_sigma: (N,) m/s^2 along the heading.
        standing: (N,) whether it stands still.
        seen: (N,) whether the frame shows it; else its place is expected by its motion.
        camera: (3,) where the camera is: metres right and forward of where it was in the first frame, and
            radians that it has turned to the right.
    """

    speed: FloatArray
    speed_sigma: FloatArray
    yaw_rate: FloatArray
    yaw_rate_sigma: FloatArray
    acceleration: FloatArray
    acceleration_sigma: FloatArray
    standing: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    camera: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """The N vehicles of one frame; NaN without an answer.

    Attributes:
        id: of the frame. time: seconds, if known. image: its picture, if known.
        view: camera and tilt.
        ids: N, of the objects. classes: N names of their models, "" where none is known. status: N.
        R, t: (N, 3, 3), (N, 3) metres, `X_camera = R @ X_object + t`. yaw: (N,) radians.
        bbox_3d: (N, 2, 3) metres, lowest and highest corner of the 3D box in the object frame.
        bboxes: (N, 4) left, top, right, bottom pixels, as given.
        scores: (N,) of the detector. probability: (N,) that the pose is right. ambiguity: (N,) that it is
            turned round.
        covariance: (N, 6, 6) as that of a `PoseBatch`.
        shape_coefficients: N arrays (M,).
        motion: of tracks; None: the frame is alone.
    """

    id: str | int
    time: float | None
    image: Path | None
    view: View
    ids: tuple[str | int, ...]
    classes: tuple[str, ...]
    status: tuple[str, ...]
    R: FloatArray
    t: FloatArray
    yaw: FloatArray
    bbox_3d: FloatArray
    bboxes: FloatArray
    scores: FloatArray
    probability: FloatArray
    ambiguity: FloatArray
    covariance: FloatArray
    shape_coefficients: tuple[FloatArray, ...]
    motion: Motion | None = None

    def __len__(self) -> int:
        """N."""
        return len(self.ids)

    @classmethod
    def of(
        cls,
        poses: PoseBatch,
        id: str | int = 0,
        *,
        image: str | PathLike[str] | None = None,
        time: float | None = None,
        ids: Sequence[str | int] | None = None,
        classes: Sequence[str] | None = None,
        scores: ArrayLike | None = None,
    ) -> Scene:
        """Of a batch.

        Args:
            poses: of one image.
            id, image, time: of the frame.
            ids: N, of the objects; None: those of `VehiclePoses`, else 0 to N - 1.
            classes: N names; None: those of `VehiclePoses`, else those of the models.
            scores: (N,) of the detector.

        Raises:
            InputError: another number of ids, classes or scores than of objects.
        """
        count = len(poses)
        said = getattr(poses, "classes", [model.name for model in poses.models])
        names = [str(name) for name in (said if classes is None else classes)]
        given = getattr(poses, "ids", range(count)) if ids is None else ids
        values = np.full(count, np.nan) if scores is None else np.asarray(scores, dtype=float).reshape(-1)
        for argument, column in (("ids", given), ("classes", names), ("scores", values)):
            if len(column) != count:
                raise input_error(argument, f"{count}, one for each object", len(column))
        return cls(
            id=id,
            time=time,
            image=None if image is None else Path(image),
            view=poses.view,
            ids=tuple(given),
            classes=tuple(names),
            status=tuple(poses.status.tolist()),
            R=poses.R,
            t=poses.t,
            yaw=poses.yaw,
            bbox_3d=boxes_3d(poses),
            bboxes=poses.bboxes,
            scores=values,
            probability=poses.probability,
            ambiguity=poses.ambiguity,
            covariance=poses.covariance,
            shape_coefficients=tuple(
                row[: model.modes] for row, model in zip(poses.shape_coefficients, poses.models, strict=True)
            ),
        )

    @classmethod
    def of_frame(cls, frame: Frame, poses: PoseBatch) -> Scene:
        """Of a frame with keypoints and its poses."""
        scores = [np.nan if o.score is None else o.score for o in frame.objects]
        return cls.of(
            poses,
            frame.id,
            image=frame.image,
            time=frame.time,
            ids=[o.id for o in frame.objects],
            classes=[o.model for o in frame.objects],
            scores=scores,
        )

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(N,) whether there is a pose."""
        return np.array([status == "ok" for status in self.status], dtype=bool)

    @property
    def rows(self) -> list[int]:
        """Numbers of the objects with a pose."""
        return [k for k, status in enumerate(self.status) if status == "ok"]

    @property
    def size(self) -> FloatArray:
        """(N, 3) metres, length, height, width."""
        return np.asarray((self.bbox_3d[:, 1] - self.bbox_3d[:, 0])[:, [2, 1, 0]])

    @property
    def centre(self) -> FloatArray:
        """(N, 3) metres, the middles of the 3D boxes in the camera frame."""
        return self._arm + self.t

    @property
    def _arm(self) -> FloatArray:
        return np.asarray((self.R @ self.bbox_3d.mean(axis=1)[..., None])[..., 0])

    @property
    def centre_covariance(self) -> FloatArray:
        """(N, 6, 6) as `covariance`, of the middles."""
        return covariance_at(self.covariance, self._arm)

    @property
    def corners(self) -> FloatArray:
        """(N, 8, 3) metres in the camera frame, in the order of `groundpose.formats.columns.CORNERS`."""
        boxes = zip(self.bbox_3d, self.R, self.t, strict=True)
        rows = [corners_of(low, high, R, t) for (low, high), R, t in boxes]
        return np.array(rows).reshape(-1, len(CORNERS), 3)

    @property
    def corner_pixels(self) -> FloatArray:
        """(N, 8, 2) pixels of `corners` in the picture; NaN where the camera does not see them."""
        return self.view.camera.image_of(self.corners)

    @property
    def shown_boxes(self) -> FloatArray:
        """(N, 4) left, top, right, bottom pixels, what the picture shows of the 3D boxes: the extent of their
        corners, cut at the picture's border if its size is known; NaN where nothing, or not all in front of
        the camera, is to be seen."""
        return extents(self.corner_pixels, self.view.camera.image_size)

    @property
    def velocity(self) -> FloatArray:
        """(N, 3) m/s in the camera's axes; NaN without `motion`."""
        speed = np.full(len(self), np.nan) if self.motion is None else self.motion.speed
        return np.asarray(self.R[:, :, 2] * speed[:, None])

    def image_size(self) -> tuple[int, int]:
        """(width, height) of the picture. Raises InputError when nobody said it."""
        if self.view.camera.image_size is None:
            raise input_error(f"frame {self.id}: camera.image_size", "[width, height]", "none")
        return self.view.camera.image_size


def extents(pixels: FloatArray, size: tuple[int, int] | None) -> FloatArray:
    """Boxes (N, 4) around points (N, P, 2), cut at the border of a picture of `size`; NaN around points that
    are not all known, and outside the picture."""
    boxes = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1)
    if size is not None:
        boxes = np.clip(boxes, 0.0, np.tile(size, 2) - 1.0)  # from the first to the last pixel's centre
    seen = np.asarray((boxes[:, 2:] > boxes[:, :2]).all(axis=1))
    return np.where(seen[:, None], boxes, np.nan)


def read_scenes(path: str | PathLike[str]) -> Iterator[Scene | InputError]:
    """The frames of a file that `groundpose estimate` wrote (.jsonl), in order; a bad line gives its error
    and the next one goes on. Raises OSError."""
    with regular_file(path).open("rb") as stream:
        for number, raw in enumerate(stream, 1):
            text = raw.decode("utf-8", errors="surrogateescape").removeprefix("\ufeff").strip()
            if not text:
                continue
            try:
                yield read_scene(parse(text, f"{path}:{number}"))
            except InputError as error:
                yield error


def read_scene(root: Field) -> Scene:
    """One line that `groundpose estimate` wrote. Raises InputError naming place and member."""
    objects = root.need("objects").items()
    columns = {name: _column(objects, name, shape) for name, shape in _NUMBERS.items()}
    image, time = root.get("image"), root.get("time")
    with blamed(root.place):
        view = read_view(root)
    status = tuple(item.need("status").text() for item in objects)
    for item, said, place in zip(objects, status, columns["t"], strict=True):
        if said == "ok" and not np.isfinite(place).all():
            item.need("t").fail("numbers, for the status is ok")
    return Scene(
        id=root.need("id").label(),
        time=time.number() if time else None,
        image=Path(image.text()) if image else None,
        view=view,
        ids=tuple(item.need("id").label() for item in objects),
        classes=tuple(item.need("model").text() for item in objects),
        status=status,
        shape_coefficients=tuple(_list(item, "shape_coefficients") for item in objects),
        motion=None,
        **columns,
    )


def _column(objects: list[Field], name: str, shape: tuple[int, ...]) -> FloatArray:
    rows = [_numbers(item, name, shape) for item in objects]
    return np.array(rows, dtype=float).reshape(-1, *shape)


def _numbers(item: Field, name: str, shape: tuple[int, ...]) -> Any:
    """A member as nested lists; null is NaN."""
    member = _MEMBERS.get(name, name)
    field = item.get(member)
    if field is None:
        known = isinstance(item.value, dict) and member in item.value
        return np.full(shape, np.nan) if known or name in _OPTIONAL else item.need(member)
    if not shape:
        return field.number_or_nan()
    if len(shape) == 1:
        return field.numbers(shape[0], unknown=True)
    rows = field.items()
    if len(rows) != shape[0]:
        field.fail(f"{shape[0]} rows")
    return [row.numbers(shape[1], unknown=True) for row in rows]


def _list(item: Field, name: str) -> FloatArray:
    return np.array([value.number_or_nan() for value in item.need(name).items()], dtype=float)
