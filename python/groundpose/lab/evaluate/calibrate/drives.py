"""Traffic before masts, labelled only: what a network would see of it, with the true camera."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import groundpose as gp
from groundpose._checks import FloatArray
from groundpose.lab.drive import cache as disk
from groundpose.lab.drive import video
from groundpose.lab.drive.labels import Label, labels
from groundpose.lab.drive.rigs import Rigs, rigs
from groundpose.lab.drive.splits import scene_seed
from groundpose.lab.drive.traffic import DEFAULT_SHARES
from groundpose.lab.drive.video.clip import VideoFrame, make_clip, video_frame
from groundpose.lab.evaluate.simulated.keypoint_noise import VISIBLE, Detector, Seen
from groundpose.lab.evaluate.simulated.objects import from_rows, row_of
from groundpose.self_calibration.sightings import Sightings
from groundpose.vehicles import CLASSES, shape_model

MASTS: Rigs = rigs("mast", (5.0, 10.0), (-35.0, -10.0), (-3.0, 3.0), (40.0, 80.0))
"""Cameras of the evaluation: 5 to 10 m, 10 to 35 degrees down."""

QUALITY = 0.25
"""Of the simulated detector, as networks are on pictures of the kind they learned."""
MODE = 0.008
"""Standard deviation of each affine mode of a network's errors, which its keypoints share, over the longer
side of the box; half of its variance stays with the vehicle."""
LEAST_PX, MOST_HIDDEN = 30.0, 0.5
"""Smaller and more hidden vehicles are left out."""
CLASS_SIGMA = 0.08
"""Standard deviation of the logarithm of a class' mean size in another region."""


@dataclass(frozen=True)
class Truth:
    """Pitch, roll (radians) and height (metres) of the camera over the plane through the contacts of the
    vehicles; log size of each class over its model's; mean pitch over the road right under the camera."""

    pitch: float
    roll: float
    height: float
    scales: dict[str, float]
    pitch_under: float


def sightings(
    seed: int, seconds: int, varied: bool = True, split: str = "validation"
) -> tuple[Sightings, Truth]:
    """One frame a second of the traffic before a mast.

    Args:
        seed: of the drive and of everything else.
        seconds: frames.
        varied: whether the mean sizes of the classes differ from those of the shape models, by CLASS_SIGMA.
        split: whose bodies are used.
    """
    clip = make_clip(scene_seed(seed, split), seconds, 1.0, tuple(DEFAULT_SHARES.items()), MASTS)
    rng = np.random.default_rng((seed, 41))
    sigma = CLASS_SIGMA if varied else 0.0
    scales = {name: float(rng.normal(0.0, sigma)) if sigma else 0.0 for name in CLASSES}
    frames = [video_frame(clip, k) for k in range(seconds)]
    rows, tracks, times, contacts = [], [], [], []
    for frame in frames:
        for label in labels(frame.scene):
            if usable(label):
                rows.append(row_of(scaled(label, frame, scales[label.class_name])))
                tracks.append(int(frame.track[label.index]))
                times.append(frame.time)
                contacts.append(label.location)
    vehicles = from_rows(frames[0].scene.camera, rows)
    keypoints, scores = network_like(vehicles.seen, np.array(tracks), rng)
    models = vehicles.class_models(shape_model)
    lengths = [len(model.keypoints_3d) for model in models]
    n, height = plane_through(np.array(contacts))
    plane = gp.View.from_gravity(vehicles.camera, n)
    under = float(np.mean([f.scene.pitch for f in frames]))
    truth = Truth(plane.pitch, plane.roll, height, scales, under)
    return Sightings(
        camera=vehicles.camera,
        keypoints_2d=tuple(k[:n] for k, n in zip(keypoints, lengths, strict=True)),
        keypoint_scores=tuple(np.nan_to_num(s[:n]) for s, n in zip(scores, lengths, strict=True)),
        bboxes=vehicles.seen.bboxes,
        models=tuple(models),
        vehicles=np.array(tracks),
        times=np.array(times),
    ), truth


def plane_through(points: FloatArray) -> tuple[FloatArray, float]:
    """Unit normal (3,), downwards, and distance from the camera of the plane nearest to points (N, 3)."""
    middle = points.mean(axis=0)
    n = np.linalg.svd(points - middle)[2][2]
    n = n if n[1] > 0.0 else -n
    return n, float(n @ middle)


_SOURCES = (Path(video.__file__).parent, Path(__file__))


