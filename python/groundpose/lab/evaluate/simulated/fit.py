"""Where the numbers of `box_noise` and `keypoint_noise` come from.

`groundpose evaluate detector` prints them; it needs the real data (GROUNDPOSE_DATA).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from groundpose.lab.contenders.objects import Array
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.real_data import kitti
from groundpose.lab.evaluate.simulated.box_noise import SIDES, BoxNoise, SideNoise, at_border, draw_boxes
from groundpose.lab.evaluate.simulated.keypoint_noise import (
    DOUBTFUL,
    EDGES,
    FOUND,
    HIDDEN,
    KINDS,
    VISIBLE,
    Detector,
    Habit,
    Seen,
)

FREEDOMS = tuple(float(x) for x in np.geomspace(1.5, 12.0, 40))
ROUNDS = 60
NEAR, OWN = 0.1, 0.2
"""A keypoint is at another's place within NEAR, right within OWN, fractions of the longer box side."""
CONFUSED_TRACK = 402
"""Sequence 4, track 2: a genuine failure of the detector, says the data's own description."""
COMMAND = "groundpose evaluate detector"
AGREEMENT = Path("results/simulated_detector.json")
AGREEMENT_SCORES = (0.0, 0.05, 0.3, 0.5, 1.0)
QUANTILES = (5, 25, 50, 75, 95)
REPEATS = 20
"""Simulated draws for each real object."""
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Detections:
    """N vehicles of KITTI with a label and the box of a real detector."""

    label: Array
    """(N, 4) left, top, right, bottom px"""
    detected: Array
    image_size: tuple[int, int]
    """Of most images; they differ by up to 18 px."""
    at_border: Mask
    """(N, 4)"""
    occlusion: npt.NDArray[np.int64]
    """0, 1, 2 (3, unknown, counts as 2)"""

    @property
    def longer(self) -> Array:
        """(N,) px, of the label."""
        return np.asarray((self.label[:, 2:] - self.label[:, :2]).max(axis=1))


def detections(folder: Path) -> Detections:
    """Those of kitti_vehicles_dev.npz. FileNotFoundError when it is not there."""
    with np.load(folder / "kitti_vehicles_dev.npz") as data:
        rows = dict(zip(data["cols"].tolist(), data["rows"].T, strict=True))
    rows = {name: column[np.isfinite(rows["det_x1"])] for name, column in rows.items()}
    corners = ("x1", "y1", "x2", "y2")
    label = np.stack([rows[c] for c in corners], axis=1)
    sizes = np.stack([rows["imgW"], rows["imgH"]], axis=1).astype(int)
    border = np.zeros(label.shape, bool)
    for size in np.unique(sizes, axis=0):
        of_size = (sizes == size).all(axis=1)
        border[of_size] = at_border(label[of_size], (int(size[0]), int(size[1])))
    return Detections(
        label,
        np.stack([rows[f"det_{c}"] for c in corners], axis=1),
        (int(np.median(sizes[:, 0])), int(np.median(sizes[:, 1]))),
        border,
        np.minimum(rows["occ"].astype(int), 2),
    )


def fit_boxes(error: Array, longer: Array) -> BoxNoise:
    """Multivariate t by expectation maximisation (Lange, Little and Taylor 1989); errors (N, 4) px."""
    mean = np.tile(np.median(error, axis=0), (len(error), 1))
    scale = np.tile(np.hypot(1.0, 0.02 * longer)[:, None], (1, 4))
    correlation, freedom = np.eye(4), 3.0
    sides: list[SideNoise] = []
    for _ in range(ROUNDS):
        u = (error - mean) / scale
        distance = np.einsum("ni,ij,nj->n", u, np.linalg.inv(correlation), u)
        freedom = max(FREEDOMS, key=lambda nu: _log_likelihood(nu, distance))
        weight = (freedom + 4) / (freedom + distance)
        sides = [_side(error[:, k], longer, weight, scale[:, k]) for k in range(4)]
        mean = np.stack([s.mean(longer) for s in sides], axis=1)
        scale = np.stack([s.scale(longer) for s in sides], axis=1)
        correlation = np.corrcoef(((error - mean) / scale * np.sqrt(weight)[:, None]).T)
    left, top, right, bottom = sides
    return BoxNoise((left, top, right, bottom), freedom, tuple(correlation[np.triu_indices(4, 1)].tolist()))


def _side(error: Array, longer: Array, weight: Array, scale: Array) -> SideNoise:
    """Weighted least squares of the mean over (1, l) and of the squared rest over (1, l^2)."""
    A, w = np.stack([np.ones_like(longer), longer], axis=1), weight / scale**2
    shift, slope = np.linalg.solve(A.T @ (w[:, None] * A), A.T @ (w * error))
    rest = weight * (error - shift - slope * longer) ** 2
    B, v = np.stack([np.ones_like(longer), longer**2], axis=1), 1.0 / scale**4
    variances = np.linalg.solve(B.T @ (v[:, None] * B), B.T @ (v * rest))
    if variances.min() < 0.0:  # one of the two explains everything
        only = int(variances.argmax())
        best = (v * rest * B[:, only]).sum() / (v * B[:, only] ** 2).sum()
        variances = np.where(np.arange(2) == only, best, 0.0)
    pixels, fraction = np.sqrt(variances)
    return SideNoise(float(shift), float(slope), float(pixels), float(fraction))


