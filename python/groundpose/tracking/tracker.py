"""Follows all vehicles before one camera."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import finite, input_error, number, shaped, type_error
from groundpose.poses import PoseBatch
from groundpose.tracking.options import TrackOptions
from groundpose.tracking.seen import SeenVehicles
from groundpose.tracking.tracks import Tracks
from groundpose.types import Camera, View


class Tracker:
    """Follows all vehicles before one camera, frame after frame.

    A vehicle has one identity, one size and one front in all its frames. Answers of `update` know the frames
    so far; those of `finish` and `take` know the later ones too.

    >>> tracker = gp.Tracker(view)
    >>> for time, image in video:
    ...     now = tracker.update(pipeline(image, boxes, view), time)
    >>> tracks = tracker.finish()
    """

    def __init__(self, view: View | Camera | None = None, options: TrackOptions | None = None) -> None:
        """One that has seen nothing.

        Args:
            view: the camera whose poses come, to refuse those of another; None: that of the first frame.
            options: None: the defaults, a camera that stays where it is.

        Raises:
            TypeError: something else.
        """
        if view is not None and not isinstance(view, (View, Camera)):
            raise type_error("view", "a View or a Camera", view)
        if options is not None and not isinstance(options, TrackOptions):
            raise type_error("options", "TrackOptions", options)
        self.camera = view.camera if isinstance(view, View) else view
        self.options = options or TrackOptions()
        self.frames = 0
        """Frames so far."""
        self.skipped: Counter[str] = Counter()
        """Objects that were left out, by reason: those without a pose, or with numbers that cannot be."""
        self._core = self.options.tracker()
        self._names: list[str] = []

    def __repr__(self) -> str:
        """What it has seen."""
        return f"Tracker({self.frames} frames)"

    def update(
        self,
        poses: PoseBatch | SeenVehicles,
        time: float,
        ego_motion: Sequence[float] | None = None,
    ) -> Tracks:
        """The next frame: its vehicles, and those that are not seen for a moment.

        Args:
            poses: of the frame's objects, maybe none. Objects without a pose or with numbers that cannot be
                are left out and counted in `skipped`.
            time: seconds, after that of the frame before.
            ego_motion: with `camera_motion="odometry"`: where the camera is now as the camera before saw it,
                metres right and forward, and radians that it turned to the right; of the first frame not
                needed.

        Raises:
            InputError: a time that is not after the one before, another camera, ego-motion that is missing
                or not expected. The frame is left out then, and nothing else changes.
            TypeError: something else.
        """
        if not isinstance(poses, (PoseBatch, SeenVehicles)):
            raise type_error("poses", "a PoseBatch or SeenVehicles", poses)
        moved = None
        if ego_motion is not None:
            moved = tuple(finite("ego_motion", shaped("ego_motion", ego_motion, (3,))).tolist())
        seconds = number("time", time)
        seen = poses if isinstance(poses, SeenVehicles) else SeenVehicles.of(poses)
        self._check_camera(seen.view.camera)
        classes = self._classes_of(seen.names)
        columns, left_out = self._core.update(
            seconds,
            moved,
            seen.view._handle,
            (seen.R, seen.t, seen.covariance),
            (seen.other_R, seen.other_t, seen.other_covariance),
            seen.bottom_centres,
            seen.numbers(),
            classes,
            seen.error_dof,
        )
        self.camera, self.frames = seen.view.camera, self.frames + 1
        if left_out:
            no_pose: NDArray[np.bool_] = np.asarray(np.isnan(seen.t).any(axis=1))
            self.skipped.update("no pose" if no_pose[k] else reason for k, reason in left_out)
        return Tracks.of(columns, self._names)

    def _classes_of(self, names: Sequence[str]) -> list[int]:
        """Numbers of classes, in the order in which they were seen first."""
        known = {name: k for k, name in enumerate(self._names)}
        found = [known.setdefault(name, len(known)) for name in names]
        self._names = list(known)
        return found

    def _check_camera(self, camera: Camera) -> None:
        if self.camera is not None and camera != self.camera:
            raise input_error("poses", f"those of {self.camera}", f"those of {camera}")

    def take(self) -> Tracks:
        """Smoothed rows of vehicles that have left, and the older ones of those that stay long. Each row is
        handed out once: call it now and then when there is no end."""
        return Tracks.of(self._core.take_finished(), self._names).sorted()

    @property
    def open_frame(self) -> int:
        """Number of the frame, from 0, before which no row is to come any more once `take` has been called:
        what was collected of frames before it is complete."""
        return self._core.open_frame()

    def finish(self) -> Tracks:
        """All vehicles leave: their smoothed rows, and those that `take` has not handed out. Frames may
        follow; their vehicles are new ones."""
        self._core.finish()
        return self.take()
