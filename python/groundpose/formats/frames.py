"""Frames as JSON: what `groundpose estimate` reads.

A frame is one object, in a file of its own or on one line of a JSON-lines file::

    {
      "id": "000123",                        # string or number; default: the line
      "camera": {"fx": 1000, "fy": 1000, "cx": 640, "cy": 360,
                 "distortion": [k1, k2, p1, p2, k3],          # optional, as the lens has them
                 "image_size": [1280, 720],                   # optional
                 "lens": "brown_conrady"},                    # optional, the lens model of the distortion
      "pitch_deg": 0.6, "roll_deg": 0,       # optional, default 0; or
      "gravity": [0.0, 1.0, 0.01],           # downwards, camera frame, instead of the two
      "camera_height": 1.5,                  # optional, metres
      "time": 12.3,                          # optional, seconds
      "image": "000123.png",                 # optional, used by --draw
      "models": {"car": {"keypoints_3d": [[x, y, z], ...],
                         "bbox_3d": [[x, y, z], [x, y, z]],   # the rest is optional
                         "basis": [[[x, y, z], ...], ...], "eigenvalues": [...],
                         "bbox_basis": [[[x, y, z], [x, y, z]], ...],
                         "footprint": [[x, z], ...], "keypoint_names": ["left_lamp", ...]},
                 "van": "van.npz",           # or a file of ShapeModel.save
                 "pickup": "bundled:pickup"},    # or a class of groundpose.vehicles
      "objects": [{"id": 7,                  # optional, default: its number from 0
                   "model": "car",           # optional when there is one model
                   "keypoints_2d": [[u, v], null, ...],       # null = not seen
                   "keypoint_scores": [0.9, 0.0, ...],        # optional
                   "bbox": [left, top, right, null],          # optional, null = not known
                   "truth": {"R": [[...], [...], [...]], "t": [x, y, z]}}]   # optional
    }

Metres and pixels; object x right, y down, z forward. In JSON lines a model is known to all later
lines. Paths are relative to the file. Members that begin with `_` are notes; other unknown members
are errors. `formats.records` says what is written.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from groundpose._checks import FloatArray, blamed, input_error, radians
from groundpose._core import InputError
from groundpose.formats.fields import Field, parse
from groundpose.lens import DEFAULT_LENS, LENSES, lens_name
from groundpose.shape import ARRAYS, ShapeModel
from groundpose.types import Camera, View

BUNDLED = "bundled:"
"""Before the name of a class whose shape model comes with the package."""

_CAMERA = ("fx", "fy", "cx", "cy", "distortion", "image_size", "lens")
_NAMES = "keypoint_names"
_NO_BOX = [math.nan] * 4
_LIMITS = {"pitch_deg": 90.0, "roll_deg": 180.0}
OBJECT_MEMBERS = ("id", "model", "keypoints_2d", "keypoint_scores", "bbox", "truth")
TILT_MEMBERS = ("pitch_deg", "roll_deg", "gravity", "camera_height")
FRAME_MEMBERS = ("id", "time", "camera", *TILT_MEMBERS, "image", "models", "objects")


@dataclass(frozen=True)
class FrameObject:
    """One object of a frame; arrays as in `estimate_poses`, `truth` = `(R, t)`, `score` of its detector."""

    id: str | int
    model: str
    keypoints_2d: FloatArray
    keypoint_scores: list[float] | None
    bbox: list[float] | None
    truth: tuple[FloatArray, FloatArray] | None
    score: float | None = None


@dataclass(frozen=True)
class Frame:
    """One frame: where it came from, the view, its objects and their models, its time in seconds."""

    id: str | int
    place: str
    view: View
    image: Path | None
    objects: tuple[FrameObject, ...]
    models: tuple[ShapeModel, ...]
    time: float | None = None

    @property
    def arguments(self) -> dict[str, Any]:
        """The frame as `estimate_poses` takes it: `estimate_poses(**frame.arguments)`."""
        objects, scores = self.objects, None
        if any(o.keypoint_scores is not None for o in objects):
            scores = [o.keypoint_scores or np.ones(len(o.keypoints_2d)) for o in objects]
        points = [o.keypoints_2d for o in objects]
        alike = len({len(own) for own in points}) == 1  # the usual case, which the core reads as it is
        return {
            "view": self.view,
            "keypoints_2d": np.stack(points) if alike else points,
            "bboxes": np.array([o.bbox or _NO_BOX for o in objects]) if objects else None,
            "models": self.models,
            "keypoint_scores": scores,
        }

    @property
    def truth(self) -> tuple[FloatArray, FloatArray] | None:
        """`(R, t)`, (N, 3, 3) and (N, 3), NaN for objects without; None when no object has one."""
        if all(o.truth is None for o in self.objects):
            return None
        none = (np.full((3, 3), np.nan), np.full(3, np.nan))
        pairs = [o.truth or none for o in self.objects]
        return np.stack([R for R, _ in pairs]), np.stack([t for _, t in pairs])


@dataclass
class FrameSource:
    """Frames of a file or a stream; iterating gives a Frame or, for a bad line, its InputError.

    A text whose first line is a whole object is JSON lines, any other is one frame.
    """

    stream: IO[bytes]
    name: str
    folder: Path

    def __post_init__(self) -> None:
        """Look at the first line. Raises InputError for an empty text."""
        self._numbered = self._lines()
        first = next(self._numbered, None)
        if first is None:
            raise input_error(self.name, "a frame", "an empty file")
        self._head = [first]
        self.lines = first[1].startswith("{") and first[1].endswith("}")
        # A pipe may have its second line much later, and the first is due now.
        if self.lines and self.stream.seekable():
            self._head += [line for line in [next(self._numbered, None)] if line]
        #: Whether there may be more than one frame.
        self.several = self.lines and (len(self._head) > 1 or not self.stream.seekable())

    def __iter__(self) -> Iterator[Frame | InputError]:
        """Frames in order; a bad line gives its error and the next line goes on."""
        models: dict[str, ShapeModel] = {}
        views: dict[str, View] = {}
        for number, text in self.texts():
            place = f"{self.name}:{number}" if self.lines else self.name
            frame: Frame | InputError
            try:
                with blamed(place):
                    frame = read_frame(parse(text, place), self.folder, models, number - 1, views)
            except InputError as error:
                frame = error
            yield frame

    def texts(self) -> Iterator[tuple[int, str]]:
        """The frames' texts and the numbers of their lines."""
        if self.lines:
            yield from self._head
            yield from self._numbered
        else:
            rest = self.stream.read()
            number, text = self._head[0]
            yield 1, "\n" * (number - 1) + text + "\n" + self._decode(rest, number + 1)

    def _lines(self) -> Iterator[tuple[int, str]]:
        """The lines that are not blank, numbered from 1."""
        for number, raw in enumerate(iter(self.stream.readline, b""), 1):
            text = self._decode(raw, number).removeprefix("\ufeff").strip()
            if text:
                yield number, text

    def _decode(self, raw: bytes, number: int) -> str:
        # Surrogates stand for bytes that are not UTF-8; json then reports the line like any other.
        return raw.decode("utf-8", errors="surrogateescape")