def _log_likelihood(freedom: float, distance: Array) -> float:
    """Of the t distribution in 4 dimensions, but for what does not depend on `freedom`."""
    half = 0.5 * (freedom + 4)
    constant = math.lgamma(half) - math.lgamma(0.5 * freedom) - 2.0 * math.log(freedom)
    return float(np.sum(constant - half * np.log1p(distance / freedom)))


@dataclass(frozen=True)
class Found:
    """Keypoints of a real CNN on N cars, and the truth as a detector would have to answer it."""

    seen: Seen
    keypoints_2d: Array
    scores: Array
    confused: Mask
    """(N,)"""

    def distances(self) -> Array:
        """(N, P, P) from keypoint i as found to where keypoint j is, fractions of the longer box side."""
        apart = self.keypoints_2d[:, :, None] - self.seen.keypoints_2d[:, None]
        return np.asarray(np.linalg.norm(apart, axis=-1) / self.seen.longer[:, None, None])


def found_keypoints(folder: Path) -> Found:
    """108 cars of kitti_cnn_keypoints14_dev.npz; the median shift of a track is added to its truth.

    FileNotFoundError when the file is not there.
    """
    cars = kitti(folder)
    with np.load(folder / "kitti_cnn_keypoints14_dev.npz") as data:
        track = 100 * data["seq"] + data["track"]
        names = data["names"].tolist()
    points = np.stack([model.keypoints_3d for model in cars.models])
    state = np.where(_faces_camera(points, names, cars.R, cars.t), VISIBLE, HIDDEN)
    at = points @ np.swapaxes(cars.R, 1, 2) + cars.t[:, None]
    pixels = cars.view.project(at.reshape(-1, 3)).reshape(*at.shape[:2], 2)
    longer = (cars.bboxes[:, 2:] - cars.bboxes[:, :2]).max(axis=1)[:, None, None]
    error = (cars.keypoints_2d - pixels) / longer
    assert cars.keypoint_scores is not None
    sure = (cars.keypoint_scores > EDGES[FOUND]) & (state == VISIBLE)
    sure &= np.linalg.norm(error, axis=-1) < 1.5 * OWN
    for one in np.unique(track):
        of_track = track == one
        pixels[of_track] += np.median(error[of_track][sure[of_track]], axis=0) * longer[of_track]
    seen = Seen(pixels, state, points, cars.bboxes)
    return Found(seen, cars.keypoints_2d, cars.keypoint_scores, track == CONFUSED_TRACK)


def _faces_camera(points: Array, names: list[str], R: Array, t: Array) -> Mask:
    """(N, P) whether a side of the car's box that a keypoint lies on faces the camera."""
    camera = -np.einsum("nji,nj->ni", R, t)
    low, high = points.min(axis=1), points.max(axis=1)
    left, right = camera[:, 0] < low[:, 0], camera[:, 0] > high[:, 0]
    back, front = camera[:, 2] < low[:, 2], camera[:, 2] > high[:, 2]
    columns = []
    for name in names:
        side = left if name.startswith("L_") else right
        if "Wheel" in name or "Mirror" in name:
            end = front & ("Mirror" in name)
        else:
            end = front if "_F_" in name or "Head" in name else back
        columns.append(side | end)
    return np.stack(columns, axis=1)


def fit_habit(found: Found, objects: Mask) -> Habit:
    """Fractions counted over some of the objects."""
    seen, distances = found.seen, found.distances()
    band = np.digitize(found.scores, EDGES[1:-1])
    right = np.take_along_axis(distances, np.arange(distances.shape[1])[None, :, None], 2)[..., 0] < OWN
    bands, wrong = [], []
    for state in (HIDDEN, VISIBLE):
        member = objects[:, None] & (seen.state == state)
        counts = np.bincount(band[member], minlength=len(EDGES) - 1)
        bad = np.bincount(band[member & ~right], minlength=len(EDGES) - 1)
        bands.append(tuple((counts / counts.sum()).tolist()))
        wrong.append(tuple((bad / np.maximum(counts, 1)).tolist()))
    kind = _kinds(found, distances, band)
    kinds = []
    for level in (band < DOUBTFUL, band >= DOUBTFUL):
        counts = np.bincount(kind[objects[:, None] & ~right & level], minlength=len(KINDS))
        kinds.append(tuple((counts / counts.sum()).tolist()))
    return Habit((bands[0], bands[1]), (wrong[0], wrong[1]), (kinds[0], kinds[1]))