def kept(seed: int, seconds: int) -> tuple[Sightings, Truth]:
    """`sightings`, kept on disk between runs, because traffic takes a minute."""

    def make() -> disk.Arrays:
        found, truth = sightings(seed, seconds)
        camera, size = found.camera, found.camera.image_size
        assert size is not None
        return {
            "camera": np.array([camera.fx, camera.fy, camera.cx, camera.cy, *size], dtype=float),
            "keypoints": np.concatenate(found.keypoints_2d),
            "scores": np.concatenate(found.keypoint_scores),
            "bboxes": found.bboxes,
            "classes": np.array([CLASSES.index(model.name) for model in found.models]),
            "vehicles": found.vehicles,
            "times": found.times,
            "truth": np.array(
                [truth.pitch, truth.roll, truth.height, truth.pitch_under, *truth.scales.values()]
            ),
        }

    keys = frozenset(["camera", "keypoints", "scores", "bboxes", "classes", "vehicles", "times", "truth"])
    folder = disk.version_folder("sightings", disk.fingerprint(_SOURCES))
    return _unpacked(disk.arrays(f"{folder}/{seed}-{seconds}", keys, make))


def _unpacked(arrays: disk.Arrays) -> tuple[Sightings, Truth]:
    fx, fy, cx, cy, width, height = arrays["camera"].tolist()
    models = tuple(shape_model(CLASSES[k]) for k in arrays["classes"].tolist())
    edges = np.cumsum([len(model.keypoints_3d) for model in models])[:-1]
    pitch, roll, metres, under, *scales = arrays["truth"].tolist()
    found = Sightings(
        gp.Camera(fx, fy, cx, cy, image_size=(int(width), int(height))),
        tuple(np.split(arrays["keypoints"], edges)),
        tuple(np.split(arrays["scores"], edges)),
        arrays["bboxes"],
        models,
        arrays["vehicles"],
        arrays["times"],
    )
    return found, Truth(pitch, roll, metres, dict(zip(CLASSES, scales, strict=True)), under)


def usable(label: Label) -> bool:
    """Whether a detector finds it well enough."""
    left, top, right, bottom = label.bbox
    large = min(right - left, bottom - top) >= LEAST_PX
    return bool(large and label.occluded_share <= MOST_HIDDEN and label.truncation < 0.02)


def scaled(label: Label, frame: VideoFrame, log_scale: float) -> Label:
    """The label of a vehicle that is larger by a factor and stands where it stood."""
    factor = float(np.exp(log_scale))
    camera = frame.scene.camera
    points = factor * label.keypoints_3d
    pixels = camera.project(points @ label.R.T + label.t)
    near, far = (
        camera.project(corners(box) @ label.R.T + label.t) for box in (label.bbox_3d, factor * label.bbox_3d)
    )
    moved = np.concatenate([far.min(axis=0) - near.min(axis=0), far.max(axis=0) - near.max(axis=0)])
    return dataclasses.replace(
        label,
        keypoints_3d=points,
        keypoints_2d=pixels,
        bbox=label.bbox + moved,
        bbox_3d=factor * label.bbox_3d,
    )


def corners(box: FloatArray) -> FloatArray:
    """(8, 3) of a box (2, 3)."""
    return np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def network_like(
    seen: Seen, tracks: NDArray[np.int64], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Keypoints and scores with errors as a network's: outliers and noise of its own for each, and affine
    modes that all keypoints share, half of them the same in all frames of a vehicle."""
    keypoints, scores = Detector("network-like", QUALITY)(seen, int(rng.integers(2**31)))
    low, high = seen.bboxes[:, :2], seen.bboxes[:, 2:]
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    place = (keypoints - middle[:, None]) / np.maximum(half, 1.0)[:, None]
    modes = np.concatenate([np.ones((*place.shape[:2], 1)), place], axis=2)
    _, vehicle = np.unique(tracks, return_inverse=True)
    own = rng.standard_normal((vehicle.max() + 1, 3, 2))[vehicle]
    fresh = rng.standard_normal((len(tracks), 3, 2))
    amounts = MODE * seen.longer[:, None, None] * np.sqrt(0.5) * (own + fresh)
    return keypoints + modes @ amounts, np.where(seen.state == VISIBLE, scores, 0.5 * scores)


def first_vehicles(given: Sightings, count: int) -> Sightings:
    """The sightings of the vehicles that came first."""
    order: dict[int, Any] = dict.fromkeys(given.vehicles.tolist())
    kept = set(list(order)[:count])
    return given[np.array([v in kept for v in given.vehicles.tolist()])]
