"""Poses that `groundpose estimate` wrote as JSON lines, as a tracker takes them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from groundpose._checks import FloatArray
from groundpose._core import InputError
from groundpose.formats.fields import Field, parse
from groundpose.formats.frames import BUNDLED
from groundpose.shape import ShapeModel
from groundpose.tracking.seen import SeenVehicles
from groundpose.types import View
from groundpose.vehicles import CLASSES, shape_model

_SAME = 0.05
"""Fraction of a focal length that a calibration may put right."""


@dataclass(frozen=True, eq=False)
class PosesOfFrame:
    """A line.

    Attributes:
        place: file and line.
        id: the frame's.
        time: seconds; None: the line has none.
        image: path of its picture as written; "" for none.
        labels: of its objects.
        statuses: of its objects, "ok" where a line does not say.
        models: of its objects.
        seen: its vehicles.
    """

    place: str
    id: str | int
    time: float | None
    image: str
    labels: list[str | int]
    statuses: list[str]
    models: list[ShapeModel]
    seen: SeenVehicles


@dataclass
class PoseLines:
    """Poses line by line; iterating gives a frame or, for a bad line, its InputError.

    Args:
        lines: of text.
        name: of the file, for errors.
        view: camera and tilt; lines that have a tilt of their own replace it.
        classes: extra shape models by class; beside the bundled ones.
    """

    lines: Iterable[str]
    name: str
    view: View
    classes: dict[str, ShapeModel] = field(default_factory=dict)

    def __iter__(self) -> Iterator[PosesOfFrame | InputError]:
        """Frames in order; a bad line gives its error and the next one goes on."""
        for number, line in enumerate(self.lines, 1):
            if not line.strip():
                continue
            place = f"{self.name}:{number}"
            try:
                yield self._frame(parse(line, place), number - 1)
            except InputError as error:
                yield error

    def _frame(self, root: Field, number: int) -> PosesOfFrame:
        label, time, image = (root.get(key) for key in ("id", "time", "image"))
        items = root.need("objects").items()
        self._refuse_another(root.get("camera"))
        angles = {key: found.number() for key in ("pitch_deg", "roll_deg") if (found := root.get(key))}
        view, models = self.view, [self._model(item) for item in items]
        with root.blamed():
            if angles:
                pitch, roll = (
                    math.radians(angles[key]) if key in angles else own
                    for key, own in (("pitch_deg", view.pitch), ("roll_deg", view.roll))
                )
                view = View(view.camera, pitch, roll, view.height)
        return PosesOfFrame(
            place=root.place,
            id=number if label is None else label.label(),
            time=None if time is None else time.number(),
            image="" if image is None else image.text(),
            labels=[k if (own := item.get("id")) is None else own.label() for k, item in enumerate(items)],
            statuses=["ok" if (own := item.get("status")) is None else own.text() for item in items],
            models=models,
            seen=self._seen(items, models, view),
        )

    def _refuse_another(self, camera: Field | None) -> None:
        """Poses of a camera that is clearly not ours."""
        if camera is None:
            return
        ours, size = self.view.camera, camera.get("image_size")
        if size is not None and ours.image_size is not None and size.numbers(2) != list(ours.image_size):
            size.fail(f"that of the camera that is given, {ours.image_size}")
        for name, focal in (("fx", ours.fx), ("fy", ours.fy)):
            found = camera.get(name)
            if found is not None and abs(found.number() / focal - 1.0) > _SAME:
                found.fail(f"that of the camera that is given, {focal:g} within {100 * _SAME:g} %")

    def _seen(self, items: list[Field], models: list[ShapeModel], view: View) -> SeenVehicles:
        rows = [_Row.of(item, model, view) for item, model in zip(items, models, strict=True)]

        def stack(name: str, *shape: int) -> FloatArray:
            return np.array([getattr(row, name) for row in rows], dtype=float).reshape(-1, *shape)

        covariance, other_R = stack("covariance", 6, 6), stack("other_R", 3, 3)
        return SeenVehicles(
            view=view,
            names=tuple(row.name for row in rows),
            R=stack("R", 3, 3),
            t=stack("t", 3),
            covariance=covariance,
            other_R=other_R,
            other_t=stack("other_t", 3),
            # lines do not have it: as sure as the answer
            other_covariance=covariance.copy(),
            other_probability=stack("other_probability").reshape(-1),
            bottom_centres=stack("bottom", 3),
            size=stack("size", 3),
            size_sigma=stack("size_sigma", 3),
            bboxes=stack("bbox", 4),
            ambiguity=stack("ambiguity").reshape(-1),
            probability=stack("probability").reshape(-1),
        )

    def _model(self, item: Field) -> ShapeModel:
        name = item.need("model").text().removeprefix(BUNDLED)
        if name not in self.classes:
            if name not in CLASSES:
                item.need("model").fail(f"one of {', '.join(CLASSES)}", name)
            self.classes[name] = shape_model(name)
        return self.classes[name]


@dataclass(frozen=True, eq=False)
class _Row:
    """One object of a line; NaN for what it has not."""

    name: str
    R: FloatArray
    t: FloatArray
    covariance: FloatArray
    other_R: FloatArray
    other_t: FloatArray
    other_probability: float
    bottom: FloatArray
    size: FloatArray
    size_sigma: FloatArray
    bbox: FloatArray
    ambiguity: float
    probability: float

    @classmethod
    def of(cls, item: Field, model: ShapeModel, view: View) -> _Row:
        R, t = _array(item, "R", 3, 3), _array(item, "t", 3)
        size, sigma = _array(item, "size", 3), _array(item, "size_sigma", 3)
        if np.isnan(size).all():
            size, sigma = _size_of(item, model)
        place = _array(item, "position", 3)
        bottom = model.bottom_centre
        if np.isfinite(place).all() and np.isfinite(R).all():  # the size of a frame's vehicles is their own
            bottom = R.T @ (view.R_camera_from_ground @ place - t)
        return cls(
            name=model.name,
            R=R,
            t=t,
            covariance=_array(item, "covariance", 6, 6),
            other_R=_array(item, "alternative_R", 3, 3),
            other_t=_array(item, "alternative_t", 3),
            other_probability=_number(item, "alternative_probability"),
            bottom=bottom,
            size=size,
            size_sigma=sigma,
            bbox=_array(item, "bbox", 4),
            ambiguity=_number(item, "ambiguity"),
            probability=_number(item, "probability"),
        )


def _size_of(item: Field, model: ShapeModel) -> tuple[FloatArray, FloatArray]:
    """Of the shape coefficients."""
    coefficients = _array(item, "shape_coefficients", None)
    covariance = _array(item, "shape_covariance", None, None)
    modes = model.modes
    if len(coefficients) < modes or not np.isfinite(coefficients[:modes]).all():
        return np.full(3, np.nan), np.full(3, np.nan)
    size, slopes = model.stretched_size(coefficients[:modes])
    if covariance.shape[0] < modes or covariance.shape[-1] < modes:
        return size, np.full(3, np.nan)
    variance = ((covariance[:modes, :modes] @ slopes) * slopes).sum(axis=0)
    return size, size * np.sqrt(np.maximum(variance, 0.0))


def _number(item: Field, key: str) -> float:
    found = item.get(key)
    return math.nan if found is None else found.number()


def _array(item: Field, key: str, *shape: int | None) -> FloatArray:
    """Numbers of a shape (None: any length), null for NaN; all NaN (or none) without them."""
    found = item.get(key)
    empty = np.full([0 if n is None else n for n in shape], np.nan)
    if found is None:
        return empty
    try:
        array = np.array(found.value, dtype=float)
    except (TypeError, ValueError):
        found.fail(f"numbers of shape {shape}", "something else")
    if array.ndim != len(shape) or any(
        n is not None and n != m for n, m in zip(shape, array.shape, strict=True)
    ):
        if array.size == 0:
            return empty
        found.fail(f"numbers of shape {shape}", f"shape {array.shape}")
    return array
