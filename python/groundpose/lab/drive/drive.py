"""Frames of the virtual drive: `scene(seed, number)`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, count
from groundpose.lab.drive import ego as car
from groundpose.lab.drive import mast, scenery, surroundings
from groundpose.lab.drive.body_cache import measures
from groundpose.lab.drive.ego import FRAMES_PER_DRIVE, Ego
from groundpose.lab.drive.footprints import Footprints, overlapping
from groundpose.lab.drive.rigs import DEFAULT_RIG, RIGS, Mount, Rigs, draw_mount
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.road_kinds import MAST_FRACTIONS, ROAD_KINDS, make_road
from groundpose.lab.drive.scene import Light, Prop, Scene, Vehicle
from groundpose.lab.drive.splits import split_of
from groundpose.lab.drive.standing import Placed, standing
from groundpose.lab.drive.steering import steering
from groundpose.lab.drive.traffic import DEFAULT_SHARES, Actor, reach, traffic
from groundpose.types import View

# Room kept free around vehicles, metres.
_MARGIN = 0.1


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
    R_road, at = camera_place(drive.road, drive.ego, frame)
    vehicles = _vehicles(drive, frame, R_road, at)
    return Scene(
        **camera_pose(drive.mount, drive.ego, frame, R_road, at),
        road=drive.road,
        vehicles=vehicles,
        props=scenery.without_vehicles(
            scenery.near(drive.props, drive.prop_places, at, R_road[:, 2]), vehicles
        ),
        light=drive.light,
        split=split,
        seed=seed,
        number=number,
    )


def camera_pose(mount: Mount, ego: Ego, frame: int, R_road: FloatArray, at: FloatArray) -> dict[str, Any]:
    """The fields of `Scene` that say where its camera is, from `camera_place`."""
    pitch, roll = mount.pitch + float(ego.pitch[frame]), mount.roll + float(ego.roll[frame])
    height = float(ego.height[frame])
    R = View(mount.camera, pitch, roll).R_camera_from_ground @ R_road.T
    return {
        "camera": mount.camera,
        "mount": mount,
        "R_camera_from_world": R,
        "t_camera_from_world": -R @ (at - height * R_road[:, 1]),
        "pitch": pitch,
        "roll": roll,
        "height": height,
        "speed": float(ego.speed[frame]),
    }


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
        road_rng, kind, speed * FRAMES_PER_DRIVE * car.FRAME_INTERVAL + scenery.AHEAD, mount.standing
    )
    ego = mast.stand(ego_rng, road, mount) if mount.standing else _drive_in_a_lane(ego_rng, road, mount)
    actors = traffic(traffic_rng, road, ego, split, dict(shares))
    props = scenery.clear_of_mast(surroundings.props(road, props_rng), road, ego)
    places = np.array([prop.position for prop in props]).reshape(-1, 3)
    return Drive(road, mount, ego, actors, props, places, surroundings.light(light_rng, split))


def _drive_in_a_lane(rng: np.random.Generator, road: Road, mount: Mount) -> Ego:
    lanes = [lane for lane in road.layout.lanes if lane.direction > 0]
    lane = lanes[int(rng.integers(len(lanes)))]
    ego = car.drive_along(rng, road, lane.d, lane.speed)
    return ego if mount.height is None else replace(ego, height=np.full(len(ego.s), mount.height))


def camera_place(road: Road, ego: Ego, frame: int) -> tuple[FloatArray, FloatArray]:
    """The road's frame turned to the camera's heading (world_from_ground), and the point under the camera."""
    s, d, yaw = (float(a[frame]) for a in (ego.s, ego.d, ego.yaw))
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    return road.frame(s, d)[0] @ turn, road.world(s, d)[0]


def _vehicles(drive: Drive, frame: int, R_road: FloatArray, at: FloatArray) -> tuple[Vehicle, ...]:
    """The vehicles around the camera, standing on the road; of two that would overlap, one is omitted."""
    near = [a for a in drive.actors if _in_sight(a, drive.ego, frame)]
    if not near:
        return ()
    s, d, angle = np.array([(a.s[frame], a.d[frame], a.angle[frame]) for a in near]).T
    headings = drive.road.heading_at(s) + angle
    centres = drive.road.world(s, d)
    boxes = [measures(a.class_name, a.seed).bbox_3d[:, [0, 2]] for a in near]
    footprints = Footprints.of(centres[:, [0, 2]], headings, np.array(boxes), _MARGIN)
    own = _own_footprint(drive, R_road, at)
    blocked = np.zeros(len(near), bool) if own is None else overlapping(footprints, own)[:, 0]
    meets = overlapping(footprints)
    chosen: list[int] = []
    for i in np.flatnonzero(~blocked).tolist():
        if not meets[i, chosen].any():
            chosen.append(i)
    placed = [_placed(near[i], frame, drive.road) for i in chosen]
    return standing(drive.road, drive.light.kind, placed, centres[chosen], headings[chosen])


def _placed(actor: Actor, frame: int, road: Road) -> Placed:
    return Placed(
        class_name=actor.class_name,
        seed=actor.seed,
        look_seed=actor.look_seed,
        lamps=actor.lamps,
        state=actor.state[frame],
        braking=bool(actor.braking[frame]),
        steering=steering(actor, frame, road),
    )


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
