"""Errors of what was said of each sighted vehicle, against the truth of its frame."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

import groundpose as gp
from groundpose._checks import FloatArray
from groundpose.lab.evaluate.tracks.sequence import Sequence, Truth

Ints = NDArray[np.int64]
FLIPPED_DEG = 30.0
"""A heading farther off than this is another reading."""
KMH = 3.6
PASSAGE, MOVES = 10, 10.0 / KMH
"""Frames of a vehicle whose mean speed counts, and m/s above which it drives past."""


@dataclass(frozen=True, eq=False)
class Said:
    """What was said of n vehicles, each an object of a frame, in the ground frame of the camera then."""

    frame: Ints
    index: Ints
    place: FloatArray
    """(n, 2) metres."""
    place_covariance: FloatArray
    """(n, 2, 2)"""
    heading: FloatArray
    heading_sigma: FloatArray
    speed: FloatArray
    speed_sigma: FloatArray
    size: FloatArray
    """(n, 3) metres."""
    size_sigma: FloatArray
    dof: FloatArray
    """(n,) degrees of freedom of Student's t of the errors."""
    id: Ints
    """Number of the vehicle; -1: none."""

    @classmethod
    def of_tracks(cls, tracks: gp.Tracks) -> Said:
        """Rows of vehicles that were seen."""
        t = tracks[tracks.index >= 0]
        # The camera turned since the first frame: so do the axes of the covariance.
        yaw = t.heading - t.seen_from[:, 2]
        s, c = np.sin(yaw), np.cos(yaw)
        turn = np.stack([np.stack([c, -s], 1), np.stack([s, c], 1)], 1)
        covariance = turn @ t.place_covariance @ turn.transpose(0, 2, 1)
        return cls(
            *(t.frame, t.index, t.seen_from[:, :2], covariance, t.seen_from[:, 2], t.heading_sigma),
            *(t.speed, t.speed_sigma, t.size, t.size_sigma, np.full(len(t), np.inf), t.id),
        )

    @classmethod
    def of_poses(cls, sequence: Sequence) -> Said:
        """Every pose for itself: a vehicle has no speed then."""
        parts = []
        for number, frame in enumerate(sequence.frames):
            poses = frame.poses
            at = np.flatnonzero(poses.ok)
            n = len(at)
            place, heading, covariance = plane_of(poses)
            parts.append(
                (
                    *(np.full(n, number), at, place[at], covariance[at][:, :2, :2], heading[at]),
                    *(np.sqrt(covariance[at][:, 2, 2]), np.full(n, np.nan), np.full(n, np.nan)),
                    *(poses.size[at], poses.size_sigma[at], np.full(n, poses.error_dof), np.full(n, -1)),
                )
            )
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def __getitem__(self, rows: Any) -> Said:
        """Some of them."""
        return Said(*(getattr(self, f.name)[rows] for f in fields(self)))

    def __len__(self) -> int:
        """How many, n."""
        return len(self.frame)