def named_images(path: Path) -> list[Path]:
    """The pictures that the frames of a file name, whatever else is wrong with them. Raises OSError."""
    found = []
    with path.open("rb") as stream:
        for number, text in FrameSource(stream, str(path), path.parent).texts():
            with suppress(InputError):
                if image := parse(text, f"{path}:{number}").get("image"):
                    found.append(path.parent / image.text())
    return found


def read_frame(
    root: Field,
    folder: Path,
    models: dict[str, ShapeModel] | None = None,
    default_id: str | int = 0,
    views: dict[str, View] | None = None,
) -> Frame:
    """A frame from its JSON; `models` are those known already, and takes those of this frame; `views` keeps
    the view of the last one, which is mostly that of the next.

    Raises InputError naming the place and the field.
    """
    root.members(FRAME_MEMBERS)
    models = {} if models is None else models
    if field := root.get("models"):
        models.update({name: _model(entry, folder) for name, entry in field.entries()})
    view = _known_view(root, {} if views is None else views)
    items = root.need("objects").items()
    objects = tuple(_object(item, i, models) for i, item in enumerate(items))
    image, name, time = root.get("image"), root.get("id"), root.get("time")
    return Frame(
        id=name.label() if name else default_id,
        place=root.place,
        view=view,
        image=folder / image.text() if image else None,
        objects=objects,
        models=tuple(models[o.model] for o in objects),
        time=time.number() if time else None,
    )


def _known_view(root: Field, views: dict[str, View]) -> View:
    text = repr([root.value.get(name) for name in ("camera", *TILT_MEMBERS)])
    if text not in views:
        view = read_view(root)
        views.clear()
        views[text] = view
    return views[text]


