"""Frames of the virtual drive: `scene(seed, number)`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from groundpose._checks import FloatArray, count
from groundpose.lab.drive import ego as car
from groundpose.lab.drive import mast, surroundings
from groundpose.lab.drive.ego import FRAMES_PER_DRIVE, Ego
from groundpose.lab.drive.footprints import Footprints, overlapping
from groundpose.lab.drive.rigs import DEFAULT_RIG, RIGS, Mount, Rigs, draw_mount
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.road_kinds import MAST_FRACTIONS, ROAD_KINDS, make_road
from groundpose.lab.drive.scene import Light, Prop, Scene, Vehicle
from groundpose.lab.drive.splits import body, split_of
from groundpose.lab.drive.traffic import DEFAULT_SHARES, Actor, reach, traffic
from groundpose.types import View

# Room kept free around vehicles, metres.
_MARGIN = 0.1
# Things farther than this from the camera are omitted from a frame, metres.
_PROPS_AHEAD, _PROPS_BEHIND = 160.0, 25.0
# Fraction of moving vehicles with their lamps on, by light.
_LAMPS = {"night": 1.0, "dusk": 0.95, "shade": 0.5, "overcast": 0.4}
_LAMPS_OTHERWISE, _LAMPS_PARKED = 0.25, 0.02


@dataclass(frozen=True, eq=False)
class Drive:
    """What all frames of a drive have in common."""

    road: Road
    mount: Mount
    ego: Ego
    actors: tuple[Actor, ...]
    props: tuple[Prop, ...]
    prop_places: FloatArray
    light: Light


def scene(
    seed: int,
    number: int,
    shares: Mapping[str, float] | None = None,
    rigs: Rigs = RIGS[DEFAULT_RIG],
) -> Scene:
    """Frame `number` of the drive with `seed`. The frame depends on the arguments alone.

    A new drive begins every FRAMES_PER_DRIVE frames, with another road, light, camera and traffic.

    Args:
        seed: from `splits.scene_seed`; it decides the split.
        number: of the frame, 0 or larger.
        shares: relative frequency of each class of vehicle; None: DEFAULT_SHARES.
        rigs: from which the camera of each drive is drawn, see `rigs.RIGS`.

    Raises:
        InputError: a negative number, a seed of no split.
    """
    split = split_of(seed)
    index, frame = divmod(count("number", number), FRAMES_PER_DRIVE)
    drive = _drive(seed, index, tuple((DEFAULT_SHARES if shares is None else shares).items()), rigs)
    R_road, at = _camera_place(drive, frame)
    ego, mount = drive.ego, drive.mount
    pitch, roll = mount.pitch + float(ego.pitch[frame]), mount.roll + float(ego.roll[frame])
    height = float(ego.height[frame])
    R = View(mount.camera, pitch, roll).R_camera_from_ground @ R_road.T
    position = at - height * R_road[:, 1]
    vehicles = _vehicles(drive, frame, R_road, at)
    return Scene(
        camera=mount.camera,
        mount=mount,
        R_camera_from_world=R,
        t_camera_from_world=-R @ position,
        pitch=pitch,
        roll=roll,
        height=height,
        speed=float(ego.speed[frame]),
        road=drive.road,
        vehicles=vehicles,
        props=_props(drive, at, R_road[:, 2], vehicles),
        light=drive.light,
        split=split,
        seed=seed,
        number=number,
    )


@lru_cache(maxsize=4)
def _drive(seed: int, index: int, shares: tuple[tuple[str, float], ...], rigs: Rigs) -> Drive:
    """The drive `index`; each part has its own random stream."""
    split = split_of(seed)
    road_rng, ego_rng, traffic_rng, props_rng, light_rng, mount_rng = (
        np.random.Generator(np.random.PCG64(child))
        for child in np.random.SeedSequence((seed, index)).spawn(6)
    )
    mount = draw_mount(mount_rng, rigs)
    fractions = MAST_FRACTIONS if mount.standing else {name: k.fraction for name, k in ROAD_KINDS.items()}
    kind = list(fractions)[int(road_rng.choice(len(fractions), p=list(fractions.values())))]
    speed = ROAD_KINDS[kind].speed[1] * 1.3
    road = make_road(
        road_rng, kind, speed * FRAMES_PER_DRIVE * car.FRAME_INTERVAL + _PROPS_AHEAD, mount.standing
    )
    ego = mast.stand(ego_rng, road, mount) if mount.standing else _drive_in_a_lane(ego_rng, road, mount)
    actors = traffic(traffic_rng, road, ego, split, dict(shares))
    props = _clear_of_mast(surroundings.props(road, props_rng), road, ego)
    places = np.array([prop.position for prop in props]).reshape(-1, 3)
    return Drive(road, mount, ego, actors, props, places, surroundings.light(light_rng, split))


def _drive_in_a_lane(rng: np.random.Generator, road: Road, mount: Mount) -> Ego:
    lanes = [lane for lane in road.layout.lanes if lane.direction > 0]
    lane = lanes[int(rng.integers(len(lanes)))]
    ego = car.drive_along(rng, road, lane.d, lane.speed)
    return ego if mount.height is None else replace(ego, height=np.full(len(ego.s), mount.height))


def _camera_place(drive: Drive, frame: int) -> tuple[FloatArray, FloatArray]:
    """The road's frame turned to the camera's heading (world_from_ground), and the point under the camera."""
    s, d, yaw = (float(a[frame]) for a in (drive.ego.s, drive.ego.d, drive.ego.yaw))
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    return drive.road.frame(s, d)[0] @ turn, drive.road.world(s, d)[0]


def _vehicles(drive: Drive, frame: int, R_road: FloatArray, at: FloatArray) -> tuple[Vehicle, ...]:
    """The vehicles around the camera, standing on the road; of two that would overlap, one is omitted."""
    near = [a for a in drive.actors if _in_sight(a, drive.ego, frame)]
    if not near:
        return ()
    s, d, angle = np.array([(a.s[frame], a.d[frame], a.angle[frame]) for a in near]).T
    headings = drive.road.heading_at(s) + angle
    centres = drive.road.world(s, d)
    boxes = [body(a.class_name, a.seed).bbox_3d[:, [0, 2]] for a in near]
    footprints = Footprints.of(centres[:, [0, 2]], headings, np.array(boxes), _MARGIN)
    own = _own_footprint(drive, R_road, at)
    blocked = np.zeros(len(near), bool) if own is None else overlapping(footprints, own)[:, 0]
    meets = overlapping(footprints)
    chosen: list[int] = []
    for i in np.flatnonzero(~blocked).tolist():
        if not meets[i, chosen].any():
            chosen.append(i)
    return _standing(drive, frame, [near[i] for i in chosen], centres[chosen], headings[chosen])


def _own_footprint(drive: Drive, R_road: FloatArray, at: FloatArray) -> Footprints | None:
    """That of the camera's car; None on a mast."""
    if drive.ego.standing:
        return None
    middle = at - R_road[:, 2] * (0.5 * car.LENGTH - car.CAMERA_TO_FRONT)
    own = np.array([[[-0.5 * car.WIDTH, -0.5 * car.LENGTH], [0.5 * car.WIDTH, 0.5 * car.LENGTH]]])
    heading = np.array([math.atan2(R_road[0, 2], R_road[2, 2])])
    return Footprints.of(middle[None, [0, 2]], heading, own, _MARGIN)


