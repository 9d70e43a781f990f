"""One video of the virtual drive, and its frames as scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, count, input_error, number
from groundpose.lab.drive import ego as car
from groundpose.lab.drive import mast, scenery, surroundings
from groundpose.lab.drive.drive import camera_place, camera_pose
from groundpose.lab.drive.ego import Ego
from groundpose.lab.drive.footprints import Footprints, overlapping
from groundpose.lab.drive.rigs import Mount, Rigs, draw_mount
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.road_kinds import MAST_FRACTIONS, ROAD_KINDS, make_road
from groundpose.lab.drive.scene import Light, Prop, Scene
from groundpose.lab.drive.splits import split_of
from groundpose.lab.drive.standing import Placed, standing
from groundpose.lab.drive.traffic import Classes, parked
from groundpose.lab.drive.video.mover import Chassis
from groundpose.lab.drive.video.recording import Moment, Recording
from groundpose.lab.drive.video.street import AHEAD, Street

MOST_FRAMES = 36_000
"""Of a video: an hour at 10 frames a second."""
FPS = (1.0, 100.0)
"""Least and largest number of frames a second."""

SIGHT = 180.0
"""Vehicles farther than this from the camera are not in a frame, metres."""

_DECIDE = 0.1  # most seconds between two decisions of a driver
_WARM_UP = 12.0  # seconds of traffic before the first frame
_ROAD_OF_MAST = 320.0
_LONGEST_ROAD = 40_000.0
_YAW_STD = math.radians(0.5)  # of the camera against its car
_BEHIND_FRONT = 0.5 * car.LENGTH - car.CAMERA_TO_FRONT
"""Of the camera before the middle of its car, metres."""


@dataclass(frozen=True, eq=False)
class Parked:
    """Vehicles that stand for the whole video: `place` (P, 2) x, z, `heading` (P,)."""

    track: NDArray[np.int64]
    chassis: tuple[Chassis, ...]
    place: FloatArray
    heading: FloatArray
    steering: FloatArray

    def __getitem__(self, rows: NDArray[np.intp]) -> Parked:
        """Some of them."""
        return Parked(
            self.track[rows], tuple(self.chassis[i] for i in rows), self.place[rows], self.heading[rows],
            self.steering[rows],
        )  # fmt: skip

    def footprints(self, margin: float = 0.0) -> Footprints | None:
        """None without any."""
        if not self.chassis:
            return None
        return Footprints.of(self.place, self.heading, np.array([c.box for c in self.chassis]), margin)


@dataclass(frozen=True, eq=False)
class Clip:
    """A video. `ego` has one value per frame; `own` of the camera's car per frame, None on a mast."""

    seed: int
    split: str
    fps: float
    road: Road
    mount: Mount
    ego: Ego
    own: Moment | None
    light: Light
    props: tuple[Prop, ...]
    prop_places: FloatArray
    parked: Parked
    moments: tuple[Moment, ...]
    chassis: Mapping[int, Chassis]

    def __len__(self) -> int:
        """Frames."""
        return len(self.moments)


@dataclass(frozen=True, eq=False)
class VideoFrame:
    """A frame: its scene, and of each vehicle of the scene the track, the speed along its heading, the
    acceleration and the yaw rate, SI units."""

    scene: Scene
    time: float
    track: NDArray[np.int64]
    speed: FloatArray
    acceleration: FloatArray
    yaw_rate: FloatArray
    heading: FloatArray
    ego_acceleration: float
    ego_yaw_rate: float


def check_video(frames: int, fps: float) -> None:
    """Raises InputError for a number of frames or frames a second out of range."""
    if not 1 <= count("frames", frames) <= MOST_FRAMES:
        raise input_error("frames", f"1 to {MOST_FRAMES} of a video", frames)
    if not FPS[0] <= number("fps", fps) <= FPS[1]:
        raise input_error("fps", f"{FPS[0]:g} to {FPS[1]:g}", fps)


