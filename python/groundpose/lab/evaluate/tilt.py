"""The tilt on real roads: how much the errors of rotation fall when a frame's tilt comes from all its
objects.

A road never has quite its nominal tilt. Compared are ways to deal with that: the nominal tilt as fixed as the
default has it, forgotten after the search, or estimated from the objects of each image together; with a
nominal tilt that is right for the set, off by some degrees, or not known at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import groundpose as gp
from groundpose.lab.contenders.contender import nothing
from groundpose.lab.contenders.objects import Array
from groundpose.lab.contenders.own import DEFAULT, Own
from groundpose.lab.evaluate.real_data import RealObjects
from groundpose.lab.metrics import NO_ANSWER_E_R_DEG, rotation_error_deg, summarise, yaw_between_deg

Row = dict[str, Any]


@dataclass(frozen=True)
class TiltWay:
    """One way to use a nominal tilt."""

    name: str
    nominal_deg: float
    contender: Own = DEFAULT
    frame_sigma_deg: float | None = None


def ways(prior_deg: float, spread_deg: float, off_deg: float) -> list[TiltWay]:
    """What is compared on a set with this mean tilt and this spread between images.

    `off_deg`: the error of a nominal tilt that is wrong for all images.
    """
    free = Own("forgotten", options={"tilt_sigma": math.inf})
    loose = Own("wider prior", options={"tilt_sigma": math.radians(max(spread_deg, 1.5) * 2.0)})
    wrong = prior_deg + off_deg
    return [
        TiltWay("the set's mean, fixed", prior_deg),
        TiltWay("the set's mean, wider prior", prior_deg, loose),
        TiltWay("the set's mean, forgotten after the search", prior_deg, free),
        TiltWay("the set's mean, then the frame's", prior_deg, DEFAULT, max(spread_deg, 0.5)),
        TiltWay(f"wrong by {off_deg:g} deg, fixed", wrong),
        TiltWay(f"wrong by {off_deg:g} deg, forgotten after the search", wrong, free),
        TiltWay(f"wrong by {off_deg:g} deg, then the frame's", wrong, DEFAULT, max(abs(off_deg), 0.5)),
    ]


def table(objects: RealObjects, compared: list[TiltWay], use_scores: bool = True) -> list[Row]:
    """One line a way, and at last the tilt that the labels of each image agree on.

    ValueError for objects whose images are not known.
    """
    truth = _truth_lines(objects)
    lines = [_line(objects, way, use_scores, truth) for way in compared]
    views = {key: _view_of(objects, rows) for key, rows in _frames(objects)}
    R, _ = _estimate(objects, DEFAULT, lambda key: views[key], None, use_scores)
    return [*lines, {"tilt": "as the labels of the image agree on", **_errors(objects, R, truth, None)}]


def _line(objects: RealObjects, way: TiltWay, use_scores: bool, truth: dict[Any, Array]) -> Row:
    nominal = replace(objects.view, pitch=math.radians(way.nominal_deg), roll=0.0)
    sigma = None if way.frame_sigma_deg is None else math.radians(way.frame_sigma_deg)
    R, found = _estimate(objects, way.contender, lambda _: nominal, sigma, use_scores)
    return {"tilt": way.name, "nominal deg": way.nominal_deg, **_errors(objects, R, truth, found)}


def _estimate(
    objects: RealObjects,
    contender: Own,
    view: Callable[[Any], gp.View],
    sigma: float | None,
    use_scores: bool,
) -> tuple[Array, dict[Any, gp.View]]:
    """R of all objects, image by image, and the view that each image ended with."""
    R, found = nothing(len(objects))[0], {}
    given = objects if use_scores else objects.without_scores()
    for key, rows in _frames(objects):
        frame = replace(given[rows], view=view(key), frame_tilt_sigma=sigma)
        poses = contender.poses(frame)
        R[rows], found[key] = poses.R, poses.view
    return R, found


def _frames(objects: RealObjects) -> Iterator[tuple[Any, list[int]]]:
    if objects.frames is None:
        raise ValueError(f"{objects.name}: expected the image of each object, got none")
    for key in np.unique(objects.frames):
        yield key, np.flatnonzero(objects.frames == key).tolist()


def _view_of(objects: RealObjects, rows: list[int]) -> gp.View:
    """The view in which the labelled objects of an image stand upright, as far as they agree."""
    down = np.median(objects.R[rows, :, 1], axis=0)
    return gp.View.from_gravity(objects.view.camera, down)


def _truth_lines(objects: RealObjects) -> dict[Any, Array]:
    return {key: _view_of(objects, rows).R_camera_from_ground[:, 1] for key, rows in _frames(objects)}


def _errors(objects: RealObjects, R: Array, truth: dict[Any, Array], found: dict[Any, gp.View] | None) -> Row:
    """Errors of rotation; the error of yaw is about the labelled up axis; that of the tilt in the median
    image."""
    e_r = rotation_error_deg(objects.R, R)
    summary = summarise(e_r, np.where(np.isnan(e_r), np.nan, 0.0))
    yaw = yaw_between_deg(objects.R, R)
    yaw = np.where(np.isnan(yaw), NO_ANSWER_E_R_DEG, yaw)
    row = {
        "median e_r deg": summary.median_e_r_deg,
        "mean e_r deg": summary.mean_e_r_deg,
        "above 15 deg %": 100 * summary.above_15_deg,
        "median yaw error deg": float(np.median(yaw)),
        "no answer": round((1 - summary.answered) * summary.trials),
    }
    if found is None:
        return row
    cosines = [truth[key] @ view.R_camera_from_ground[:, 1] for key, view in found.items()]
    tilt = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    return {**row, "median tilt error of an image deg": float(np.median(tilt))}