def _in_sight(actor: Actor, ego: Ego, frame: int) -> bool:
    along = actor.s[frame] - ego.s[frame]
    ahead, behind = reach(ego)
    return bool(-behind < along < ahead and math.hypot(along, actor.d[frame] - ego.d[frame]) < actor.sight)


def _standing(
    drive: Drive, frame: int, actors: list[Actor], centres: FloatArray, headings: FloatArray
) -> tuple[Vehicle, ...]:
    if not actors:
        return ()
    wheels = [body(a.class_name, a.seed).wheels[:, [0, 2]] for a in actors]
    cos, sin = np.cos(headings), np.sin(headings)
    spots = [
        centre[[0, 2]] + np.stack([w[:, 0] * c + w[:, 1] * n, w[:, 1] * c - w[:, 0] * n], axis=1)
        for w, centre, c, n in zip(wheels, centres, cos, sin, strict=True)
    ]
    y, _ = drive.road.surface(*np.concatenate(spots).T)
    heights = np.split(y, np.cumsum([len(w) for w in wheels])[:-1])
    lamps = _LAMPS.get(drive.light.kind, _LAMPS_OTHERWISE)
    vehicles = []
    for a, w, h, centre, c, n in zip(actors, wheels, heights, centres, cos, sin, strict=True):
        tilt, level = _on_plane(w, h)
        yaw = np.array([[c, 0.0, n], [0.0, 1.0, 0.0], [-n, 0.0, c]])
        state = a.state[frame]
        vehicles.append(
            Vehicle(
                class_name=a.class_name,
                seed=a.seed,
                R_world=yaw @ tilt,
                t_world=np.array([centre[0], level, centre[2]]),
                look_seed=a.look_seed,
                lamps_on=a.lamps < (_LAMPS_PARKED if state == "parked" else lamps),
                braking=bool(a.braking[frame]),
                state=state,
            )
        )
    return tuple(vehicles)