def plane_of(poses: gp.PoseBatch) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places (N, 2), headings (N,) and their covariances (N, 3, 3) on the ground."""
    ground = poses.view.R_camera_from_ground
    middles = np.array([model.bottom_centre for model in poses.models]).reshape(-1, 3, 1)
    arms = (poses.R @ middles)[..., 0]
    by_pose = np.zeros((len(poses), 3, 6))
    axes = ground[:, [0, 2]].T
    for k, arm in enumerate(arms):
        x, y, z = arm
        by_pose[k, :2, :3] = axes @ -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    by_pose[:, :2, 3:] = axes
    by_pose[:, 2, :3] = ground[:, 1]
    covariance = by_pose @ poses.covariance @ by_pose.transpose(0, 2, 1)
    return poses.position[:, [0, 2]], poses.heading, covariance


def wrapped(angle: FloatArray) -> FloatArray:
    """Between -pi and pi."""
    return np.asarray(np.arctan2(np.sin(angle), np.cos(angle)))


@dataclass(frozen=True, eq=False)
class Errors:
    """Of n answers."""

    distance_percent: FloatArray
    yaw_deg: FloatArray
    size_percent: FloatArray
    """Mean of length, height and width."""
    speed_kmh: FloatArray
    place_held: NDArray[np.bool_]
    """Whether the stated 95 % region holds the truth."""
    heading_held: NDArray[np.bool_]
    """Of those that are no other reading."""
    speed_held: NDArray[np.bool_]
    size_held: NDArray[np.bool_]
    standing: NDArray[np.bool_]
    """Whether the truth stands."""

    @classmethod
    def of(cls, said: Said, sequence: Sequence) -> Errors:
        """Against the truth; all answers must be of vehicles that are known."""
        truth = truth_of(said, sequence)
        off = said.place - truth.place
        near = np.linalg.norm(truth.place, axis=1)
        turned = wrapped(said.heading - truth.heading)
        d2 = np.einsum("ni,nij,nj->n", off, np.linalg.inv(said.place_covariance), off)
        dofs = said.dof.tolist()
        plane, one = (
            np.array([{d: gp.region_radius2(0.95, n, d) for d in set(dofs)}[d] for d in dofs]) for n in (2, 1)
        )
        speed = said.speed - truth.speed
        logs = np.log(said.size / truth.size)
        return cls(
            distance_percent=100.0 * np.abs(np.linalg.norm(said.place, axis=1) / near - 1.0),
            yaw_deg=np.degrees(np.abs(turned)),
            size_percent=100.0 * np.abs(logs).mean(axis=1),
            speed_kmh=KMH * np.abs(speed),
            place_held=d2 <= plane,
            heading_held=turned**2 <= one * said.heading_sigma**2,
            speed_held=speed**2 <= one * said.speed_sigma**2,
            size_held=((said.size - truth.size) ** 2 <= one[:, None] * said.size_sigma**2).mean(axis=1)
            > 0.99,
            standing=np.abs(truth.speed) < 0.1,
        )

    def numbers(self) -> dict[str, float | int]:
        """For a table."""
        flipped = self.yaw_deg > FLIPPED_DEG
        # One that is known to stand still would make a median of speeds look good.
        moving = ~np.isnan(self.speed_kmh) & ~self.standing
        found: dict[str, float | int] = {
            "answers": len(self.yaw_deg),
            "yaw above 30 deg %": percent(flipped),
            "median yaw error deg": float(np.median(self.yaw_deg)),
            "median distance error %": float(np.median(self.distance_percent)),
            "median size error %": float(np.nanmedian(self.size_percent)),
            "region of place holds %": percent(self.place_held),
            "interval of heading holds %": percent(self.heading_held[~flipped]),
        }
        if moving.any():
            found["median speed error km/h"] = float(np.median(self.speed_kmh[moving]))
            found["mean speed error km/h"] = float(np.mean(self.speed_kmh[moving]))
            found["interval of speed holds %"] = percent(self.speed_held[moving])
        return found

    @classmethod
    def join(cls, parts: list[Errors]) -> Errors:
        """Those of several sequences."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))


def passages(said: Said, truth: Truth) -> FloatArray:
    """(v,) km/h, errors of the mean speeds of v vehicles, as a traffic engineer wants them: of those seen in
    `PASSAGE` frames or more that drive faster than `MOVES`; `truth` is that of each answer."""
    off = []
    for number in np.unique(truth.id):
        own = (truth.id == number) & np.isfinite(said.speed) & np.isfinite(truth.speed)
        if own.sum() >= PASSAGE and abs(mean := truth.speed[own].mean()) > MOVES:
            off.append(abs(said.speed[own].mean() - mean))
    return KMH * np.array(off)


def percent(hits: NDArray[np.bool_]) -> float:
    """NaN of nothing."""
    return float(100.0 * hits.mean()) if len(hits) else float("nan")


def truth_of(said: Said, sequence: Sequence) -> Truth:
    """The truth of each answer."""
    columns: list[list[Any]] = [[] for _ in fields(Truth)]
    for frame, index in zip(said.frame.tolist(), said.index.tolist(), strict=True):
        known = sequence.frames[frame].truth
        row = int(np.flatnonzero(known.id == sequence.frames[frame].vehicle[index])[0])
        for column, f in zip(columns, fields(Truth), strict=True):
            column.append(getattr(known, f.name)[row])
    return Truth(*(np.array(column) for column in columns))