def read_view(root: Field) -> View:
    """Camera and tilt of an object that has them as a frame does. Raises InputError."""
    camera = read_camera(root.need("camera"))
    gravity, height = root.get("gravity"), root.get("camera_height")
    angles = {name: angle for name in _LIMITS if (angle := root.get(name))}
    metres = height.number() if height else None
    if gravity:
        for angle in angles.values():
            angle.fail("gravity or angles", "both")
        down = gravity.numbers(3)
        with gravity.blamed():
            return View.from_gravity(camera, down, metres)
    tilt = {name: radians(angle.where, angle.number(), _LIMITS[name]) for name, angle in angles.items()}
    with root.blamed():
        return View(camera, tilt.get("pitch_deg", 0.0), tilt.get("roll_deg", 0.0), metres)


def read_camera(field: Field) -> Camera:
    """A camera. Raises InputError."""
    field.members(_CAMERA)
    fx, fy, cx, cy = (field.need(name).number() for name in ("fx", "fy", "cx", "cy"))
    coefficients, size, name = field.get("distortion"), field.get("image_size"), field.get("lens")
    with field.blamed():
        lens = lens_name("lens", name.value if name else DEFAULT_LENS)
    distortion = tuple(coefficients.numbers(LENSES[lens].counts)) if coefficients else None
    width, height = size.numbers(2) if size else (None, None)
    with field.blamed():
        return Camera(
            *(fx, fy, cx, cy),
            distortion=distortion,
            image_size=(int(width), int(height)) if width is not None and height is not None else None,
            lens=lens,
        )


def _model(field: Field, folder: Path) -> ShapeModel:
    if isinstance(field.value, str):
        if field.value.startswith(BUNDLED):
            # Its code is large, and most frames bring their models.
            from groundpose.vehicles import shape_model

            with field.blamed():
                return shape_model(field.value.removeprefix(BUNDLED))
        try:
            with field.blamed():
                return ShapeModel.load(folder / field.value)
        except OSError as error:
            field.fail("a file written by ShapeModel.save", f"{field.value}: {error.strerror}")
    field.members((*ARRAYS, _NAMES))
    field.need("keypoints_3d")
    given = {name: member.array(shape) for name, shape in ARRAYS.items() if (member := field.get(name))}
    names = field.get(_NAMES)
    words = tuple(item.text() for item in names.items()) if names else ()
    with field.blamed():
        return ShapeModel(**given, keypoint_names=words, name=field.path.partition(".")[2])


def model_members(model: ShapeModel) -> dict[str, Any]:
    """A model as frames have it, without its name, under which it stands in `models`."""
    given = {name: getattr(model, name) for name in ARRAYS}
    arrays = {name: a.tolist() for name, a in given.items() if a is not None and len(a)}
    return arrays | ({_NAMES: list(model.keypoint_names)} if model.keypoint_names else {})


def _object(field: Field, index: int, models: dict[str, ShapeModel]) -> FrameObject:
    field.members(OBJECT_MEMBERS)
    name = _model_name(field, models)
    count = len(models[name].keypoints_3d)
    points = field.need("keypoints_2d")
    rows = points.value if _are_pixels(points.value) else [_pixel(item) for item in points.items()]
    if len(rows) != count:
        points.fail(f"{count} keypoints as in model {name!r}", str(len(rows)))
    scores, box, truth, label = (field.get(key) for key in ("keypoint_scores", "bbox", "truth", "id"))
    return FrameObject(
        id=label.label() if label else index,
        model=name,
        keypoints_2d=np.array(rows).reshape(count, 2),
        keypoint_scores=scores.numbers(count) if scores else None,
        bbox=box.numbers(4, unknown=True) if box else None,
        truth=read_truth(truth) if truth else None,
    )


def _model_name(field: Field, models: dict[str, ShapeModel]) -> str:
    given = field.get("model")
    if given is None:
        return next(iter(models)) if len(models) == 1 else field.need("model").text()
    if given.text() not in models:
        given.fail(f"one of the models {', '.join(models) or '(none given)'}")
    return given.text()


def _are_pixels(value: Any) -> bool:
    """Whether all are pairs of finite floats, the usual case, which needs no look at each with its path."""
    return type(value) is list and all(
        type(row) is list and len(row) == 2 and all(type(x) is float and x - x == 0.0 for x in row)
        for row in value
    )


def _pixel(field: Field) -> list[float]:
    return [math.nan, math.nan] if field.value is None else field.numbers(2, unknown=True)


def read_truth(field: Field) -> tuple[FloatArray, FloatArray]:
    """A pose `(R, t)`. Raises InputError."""
    field.members(("R", "t"))
    rotation = field.need("R")
    R = np.array(rotation.rows(3))
    if R.shape != (3, 3) or np.abs(R @ R.T - np.eye(3)).max() > 1e-3 or np.linalg.det(R) < 0.0:
        rotation.fail("a rotation matrix, 3 rows of 3")
    return R, np.array(field.need("t").numbers(3))