def _on_plane(wheels: FloatArray, heights: FloatArray) -> tuple[FloatArray, float]:
    """Rotation (3, 3) of a vehicle whose wheels (W, 2) x, z touch the ground at world y `heights`, in the
    frame of its heading, and the y of its origin: the plane nearest to the points under the wheels."""
    columns = np.column_stack([np.ones(len(wheels)), wheels])
    (level, across, along), *_ = np.linalg.lstsq(columns, heights, rcond=None)
    down = np.array([-across, 1.0, -along]) / math.sqrt(1.0 + across**2 + along**2)
    forward = np.array([0.0, along, 1.0]) / math.hypot(along, 1.0)
    right = _cross(down, forward)
    return np.column_stack([right, down, forward]), float(level)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of two vectors (3,); numpy's own is slow for one pair."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _props(
    drive: Drive, at: FloatArray, forward: FloatArray, vehicles: tuple[Vehicle, ...]
) -> tuple[Prop, ...]:
    """The things around the camera, without those at the place of a vehicle."""
    if not drive.props:
        return ()
    ahead = (drive.prop_places - at) @ forward
    half = np.array([0.5 * max(prop.size[0], prop.size[2]) for prop in drive.props])
    near = (ahead - half < _PROPS_AHEAD) & (ahead + half > -_PROPS_BEHIND)
    chosen = [drive.props[i] for i in np.flatnonzero(near)]
    if not vehicles or not chosen:
        return tuple(chosen)
    things = _prop_footprints(chosen)
    cars = Footprints.of(
        np.array([v.t_world[[0, 2]] for v in vehicles]),
        np.array([math.atan2(v.R_world[0, 2], v.R_world[2, 2]) for v in vehicles]),
        np.array([body(v.class_name, v.seed).bbox_3d[:, [0, 2]] for v in vehicles]),
    )
    free = np.flatnonzero(~overlapping(things, cars).any(axis=1))
    return tuple(chosen[i] for i in free)


def _prop_footprints(props: Sequence[Prop]) -> Footprints:
    half = 0.5 * np.array([prop.size[[0, 2]] for prop in props])
    return Footprints.of(
        np.array([prop.position[[0, 2]] for prop in props]),
        np.array([prop.yaw for prop in props]),
        np.stack([-half, half], axis=1),
    )


def _clear_of_mast(props: tuple[Prop, ...], road: Road, ego: Ego) -> tuple[Prop, ...]:
    """The things that leave room for a mast: no crown of a tree, lamp or house around the camera."""
    if not props or not ego.standing:
        return props
    at = road.world(ego.s[0], ego.d[0])[:, [0, 2]]
    half = 0.5 * mast.FREE * np.ones((1, 2))
    room = Footprints.of(at, road.heading_at(ego.s[0]), np.stack([-half, half], axis=1))
    taken = overlapping(_prop_footprints(props), room)[:, 0]
    return tuple(prop for prop, inside in zip(props, taken, strict=True) if not inside)
