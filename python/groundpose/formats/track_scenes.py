"""Tracks as other tools want them: a `Scene` for each time, with the vehicles before the camera then."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray, input_error, type_error
from groundpose.formats.conversions import turns_to_the_right
from groundpose.formats.scenes import Motion, Scene
from groundpose.formats.tracks import Names, camera_headings
from groundpose.tracking.tracks import Tracks
from groundpose.types import View

NO_SIZE = "no_size"
"""Status of a vehicle whose size is not known: it has no 3D box."""


def track_scenes(
    tracks: Tracks,
    view: View,
    frames: Names | None = None,
    images: str | PathLike[str] | None = None,
) -> Iterator[Scene]:
    """The frames of tracks in order of time; those in which no vehicle is are not there.

    A vehicle stands upright on the plane `view.height` below the camera, at its place and heading as the
    camera sees them at that time; that plane is taken as exact in its `covariance`. Its `ambiguity` is the
    probability that it faces the other way, its 2D box what the picture shows of its 3D box.

    >>> write_scenes("drive.mcap", track_scenes(tracker.finish(), view))

    Args:
        tracks: of a `Tracker`, or those of a file (`groundpose.formats.track_files.read_tracks`).
        view: the camera, its tilt and its height.
        frames: names of the frames by their number; None: their numbers.
        images: pictures of the frames, `{id}` stands for the frame's name (a number has six digits); None:
            none are at hand.

    Raises:
        InputError: a view without a height, a name of pictures without `{id}`. TypeError: no tracks.
    """
    if not isinstance(tracks, Tracks):
        raise type_error("tracks", "Tracks", tracks)
    if view.height is None:
        raise input_error("view", "one with the camera's height above the ground, for places on it", "none")
    pictures = None if images is None else fspath(images)
    if pictures is not None and "{id}" not in pictures:
        raise input_error("images", "a name with {id}, as pictures/{id}.png", pictures)
    return _scenes(tracks[np.lexsort((tracks.id, tracks.frame))], view, frames or {}, pictures)


def _scenes(tracks: Tracks, view: View, frames: Names, images: str | None) -> Iterator[Scene]:
    cuts = np.flatnonzero(np.diff(tracks.frame)) + 1
    for rows in np.split(np.arange(len(tracks)), cuts) if len(tracks) else ():
        now = tracks[rows]
        number = int(now.frame[0])
        name = frames.get(number, number)
        shown = f"{name:06d}" if isinstance(name, int) else name
        yield _scene(now, view, name, None if images is None else Path(images.replace("{id}", shown)))


def _scene(now: Tracks, view: View, name: str | int, image: Path | None) -> Scene:
    """Of the rows of one time."""
    ground, count, heading = view.R_camera_from_ground, len(now), now.seen_from[:, 2]
    places = np.insert(now.seen_from[:, :2], 1, float(view.height or 0.0), axis=1)
    boxes = _boxes(now.size)
    sized = np.asarray(np.isfinite(boxes).all(axis=(1, 2))).tolist()
    unknown = np.full(count, np.nan)
    made = Scene(
        id=name,
        time=float(now.time[0]),
        image=image,
        view=view,
        ids=tuple(now.id.tolist()),
        classes=tuple(now.name.tolist()),
        status=tuple("ok" if known else NO_SIZE for known in sized),
        R=ground @ turns_to_the_right(heading),
        t=places @ ground.T,
        yaw=heading,
        bbox_3d=boxes,
        bboxes=np.full((count, 4), np.nan),
        scores=unknown,
        probability=unknown,
        ambiguity=1.0 - now.facing_probability,
        covariance=_covariance(now, ground),
        shape_coefficients=(np.zeros(0),) * count,
        motion=_motion(now),
    )
    return replace(made, bboxes=made.shown_boxes)


def _boxes(size: FloatArray) -> FloatArray:
    """(N, 2, 3) metres, lowest and highest corner about the middle of the bottom face, of (N, 3) length,
    height, width."""
    length, height, width = size.T
    low = np.stack([-0.5 * width, -height, -0.5 * length], axis=1)
    high = np.stack([0.5 * width, np.where(np.isnan(height), np.nan, 0.0), 0.5 * length], axis=1)
    return np.stack([low, high], axis=1)


def _covariance(now: Tracks, ground: FloatArray) -> FloatArray:
    """(N, 6, 6) of rotation vector and place in the camera frame; nothing of it leaves the plane."""
    turns = turns_to_the_right(camera_headings(now))
    place = np.zeros((len(now), 3, 3))
    place[np.ix_(range(len(now)), (0, 2), (0, 2))] = now.place_covariance
    axes = ground @ np.swapaxes(turns, 1, 2)  # from the plane of the first frame
    normal = ground[:, 1]
    found = np.zeros((len(now), 6, 6))
    found[:, :3, :3] = now.heading_sigma[:, None, None] ** 2 * np.outer(normal, normal)
    found[:, 3:, 3:] = axes @ place @ np.swapaxes(axes, 1, 2)
    return found


def _motion(now: Tracks) -> Motion:
    turned = camera_headings(now)
    # of any row: where the vehicle is, less the way from the camera to it
    away = (turns_to_the_right(turned[:1]) @ np.insert(now.seen_from[0, :2], 1, 0.0))[0, [0, 2]]
    return Motion(
        speed=now.speed,
        speed_sigma=now.speed_sigma,
        yaw_rate=now.yaw_rate,
        yaw_rate_sigma=now.yaw_rate_sigma,
        acceleration=now.acceleration,
        acceleration_sigma=now.acceleration_sigma,
        standing=now.standing,
        seen=now.index >= 0,
        camera=np.array([*(now.place[0] - away), turned[0]]),
    )