@lru_cache(maxsize=2)
def make_clip(seed: int, frames: int, fps: float, shares: tuple[tuple[str, float], ...], rigs: Rigs) -> Clip:
    """A video of so many frames. It depends on the arguments alone.

    Args:
        seed: from `splits.scene_seed`; it decides the split.
        frames: 1 to MOST_FRAMES.
        fps: frames a second, see FPS.
        shares: relative frequency of each class of vehicle.
        rigs: from which the camera is drawn.

    Raises:
        InputError: a number out of range; a way of a moving camera longer than 40 km.
    """
    split = split_of(seed)
    check_video(frames, fps)
    rngs = [np.random.default_rng(child) for child in np.random.SeedSequence((seed, 777)).spawn(7)]
    road_rng, ego_rng, traffic_rng, props_rng, light_rng, mount_rng, parked_rng = rngs
    mount = draw_mount(mount_rng, rigs)
    road = _road(road_rng, mount, frames / fps)
    t = np.arange(frames) / fps
    still = mast.stand(ego_rng, road, mount, t) if mount.standing else None
    classes = Classes(traffic_rng, split, dict(shares))
    street = Street(traffic_rng, road, classes, mount.standing)
    standing_ones = _parked(parked_rng, road, still, split, dict(shares), street)
    recording, own = _record(street, road, still, ego_rng, standing_ones, frames, fps)
    ego = still if still is not None else _ego(ego_rng, road, mount, own, fps)
    keep = None if street.ego is None else street.ego.track
    gone = recording.removed(keep, set(standing_ones.track.tolist()))
    moments = tuple(m.without(gone | ({keep} if keep is not None else set())) for m in recording.moments)
    standing_ones = standing_ones[
        np.flatnonzero([t not in gone for t in standing_ones.track.tolist()]).astype(np.intp)
    ]
    props = scenery.clear_of_mast(surroundings.props(road, props_rng), road, ego)
    props = _clear_of_traffic(props, moments, recording.chassis, standing_ones, fps)
    places = np.array([prop.position for prop in props]).reshape(-1, 3)
    light = surroundings.light(light_rng, split)
    return Clip(
        seed, split, fps, road, mount, ego, own, light, props, places, standing_ones, moments,
        recording.chassis,
    )  # fmt: skip


def _road(rng: np.random.Generator, mount: Mount, seconds: float) -> Road:
    fractions = MAST_FRACTIONS if mount.standing else {name: k.fraction for name, k in ROAD_KINDS.items()}
    weights = np.array(list(fractions.values()))
    kind = list(fractions)[int(rng.choice(len(fractions), p=weights / weights.sum()))]
    length = _ROAD_OF_MAST
    if not mount.standing:
        length = 1.3 * ROAD_KINDS[kind].speed[1] * (seconds + _WARM_UP) + AHEAD + 40.0
        if length > _LONGEST_ROAD:
            raise input_error(
                "frames", "a way of at most 40 km for a camera that moves", f"{length / 1e3:.0f} km"
            )
    return make_road(rng, kind, length, mount.standing)


def _parked(
    rng: np.random.Generator,
    road: Road,
    still: Ego | None,
    split: str,
    shares: dict[str, float],
    street: Street,
) -> Parked:
    """All parked vehicles of the road; none overlap."""
    ends = np.array([road.start + 20.0, road.end - AHEAD])
    zeros = np.zeros(2)
    whole = Ego(ends, zeros, zeros, zeros, zeros, zeros, zeros, zeros, standing=still is not None)
    found = [a for a in parked(rng, road, whole, split, shares) if road.start < a.s[0] < road.end]
    chassis = tuple(
        replace(Chassis.of(a.class_name, a.seed, rng), look_seed=a.look_seed, lamps=a.lamps) for a in found
    )
    s, d, angle = (np.array([getattr(a, name)[0] for a in found]) for name in ("s", "d", "angle"))
    place = road.world(s, d)[:, [0, 2]] if found else np.zeros((0, 2))
    heading = road.heading_at(s) + angle if found else np.zeros(0)
    turned = np.where(rng.random(len(found)) < 0.4, rng.uniform(-0.5, 0.5, len(found)), 0.0)
    tracks = np.array([street.number() for _ in found], np.int64)
    every = Parked(tracks, chassis, place, heading, turned)
    boxes = every.footprints(0.05)
    if boxes is None:
        return every
    kept: list[int] = []
    for i in range(len(found)):
        near = [j for j in kept[-60:] if np.abs(boxes.middle[j] - boxes.middle[i]).max() < 25.0]
        rows = np.array(near, np.intp)
        if not near or not overlapping(boxes[np.array([i])], boxes[rows]).any():
            kept.append(i)
    return every[np.array(kept, np.intp)]


