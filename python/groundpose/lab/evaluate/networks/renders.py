"""Renders of chosen vehicles and cameras on which networks are judged, as crops on disk, and their truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import groundpose as gp
from groundpose._checks import FloatArray, input_error
from groundpose.keypoints.codec import Codec
from groundpose.lab.drive import Label, labels, scene, scene_seed
from groundpose.lab.drive.rigs import CAMERA, Range, Rig
from groundpose.lab.training.crops import Crops, Records, Sample, write_crops
from groundpose.lab.training.rendered import drawn_frames, vehicle_sample
from groundpose.lab.training.streets import moved_boxes

SPLIT, SEED = "test", 0
FRAME_STEP, FRAMES_PER_SHARD, MOST_FRAMES = 10, 10, 1000
PER_FRAME = 8
"""Most vehicles of a frame, so that one crowded place does not decide."""
MOST_HIDDEN, MOST_CUT = 0.5, 0.15
"""Fractions hidden by others and outside the image, as those of the real streets."""
SQUARE_ON_DEG = 20.0
LEAST_HEIGHT = 25.0


@dataclass(frozen=True)
class Wanted:
    """Which vehicles of the held-out drive a set has; it is the source of the set's crops.

    Args:
        rig: of the camera.
        vehicles: how many at least, if `MOST_FRAMES` frames have as many.
        heights: limits of the boxes' heights, pixels.
        square_on: only those seen from within `SQUARE_ON_DEG` degrees of straight in front or behind.
    """

    rig: Rig
    vehicles: int = 200
    heights: tuple[float, float] = (LEAST_HEIGHT, math.inf)
    square_on: bool = False

    def __call__(self, seed: int, split: str, first: int, count: int, codec: Codec) -> Iterator[Sample]:
        """Crops of the vehicles in `count` frames, every `FRAME_STEP`-th of the drives."""
        for frame in drawn_frames(seed, split, first, count, ((1.0, self.rig),), FRAME_STEP):
            for label in [label for label in labels(frame) if self._has(label)][:PER_FRAME]:
                yield vehicle_sample(frame, label, codec)

    def _has(self, label: Label) -> bool:
        """Whether the set has this vehicle."""
        least, most = self.heights
        if self.square_on and abs(math.sin(label.alpha)) < math.cos(math.radians(SQUARE_ON_DEG)):
            return False
        seen = label.occluded_share <= MOST_HIDDEN and label.truncation <= MOST_CUT
        # behind the camera a keypoint has no pixel
        return bool(
            seen and least <= label.bbox[3] - label.bbox[1] < most and np.isfinite(label.keypoints_2d).all()
        )


def _at_height(metres: float, pitch_deg: Range = (-35.0, -20.0), fov_deg: Range = (50.0, 70.0)) -> Rig:
    return Rig((metres, metres), pitch_deg, fov_deg=fov_deg, standing=True)


def _zoomed(factor: float) -> Rig:
    assert CAMERA.image_size is not None
    fov_deg = 2.0 * math.degrees(math.atan(0.5 * CAMERA.image_size[0] / (factor * CAMERA.fx)))
    return Rig(fov_deg=(fov_deg, fov_deg))


_KITTI = Rig(fov_deg=(81.4, 81.4), image_sizes=((1242, 375),))
# KITTI's camera has cars of 25 px at 45 m; that of the rig "car" has them beyond 100 m, where the drive ends

SMALL = "small, square-on"
ROAD_SIDE = {f"{metres:g} m": Wanted(_at_height(metres)) for metres in (3.0, 6.0, 8.0)}
ROAD_SIDE |= {"8 m, 20 deg": Wanted(_at_height(8.0, (-20.0, -20.0), Rig().fov_deg))}
ROAD_SIDE |= {"1.5 m, level": Wanted(Rig((1.5, 1.5)))}
FOCAL = {factor: Wanted(_zoomed(factor), 100) for factor in (0.5, 0.7, 1.0, 1.4, 2.0)}
ROLL = {degrees: Wanted(Rig(roll_deg=(degrees, degrees)), 100) for degrees in (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)}
SETS: dict[str, Wanted] = {
    SMALL: Wanted(_KITTI, 300, (20.0, 30.0), square_on=True),
    **{f"road side, {name}": wanted for name, wanted in ROAD_SIDE.items()},
    **{f"focal length x {factor:g}": wanted for factor, wanted in FOCAL.items()},
    **{f"roll {degrees:g} deg": wanted for degrees, wanted in ROLL.items()},
}
"""Every set by name."""


@dataclass(frozen=True, eq=False)
class Renders:
    """N crops and the truth, frame by frame.

    Attributes:
        views: the true view of each frame. rows: which crops each frame has.
        R: (N, 3, 3), alpha: (N,) KITTI's viewing angle, radians; location: (N, 3) bottom centre.
    """

    crops: Crops
    views: list[gp.View]
    rows: list[NDArray[np.intp]]
    R: FloatArray
    alpha: FloatArray
    location: FloatArray

    @property
    def direction(self) -> FloatArray:
        """(N,) atan2(x, z) of the vehicle."""
        return np.asarray(np.arctan2(self.location[:, 0], self.location[:, 2]))


@cache
def renders(folder: Path, name: str, tell: Callable[[str], None]) -> Renders:
    """A set of `SETS`; what is not in its folder under `folder` is rendered. Every network
    is judged on the same one."""
    wanted = SETS[name]
    place = folder / "evaluated" / "".join(c if c.isalnum() or c == "." else "-" for c in name)
    for frames in range(FRAMES_PER_SHARD, MOST_FRAMES + 1, FRAMES_PER_SHARD):
        write_crops(place, wanted, SPLIT, frames, seed=SEED, frames_per_shard=FRAMES_PER_SHARD)
        crops = Crops(place, SPLIT, wanted.vehicles)
        tell(f"{name}: {len(crops)} of {wanted.vehicles} vehicles")
        if len(crops) == wanted.vehicles:
            break
    return with_truth(crops, wanted.rig)


def with_truth(crops: Crops, rig: Rig) -> Renders:
    """The truth of crops of `Wanted`, from the frames in which they were drawn."""
    views, rows, found = [], [], []
    for number, members in groupby(range(len(crops)), key=lambda i: int(crops.labels["frame"][i])):
        places = list(members)
        frame = scene(scene_seed(crops.index["seed"], SPLIT), number, rigs=((1.0, rig),))
        by_index = {label.index: label for label in labels(frame)}
        found += [labelled(by_index, crops.labels[i]) for i in places]
        views.append(frame.view)
        rows.append(np.array(places))
    R, location = np.array([label.R for label in found]), np.array([label.location for label in found])
    alpha = np.array([label.alpha for label in found])
    return Renders(crops, views, rows, R, alpha, location)


def labelled(seen: dict[int, Label], crop: Records, tolerance: float = 0.01) -> Label:
    """The label of a crop's vehicle among those of its frame, by index; its box is that of the crop within
    `tolerance` pixels.

    Raises:
        InputError: the frame has another vehicle there: another camera or version of the drive drew the crop.
    """
    label = seen.get(int(crop["object"]))
    if label is None or not np.allclose(label.bbox, crop["box"], atol=tolerance):
        raise input_error("crops", "the held-out drive of this version, seen by the same camera", "others")
    return label


def moved(seen: Renders, looks: int, noise: float = 0.03) -> Renders:
    """Every vehicle `looks` times, once with its box and then with the sides of the box moved by a fraction
    `noise` (one standard deviation) of them, as `streets.looks` does."""
    count = len(seen.crops)
    given = np.tile(seen.crops.labels["box"].astype(np.float64), (looks, 1))
    boxes = moved_boxes(given, np.random.default_rng(0), noise)
    boxes[:count] = given[:count]
    starts = count * np.arange(looks)
    return Renders(
        seen.crops.of(np.tile(np.arange(count), looks), boxes),
        seen.views,
        [np.add.outer(starts, rows).ravel() for rows in seen.rows],
        np.tile(seen.R, (looks, 1, 1)),
        np.tile(seen.alpha, looks),
        np.tile(seen.location, (looks, 1)),
    )