def _kinds(found: Found, distances: Array, band: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """(N, P) index into KINDS: where a keypoint would be if it is wrong."""
    mirror, turn = found.seen.partners()
    others = np.linalg.norm(found.keypoints_2d[:, :, None] - found.keypoints_2d[:, None], axis=-1)
    others = others / found.seen.longer[:, None, None] + 9.0 * np.eye(others.shape[1])
    others += np.where(band >= FOUND, 0.0, 9.0)[:, None]
    at = [np.take_along_axis(distances, p[..., None], 2)[..., 0] < NEAR for p in (mirror, turn)]
    return np.select([*at, others.min(axis=2) < NEAR / 3], [0, 1, 2], 3)


def noise_by_band(found: Found) -> list[float]:
    """Deviation of a coordinate of right keypoints of the clear objects, fractions of the longer side."""
    own = np.diagonal(found.distances(), axis1=1, axis2=2)
    band = np.digitize(found.scores, EDGES[1:-1])
    right = (own < OWN) & ~found.confused[:, None]
    return [float(np.sqrt(np.mean(own[right & (band == k)] ** 2) / 2)) for k in range(len(EDGES) - 1)]


def keypoint_agreement(found: Found, seed: int = 0) -> list[dict[str, Any]]:
    """Quantiles of the residuals in % of the longer side, real and simulated on the same cars and poses."""
    s = found.seen
    arrays = (s.keypoints_2d, s.state, s.keypoints_3d, s.bboxes)
    many = Seen(*(np.concatenate([array] * REPEATS) for array in arrays))
    keypoints, scores = Detector("as measured", 1.0)(many, seed)
    real, simulated = (_residuals(x, seen) for x, seen in ((found.keypoints_2d, s), (keypoints, many)))
    lines: list[dict[str, Any]] = []
    for state, name in ((VISIBLE, "visible"), (HIDDEN, "hidden")):
        for low, high in ((0.0, 1.0), *itertools.pairwise(AGREEMENT_SCORES)):
            line: dict[str, Any] = {"keypoints": name, "scores": [low, high]}
            for who, r, sc, st in (
                ("real", real, found.scores, s.state),
                ("simulated", simulated, scores, many.state),
            ):
                member = (st == state) & (sc >= low) & (sc < high)
                line[f"{who} fraction %"] = 100.0 * float(member.sum() / (st == state).sum())
                line[who] = np.percentile(100.0 * r[member], QUANTILES).tolist()
            lines.append(line)
    return lines


def _residuals(keypoints: Array, seen: Seen) -> Array:
    return np.asarray(np.linalg.norm(keypoints - seen.keypoints_2d, axis=-1) / seen.longer[:, None])


def box_agreement(boxes: Detections, seed: int = 0) -> list[dict[str, Any]]:
    """Quantiles of the errors of the sides in % of the longer side, real and simulated on the same boxes."""
    label, occlusion = np.concatenate([boxes.label] * REPEATS), np.concatenate([boxes.occlusion] * REPEATS)
    simulated = draw_boxes(label, occlusion, boxes.image_size, seed) - label
    error, many = (
        boxes.detected - boxes.label,
        Detections(label, label, boxes.image_size, np.concatenate([boxes.at_border] * REPEATS), occlusion),
    )
    lines: list[dict[str, Any]] = []
    for level in range(3):
        for k, side in enumerate(SIDES):
            line: dict[str, Any] = {"occlusion": level, "side": side}
            for who, e, of in (("real", error, boxes), ("simulated", simulated, many)):
                member = (of.occlusion == level) & ~of.at_border.any(axis=1)
                line[who] = np.percentile(100.0 * e[member, k] / of.longer[member], QUANTILES).tolist()
            lines.append(line)
    return lines


def measure(folder: Path) -> None:
    """Print every table, store how well they agree with what they were fitted to.

    OSError when the real data is not there.
    """
    boxes, found = detections(folder), found_keypoints(folder)
    error, free = boxes.detected - boxes.label, ~boxes.at_border.any(axis=1)
    for level in range(3):
        kept = free & (boxes.occlusion == level)
        print(f"boxes, occlusion {level}, {kept.sum()}: {fit_boxes(error[kept], boxes.longer[kept])}")
    relative = np.where(boxes.at_border, np.abs(error) / boxes.longer[:, None], np.nan)
    # the median of |t| with 5 degrees of freedom is 0.73
    print("boxes, border:", np.nanmedian(relative[:, [0, 2, 3]], axis=0) / 0.73)
    for name, objects in (("clear", ~found.confused), ("confused", found.confused)):
        print(f"keypoints, {name}, {objects.sum()}: {fit_habit(found, objects)}")
    print("keypoints, noise by band:", noise_by_band(found))
    agreement = {"keypoints": keypoint_agreement(found), "boxes": box_agreement(boxes)}
    report.write_json(AGREEMENT, {"command": COMMAND, **agreement})
    print(f"wrote {AGREEMENT}")