def _record(
    street: Street,
    road: Road,
    still: Ego | None,
    rng: np.random.Generator,
    standing_ones: Parked,
    frames: int,
    fps: float,
) -> tuple[Recording, Moment | None]:
    """Let the traffic flow; the second result is the camera's car, row by frame."""
    if still is not None:
        street.centre = float(still.s[0])
    else:
        ways = [lane for lane in road.layout.lanes if lane.direction > 0]
        lane = ways[int(rng.integers(len(ways)))]
        street.place_ego(lane, _own_chassis(), lane.speed)
    street.fill()
    recording = Recording(standing_ones.footprints())
    steps = math.ceil(1.0 / (fps * _DECIDE) - 1e-9)
    h = 1.0 / (fps * steps)
    for _ in range(round(_WARM_UP / h)):
        street.step(h)
    for frame in range(frames):
        for _ in range(steps if frame else 0):
            street.step(h)
            recording.watch(street.movers, standing_ones.track)
        recording.watch(street.movers, standing_ones.track)
        recording.moments.append(Moment.of(street.movers))
    if street.ego is None:
        return recording, None
    own = [_row(moment, street.ego.track) for moment in recording.moments]
    return recording, own and _joined(own)  # type: ignore[return-value]


def _row(moment: Moment, track: int) -> Moment:
    return moment.without(set(moment.track.tolist()) - {track})


def _joined(moments: list[Moment]) -> Moment:
    values = {
        name: np.concatenate([getattr(m, name) for m in moments])
        for name in Moment.__dataclass_fields__
        if name != "state"
    }
    return Moment(**values, state=tuple(state for m in moments for state in m.state))


def _own_chassis() -> Chassis:
    box = 0.5 * np.array([[-car.WIDTH, -car.LENGTH], [car.WIDTH, car.LENGTH]])
    return Chassis("", 0, 0, 0.0, box, front=1.35, rear=-1.3)


def _ego(rng: np.random.Generator, road: Road, mount: Mount, own: Moment | None, fps: float) -> Ego:
    """The camera's motion, from that of its car."""
    assert own is not None
    forward = np.stack([np.sin(own.heading), np.cos(own.heading)], axis=1)
    s, d = road.locate(*(own.place + _BEHIND_FRONT * forward).T)
    t = np.arange(len(s)) / fps
    before = np.arange(-3.0, 0.0, car.STEP)
    fine = np.concatenate([before, np.arange(0.0, t[-1] + car.STEP, car.STEP)])
    v, a, turn = (np.interp(fine, t, x) for x in (own.speed, own.acceleration, own.yaw_rate))
    roughness = rng.uniform(*ROAD_KINDS[road.layout.kind].roughness)
    at = np.minimum(len(before) + np.round(t / car.STEP).astype(int), len(fine) - 1)
    pitch = car.sway(rng, 0, a, v, roughness)[at]
    roll = car.sway(rng, 1, v * turn, v, roughness)[at]
    height = mount.height if mount.height is not None else float(rng.uniform(*car.HEIGHT))
    yaw = np.array([math.remainder(x, 2.0 * math.pi) for x in own.heading - road.heading_at(s)])
    yaw += rng.normal(0.0, _YAW_STD)
    return Ego(s, d, yaw, own.speed, own.acceleration, pitch, roll, np.full(len(s), height))


