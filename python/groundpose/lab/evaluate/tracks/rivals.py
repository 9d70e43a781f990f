"""What others do with the same boxes and poses: SORT on the boxes, a plain Kalman filter on the poses."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error
from groundpose.lab.evaluate.kitti.overlap import image_overlap
from groundpose.lab.evaluate.tracks.drive import moved
from groundpose.lab.evaluate.tracks.errors import Said, plane_of, wrapped
from groundpose.lab.evaluate.tracks.sequence import Sequence


def assignment(cost: FloatArray) -> list[tuple[int, int]]:
    """Pairs (row, column) of least cost. Raises InputError without scipy."""
    try:
        from scipy.optimize import linear_sum_assignment
    except ModuleNotFoundError:
        raise input_error("rivals", "scipy (pip install 'groundpose[tracks]')", "no package scipy") from None
    rows, columns = linear_sum_assignment(cost)
    return list(zip(rows.tolist(), columns.tolist(), strict=True))


class Kalman:
    """A linear Kalman filter."""

    def __init__(self, x: FloatArray, P: FloatArray) -> None:
        """Mean and covariance."""
        self.x, self.P = x, P

    def predict(self, F: FloatArray, Q: FloatArray) -> None:
        """One step."""
        self.x, self.P = F @ self.x, F @ self.P @ F.T + Q

    def update(self, H: FloatArray, z: FloatArray, R: FloatArray) -> None:
        """One measurement."""
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        self.x = self.x + K @ (z - H @ self.x)
        self.P = (np.eye(len(self.x)) - K @ H) @ self.P


@dataclass
class SortTrack:
    """A box over time: middle, area, ratio of sides, and how the first three change."""

    filter: Kalman
    id: int
    hits: int = 1
    misses: int = 0

    @property
    def box(self) -> FloatArray:
        """(4,) px."""
        u, v, area, ratio = self.filter.x[:4].tolist()
        width = np.sqrt(max(area * ratio, 1.0))
        height = max(area, 1.0) / width
        return np.array([u - width / 2, v - height / 2, u + width / 2, v + height / 2])


def _measured(box: FloatArray) -> FloatArray:
    width, height = box[2] - box[0], box[3] - box[1]
    return np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2, width * height, width / height])


@dataclass
class Sort:
    """SORT (Bewley et al. 2016) with its published numbers, but for a patience in frames."""

    least_overlap: float = 0.3
    patience: int = 3
    tracks: list[SortTrack] = field(default_factory=list)
    last_id: int = 0

    def update(self, boxes: FloatArray, steps: int) -> NDArray[np.int64]:
        """Numbers (N,) of the vehicles in boxes (N, 4), `steps` frames after the last."""
        F = np.eye(7)
        F[[0, 1, 2], [4, 5, 6]] = 1.0
        Q = np.diag([1.0, 1.0, 1.0, 1.0, 0.01, 0.01, 1e-4])
        for track in self.tracks:
            for _ in range(steps):
                if track.filter.x[2] + track.filter.x[6] <= 0.0:
                    track.filter.x[6] = 0.0
                track.filter.predict(F, Q)
            track.misses += steps
        ids = np.full(len(boxes), -1, dtype=np.int64)
        if self.tracks and len(boxes):
            overlap = image_overlap(np.array([t.box for t in self.tracks]), boxes)
            for row, column in assignment(-overlap):
                if overlap[row, column] >= self.least_overlap:
                    track = self.tracks[row]
                    track.filter.update(
                        np.eye(4, 7), _measured(boxes[column]), np.diag([1.0, 1.0, 10.0, 10.0])
                    )
                    track.hits, track.misses = track.hits + 1, 0
                    ids[column] = track.id
        for column in np.flatnonzero(ids < 0).tolist():
            self.last_id += 1
            P = np.diag([10.0, 10.0, 10.0, 10.0, 1e4, 1e4, 1e4])
            start = Kalman(np.concatenate([_measured(boxes[column]), np.zeros(3)]), P)
            self.tracks.append(SortTrack(start, self.last_id))
            ids[column] = self.last_id
        self.tracks = [track for track in self.tracks if track.misses <= self.patience]
        return ids


def sort(sequence: Sequence, frame_interval: float, patience: int = 3) -> Said:
    """The poses of every frame alone, with the numbers that SORT gives their boxes."""
    said, tracker, last, numbers = Said.of_poses(sequence), Sort(patience=patience), None, {}
    for k, frame in enumerate(sequence.frames):
        steps = 1 if last is None else max(1, round((frame.time - last) / frame_interval))
        last = frame.time
        ids = tracker.update(frame.poses.bboxes, steps)
        numbers.update({(k, i): number for i, number in enumerate(ids.tolist())})
    said.id[:] = [numbers[key] for key in zip(said.frame.tolist(), said.index.tolist(), strict=True)]
    return said


GATE = 9.21
"""Of the plain filter: squared statistical distance of 99 % in two dimensions."""
_ACCELERATION, _SPEED, _TURNING = 2.0, 10.0, 0.3
_GONE = 1.5
"""Seconds."""


@dataclass
class Plain:
    """Constant velocity, and a heading of its own; errors of frames taken as independent."""

    place: Kalman
    heading: Kalman
    id: int
    seen: float


def plain_kalman(sequence: Sequence) -> Said:
    """A plain Kalman filter on the poses of every frame, without their other readings and what frames
    share."""
    tracks: list[Plain] = []
    rows: list[tuple[int, int, Plain, FloatArray, FloatArray]] = []
    last, before, last_id, said = None, (0.0, 0.0, 0.0), 0, Said.of_poses(sequence)
    for k, frame in enumerate(sequence.frames):
        dt = 0.0 if last is None else frame.time - last
        last = frame.time
        tracks = [track for track in tracks if frame.time - track.seen <= _GONE]
        for track in tracks:
            _predict(track, dt)
            if sequence.camera_motion == "odometry":
                see_from(track, moved(before, frame.ego))
        before = frame.ego
        place, heading, covariance = plane_of(frame.poses)
        found = np.flatnonzero(frame.poses.ok)
        for known, i in _pairs(tracks, place, covariance, found):
            if known is None:
                last_id += 1
                track = _started(last_id, place[i], heading[i], covariance[i])
                tracks.append(track)
            else:
                track = known
                track.place.update(np.eye(2, 4), place[i], covariance[i, :2, :2])
                turned = wrapped(np.array([heading[i] - track.heading.x[0]]))
                track.heading.update(np.eye(1, 2), track.heading.x[:1] + turned, covariance[i, 2:, 2:])
            track.seen = frame.time
            state = np.concatenate([track.place.x, track.heading.x])
            spread = np.zeros((6, 6))
            spread[:4, :4], spread[4:, 4:] = track.place.P, track.heading.P
            rows.append((k, int(i), track, state, spread))
    return _said(rows, said)


def _started(number: int, place: FloatArray, heading: float, covariance: FloatArray) -> Plain:
    P = np.zeros((4, 4))
    P[:2, :2], P[2:, 2:] = covariance[:2, :2], np.eye(2) * _SPEED**2
    turning = Kalman(np.array([heading, 0.0]), np.diag([covariance[2, 2], _TURNING**2]))
    return Plain(Kalman(np.concatenate([place, np.zeros(2)]), P), turning, number, 0.0)


def _predict(track: Plain, dt: float) -> None:
    F, Q = np.eye(4), np.zeros((4, 4))
    F[:2, 2:] = dt * np.eye(2)
    for i, j, value in ((0, 0, dt**3 / 3), (0, 2, dt**2 / 2), (2, 0, dt**2 / 2), (2, 2, dt)):
        Q[i : i + 2, j : j + 2] = _ACCELERATION**2 * value * np.eye(2)
    track.place.predict(F, Q)
    q = _TURNING**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    track.heading.predict(np.array([[1.0, dt], [0.0, 1.0]]), q)


def see_from(track: Plain, ego: tuple[float, float, float]) -> None:
    """From where the camera is now: right, forward, turned to the right."""
    s, c = np.sin(ego[2]), np.cos(ego[2])
    turn = np.kron(np.eye(2), np.array([[c, -s], [s, c]]))
    track.place.x = turn @ (track.place.x - np.array([ego[0], ego[1], 0.0, 0.0]))
    track.place.P = turn @ track.place.P @ turn.T
    track.heading.x = track.heading.x - np.array([ego[2], 0.0])


def _pairs(
    tracks: list[Plain], place: FloatArray, covariance: FloatArray, found: NDArray[np.intp]
) -> list[tuple[Plain | None, int]]:
    """Tracks with the objects that they are; None: an object that is new."""
    cost = np.full((len(tracks), len(found)), 1e3)
    for row, track in enumerate(tracks):
        for column, i in enumerate(found):
            off = place[i] - track.place.x[:2]
            d2 = off @ np.linalg.inv(track.place.P[:2, :2] + covariance[i, :2, :2]) @ off
            cost[row, column] = d2 if d2 < GATE else 1e3
    chosen = {column: row for row, column in assignment(cost) if cost[row, column] < GATE} if tracks else {}
    return [(tracks[chosen[c]] if c in chosen else None, int(i)) for c, i in enumerate(found)]


def _said(rows: list[tuple[int, int, Plain, FloatArray, FloatArray]], alone: Said) -> Said:
    state, spread = np.stack([row[3] for row in rows]), np.stack([row[4] for row in rows])
    order = np.lexsort(([row[1] for row in rows], [row[0] for row in rows]))
    same = np.lexsort((alone.index, alone.frame))
    s, c = np.sin(state[:, 4]), np.cos(state[:, 4])
    along = np.stack([s, c], axis=1)
    variance = np.einsum("ni,nij,nj->n", along, spread[:, 2:4, 2:4], along)
    found = Said(
        *(np.array([row[0] for row in rows]), np.array([row[1] for row in rows])),
        *(state[:, :2], spread[:, :2, :2], wrapped(state[:, 4]), np.sqrt(spread[:, 4, 4])),
        *(state[:, 2] * s + state[:, 3] * c, np.sqrt(variance), np.full((len(rows), 3), np.nan)),
        *(np.full((len(rows), 3), np.nan), np.full(len(rows), np.inf)),
        np.array([row[2].id for row in rows]),
    )[order]
    found.size[:], found.size_sigma[:] = alone.size[same], alone.size_sigma[same]
    return found
