"""Cameras, views and shape models as values of Arrow tables, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from functools import lru_cache
from typing import Any

import numpy as np

from groundpose._checks import input_error
from groundpose.formats.arrow_schema import ESTIMATED
from groundpose.formats.frames import BUNDLED, model_members
from groundpose.frame import EstimatedView
from groundpose.shape import ARRAYS, ShapeModel
from groundpose.types import Camera, View
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.shape_models import shape_model

_CAMERA = tuple(f.name for f in fields(Camera) if f.init)
_NAME = "name"


def camera_value(camera: Camera) -> dict[str, Any]:
    """The members of a camera."""
    return {name: getattr(camera, name) for name in _CAMERA}


def camera_of(value: Mapping[str, Any]) -> Camera:
    """A camera of its members. Raises InputError."""
    given = {name: member for name, member in value.items() if member is not None}
    tuples = {name: tuple(member) for name, member in given.items() if isinstance(member, list)}
    missing = [name for name in ("fx", "fy", "cx", "cy") if name not in given]
    if missing:
        raise input_error("camera", f"a number {missing[0]}", "none")
    return Camera(**{**given, **tuples})


def view_value(view: View) -> dict[str, Any]:
    """The members of a view; `estimated` of one that vehicles show."""
    value = {
        "camera": camera_value(view.camera),
        "pitch": view.pitch,
        "roll": view.roll,
        "height": view.height,
    }
    if isinstance(view, EstimatedView):
        scales = [{"class": name, "mean": m, "sigma": s} for name, (m, s) in view.class_scales.items()]
        numbers = {name: getattr(view, name) for name in ESTIMATED}
        value["estimated"] = {**numbers, "covariance": view.covariance.tolist(), "class_scales": scales}
    return value


def view_of(value: Mapping[str, Any]) -> View:
    """A view of its members. Raises InputError."""
    camera = camera_of(value["camera"])
    nominal = (camera, value["pitch"] or 0.0, value["roll"] or 0.0, value["height"])
    estimated = value.get("estimated")
    if estimated is None:
        return View(*nominal)
    scales = {scale["class"]: (scale["mean"], scale["sigma"]) for scale in estimated["class_scales"]}
    numbers = {name: estimated[name] for name in ESTIMATED}
    covariance = np.array(estimated["covariance"], dtype=float)
    return EstimatedView(*nominal, **numbers, covariance=covariance, class_scales=scales)


def model_text(model: ShapeModel) -> str:
    """`bundled:CLASS` of a model of the package, else the model as JSON, as frames have it, with its name."""
    if model.name in CLASSES and _equal(model, shape_model(model.name)):
        return BUNDLED + model.name
    return json.dumps({_NAME: model.name, **model_members(model)})


def _equal(model: ShapeModel, other: ShapeModel) -> bool:
    """Whether all of them is the same: a model that was pickled is another object."""
    names = model.keypoint_names == other.keypoint_names
    return names and all(np.array_equal(getattr(model, name), getattr(other, name)) for name in ARRAYS)


@lru_cache(256)
def model_of(text: str) -> ShapeModel:
    """A model of its text. Raises InputError."""
    if text.startswith(BUNDLED):
        return shape_model(text.removeprefix(BUNDLED))
    try:
        members = json.loads(text)
        return ShapeModel(**members)
    except (ValueError, TypeError, RecursionError) as error:
        raise input_error(
            "model", f"{BUNDLED}CLASS or a shape model as JSON", f"{text[:80]!r}: {error}"
        ) from None