def _clear_of_traffic(
    props: tuple[Prop, ...],
    moments: tuple[Moment, ...],
    chassis: Mapping[int, Chassis],
    standing_ones: Parked,
    fps: float,
) -> tuple[Prop, ...]:
    """The things that no vehicle ever touches."""
    if not props:
        return props
    things = scenery.footprints(props)
    radius = np.linalg.norm(things.half, axis=1)
    taken = np.zeros(len(props), bool)
    boxes = [standing_ones.footprints(0.2)]
    for moment in moments[:: max(1, round(0.2 * fps))]:
        if len(moment.track):
            sizes = np.array([chassis[t].box for t in moment.track.tolist()])
            boxes.append(Footprints.of(moment.place, moment.heading, sizes, 0.4))
    for box in boxes:
        if box is None:
            continue
        low, high = box.middle.min(axis=0) - 8.0, box.middle.max(axis=0) + 8.0
        near = ((things.middle + radius[:, None] > low) & (things.middle - radius[:, None] < high)).all(
            axis=1
        )
        rows = np.flatnonzero(near & ~taken)
        if len(rows):
            taken[rows] = overlapping(things[rows], box).any(axis=1)
    return tuple(prop for prop, out in zip(props, taken, strict=True) if not out)


def video_frame(clip: Clip, frame: int) -> VideoFrame:
    """A frame of a video. Raises InputError for one that is not in it."""
    if not 0 <= count("frame", frame) < len(clip):
        raise input_error("frame", f"0 to {len(clip) - 1}", frame)
    R_road, at = camera_place(clip.road, clip.ego, frame)
    moment = clip.moments[frame]
    camera = at[[0, 2]]
    moving = np.flatnonzero(np.linalg.norm(moment.place - camera, axis=1) < SIGHT)
    still = np.flatnonzero(np.linalg.norm(clip.parked.place - camera, axis=1) < SIGHT)
    stand = clip.parked[still]
    bodies = [clip.chassis[t] for t in moment.track[moving].tolist()]
    placed = [
        _placed(c, moment.state[i], bool(moment.braking[i]), float(moment.steering[i]))
        for c, i in zip(bodies, moving, strict=True)
    ]
    placed += [
        _placed(c, "parked", False, float(a)) for c, a in zip(stand.chassis, stand.steering, strict=True)
    ]
    flat = np.concatenate([moment.place[moving], stand.place])
    heading = np.concatenate([moment.heading[moving], stand.heading])
    centres = np.stack([flat[:, 0], np.zeros(len(flat)), flat[:, 1]], axis=1)
    vehicles = standing(clip.road, clip.light.kind, placed, centres, heading)
    scene = Scene(
        **camera_pose(clip.mount, clip.ego, frame, R_road, at),
        road=clip.road,
        vehicles=vehicles,
        props=scenery.near(clip.props, clip.prop_places, at, R_road[:, 2]),
        light=clip.light,
        split=clip.split,
        seed=clip.seed,
        number=frame,
        film=True,
    )
    none = np.zeros(len(still))
    return VideoFrame(
        scene,
        frame / clip.fps,
        np.concatenate([moment.track[moving], stand.track]),
        np.concatenate([moment.speed[moving], none]),
        np.concatenate([moment.acceleration[moving], none]),
        np.concatenate([moment.yaw_rate[moving], none]),
        heading,
        0.0 if clip.own is None else float(clip.own.acceleration[frame]),
        0.0 if clip.own is None else float(clip.own.yaw_rate[frame]),
    )


def _placed(chassis: Chassis, state: str, braking: bool, steering: float) -> Placed:
    return Placed(
        chassis.class_name, chassis.seed, chassis.look_seed, chassis.lamps, state, braking, steering
    )
