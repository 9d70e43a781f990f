"""Frames whose vehicles' places are known, beside KITTI's: the virtual drive, cameras above a road,
ApolloCar3D; what height and frames are worth there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._checks import FloatArray
from groundpose.keypoints.network import Network
from groundpose.lab.evaluate.networks.judged import found_by
from groundpose.lab.evaluate.networks.renders import Renders, renders
from groundpose.lab.evaluate.real_data import apollo
from groundpose.lab.evaluate.simulated.box_noise import draw_boxes
from groundpose.lab.evaluate.simulated.keypoint_noise import Detector
from groundpose.lab.evaluate.simulated.objects import counts, from_rows, row_of
from groundpose.lab.metrics import percentage
from groundpose.vehicles import shape_model

DRIVES = 40
NEAR = 20.0
"""Metres; nearer, the bends of a road say little of its height under a vehicle."""
OFF_DEG = 3.0
"""Largest error of the nominal pitch and roll of cameras above a road, equally likely up to it."""
OFF_SIGMA = math.radians(2.0)
HIGH, LOW = 1.1, 1 / 1.1
"""Heights that are told wrong, in true ones."""


@dataclass(frozen=True, eq=False)
class Known:
    """One frame: what is seen of its N vehicles, and the truth.

    Attributes:
        truth: the true view; its height is None where nobody knows it.
        given: keypoints, boxes, models, scores and options for `estimate_poses`.
        bottom: (N, 3) bottom centres in the camera.
        drive: frames of one drive have one camera.
    """

    truth: gp.View
    nominal: gp.View
    given: tuple[Any, Any, Any, Any, gp.Options]
    bottom: FloatArray
    drive: int = 0

    def poses(self, view: gp.View, frame: gp.FramePriors | gp.CameraState | None) -> gp.PoseBatch:
        """Of the vehicles in a view."""
        keypoints, boxes, models, scores, options = self.given
        return gp.estimate_poses(view, keypoints, boxes, models, scores, options, 1, frame=frame)


@dataclass(frozen=True)
class Setting:
    """What is known beside the camera."""

    name: str
    height: float | None = None
    """Told, in true ones."""
    priors: gp.FramePriors | None = None
    """None: every vehicle alone."""
    over_frames: bool = False
    exact_tilt: bool = False


_ROAD = gp.FramePriors()
_ABOVE = gp.FramePriors(pitch_sigma=OFF_SIGMA, roll_sigma=OFF_SIGMA)
ON_A_CAR = (
    Setting("every vehicle alone"),
    Setting("one road", None, _ROAD),
    Setting("one road, height", 1.0, _ROAD),
    Setting("one road, height, over frames", 1.0, _ROAD, over_frames=True),
    Setting("one road, height 10 % too large, over frames", HIGH, _ROAD, over_frames=True),
    Setting("one road, height 10 % too small, over frames", LOW, _ROAD, over_frames=True),
)
ABOVE_A_ROAD = (
    Setting("every vehicle alone, exact tilt", exact_tilt=True),
    Setting("every vehicle alone"),
    Setting("one road", None, _ABOVE),
    Setting("one road, height", 1.0, _ABOVE),
)
NO_HEIGHT = (Setting("every vehicle alone"), Setting("one road", None, _ROAD))


def drive(drives: int = DRIVES, seed: int = 1) -> Iterator[Known]:
    """Vehicles that KITTI would count in all frames of drives of the test split, with a detector's boxes and
    the keypoint errors of a CNN. The nominal tilt is that of the rig."""
    from groundpose.lab.drive.drive import scene
    from groundpose.lab.drive.ego import FRAMES_PER_DRIVE
    from groundpose.lab.drive.labels import labels
    from groundpose.lab.drive.splits import scene_seed

    detector = Detector("CNN", 1.0)
    for number in range(drives * FRAMES_PER_DRIVE):
        frame = scene(scene_seed(seed, "test"), number)
        seen = [label for label in labels(frame) if counts(row_of(label))]
        if not seen:
            continue
        vehicles = from_rows(frame.camera, [row_of(label) for label in seen])
        keypoints, scores = detector(vehicles.seen, number)
        assert frame.camera.image_size is not None
        boxes = draw_boxes(vehicles.seen.bboxes, vehicles.occlusion, frame.camera.image_size, number)
        models = vehicles.class_models(shape_model)
        width = max(len(model.keypoints_3d) for model in models)
        mount = frame.mount
        yield Known(
            frame.view,
            gp.View(frame.camera, mount.pitch, mount.roll, frame.height),
            (keypoints[:, :width], boxes, models, scores[:, :width], gp.Options()),
            np.array([label.location for label in seen]),
            number // FRAMES_PER_DRIVE,
        )


def road_side(
    network: Network, crops: Path, metres: float, tell: Callable[[str], None] = lambda text: None
) -> Iterator[Known]:
    """Renders of a camera `metres` above a road as a network sees them; the nominal tilt is up to `OFF_DEG`
    wrong."""
    seen: Renders = renders(crops, f"road side, {metres:g} m", tell)
    rng = np.random.default_rng(0)
    given = found_by(network, seen)
    options = network.certainty.applied(gp.Options())
    for view, rows in zip(seen.views, seen.rows, strict=True):
        off = np.radians(rng.uniform(-OFF_DEG, OFF_DEG, 2))
        nominal = replace(view, pitch=view.pitch + off[0], roll=view.roll + off[1])
        yield Known(view, nominal, (*given(rows), options), seen.location[rows])


def apollo_frames(data: Path) -> Iterator[Known]:
    """Cars of ApolloCar3D's images with keypoints labelled by hand and one shape basis; nobody knows the
    heights of the cameras."""
    objects = apollo(data, known_model=False)
    assert objects.frames is not None
    for name in dict.fromkeys(objects.frames.tolist()):
        some = objects[np.flatnonzero(objects.frames == name).tolist()]
        models = list(some.models)
        bottom = np.array(
            [R @ model.bottom_centre + t for R, t, model in zip(some.R, some.t, models, strict=True)]
        )
        options = gp.Options(inlier_threshold=some.inlier_threshold.tolist())
        given = (some.keypoints_2d, some.bboxes, models, None, options)
        yield Known(some.view, some.view, given, bottom)


Frames = Callable[[], Iterator[Known]]


def sets(
    data: Path, network: str | None, crops: Path | None
) -> dict[str, tuple[Frames, tuple[Setting, ...]]]:
    """Frames and settings by name, as far as their data is there; `crops`: folder of the renders."""
    found: dict[str, tuple[Frames, tuple[Setting, ...]]] = {"drive": (drive, ON_A_CAR)}
    if crops is not None:
        for metres in (6.0, 8.0):
            frames = partial(road_side, Network(network, 1), crops, metres)
            found[f"road side, {metres:g} m"] = frames, ABOVE_A_ROAD
    if (data / "apollo_cars_dev.npz").is_file():
        found["apollo"] = partial(apollo_frames, data), NO_HEIGHT
    return found


@dataclass
class _Sums:
    """What is kept of a setting."""

    errors: list[FloatArray] = field(default_factory=list)
    within: list[FloatArray] = field(default_factory=list)
    distances: list[FloatArray] = field(default_factory=list)
    tilts: list[float] = field(default_factory=list)
    states: dict[int, gp.CameraState] = field(default_factory=dict)

    def add(self, known: Known, poses: gp.PoseBatch) -> None:
        """A frame's."""
        centre = np.array(
            [R @ m.bottom_centre + t for R, t, m in zip(poses.R, poses.t, poses.models, strict=True)]
        ).reshape(-1, 3)
        distance, true = (np.linalg.norm(x, axis=1) for x in (centre, known.bottom))
        ray = centre / distance[:, None]
        variance = np.einsum("ni,nij,nj->n", ray, poses.covariance[:, 3:, 3:], ray)
        self.errors.append(distance / true - 1.0)
        self.within.append(np.abs(distance - true) <= np.sqrt(poses.region(dimensions=1) * variance))
        self.distances.append(true)
        up, estimated = (v.R_camera_from_ground[:, 1] for v in (known.truth, poses.view))
        self.tilts.append(math.degrees(math.atan2(np.linalg.norm(np.cross(up, estimated)), up @ estimated)))

    def numbers(self) -> dict[str, Any]:
        """Their summary."""
        errors, true = np.concatenate(self.errors), np.concatenate(self.distances)
        answered, within = np.isfinite(errors), np.concatenate(self.within).astype(bool)
        percent, near = 100.0 * errors[answered], true[answered] < NEAR
        states = list(self.states.values())
        return {
            "objects": int(answered.sum()),
            "median distance error %": float(np.median(np.abs(percent))),
            "distance bias %": float(np.median(percent)),
            "distance beyond 10 %": percentage(np.abs(percent) > 10.0),
            f"median distance error below {NEAR:g} m %": float(np.median(np.abs(percent[near]))),
            "95 % interval of distance holds %": percentage(within[answered]),
            "median tilt error deg": float(np.median(self.tilts)),
            "drives": len(states),
            "drives with a remark about the height": sum(bool(state.remarks) for state in states),
        }


def measure(frames: Sequence[Known], setting: Setting) -> dict[str, Any]:
    """Numbers of frames with what is known in a setting."""
    sums = _Sums()
    for known in frames:
        height = None if setting.height is None else known.nominal.height
        told = known.truth if setting.exact_tilt else known.nominal
        view = replace(told, height=None if height is None else height * (setting.height or 1.0))
        frame: gp.FramePriors | gp.CameraState | None = setting.priors
        if setting.over_frames:
            frame = sums.states.setdefault(known.drive, gp.CameraState(view, setting.priors))
        sums.add(known, known.poses(view, frame))
    return {"setting": setting.name, **sums.numbers()}
