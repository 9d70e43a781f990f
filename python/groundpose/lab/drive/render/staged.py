"""A scene prepared for drawing, once for all its crops: meshes placed, light computed, shadows cast."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from groundpose.lab.drive import props
from groundpose.lab.drive.assets import environments
from groundpose.lab.drive.render import textures
from groundpose.lab.drive.render.context import context, program, set_uniforms
from groundpose.lab.drive.render.faces import Aim
from groundpose.lab.drive.render.ground import Ground, surfaces
from groundpose.lab.drive.render.levels import BODY_LEVELS, PROP_LEVELS, level_of, prop_levels
from groundpose.lab.drive.render.lighting import illumination
from groundpose.lab.drive.render.look import look
from groundpose.lab.drive.render.meshes import (
    INSTANCE_FLOATS,
    PROP,
    BodyMesh,
    Drawable,
    GpuMesh,
    Pool,
)
from groundpose.lab.drive.render.view import box_corners, in_view, sun_frame
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.scene import Prop, Scene, Vehicle

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

_SHADOW_SIZE = 1024
# Shadow maps: metres ahead of the camera, half width. Texels of 5 and 17 cm.
_NEAR_SHADOW, _FAR_SHADOW = (16.0, 24.0), (65.0, 85.0)
_SHADOW_DEPTH = 150.0
# Texels per metre from which gaps between leaves are drawn in a shadow.
_HOLES_SEEN = 10.0
_BODIES, _PROPS = 300, 64  # kept; 1 MB a body, 2 MB with its finest level


@dataclass(eq=False)
class Things(Generic[Drawable]):
    """Placed meshes: rows of instances, the mesh of each, corners (N, 8, 3) of their boxes."""

    meshes: list[Drawable]
    rows: Floats
    corners: Doubles

    def seen(self, clip: Doubles) -> NDArray[np.intp]:
        """The meshes in view."""
        return np.flatnonzero(in_view(clip, self.corners))


@dataclass(eq=False)
class Staged:
    """The data of one scene that `Renderer` draws."""

    scene: Scene
    ground: Ground
    panorama: Any
    vehicles: Things[BodyMesh]
    contacts: Floats
    props: Things[GpuMesh]
    uniforms: dict[str, Any] = field(default_factory=dict)

    def seen_vehicles(self, clip: Doubles, scale: float) -> list[tuple[int, int, float]]:
        """Index, level of detail and drawn pixels per metre of the vehicles in view, near ones first."""
        density = self._density(self.vehicles, scale)
        seen = self.vehicles.seen(clip)
        order = seen[np.argsort(-density[seen], kind="stable")].tolist()
        return [(i, level_of(BODY_LEVELS, density[i]), float(density[i])) for i in order]

    def aim(self, index: int, clip: Doubles, scale: float) -> Aim | None:
        """The window's view of a vehicle."""
        vehicles, camera = self.vehicles, self.scene.camera
        return Aim.at(
            clip,
            vehicles.rows[index, :12],
            vehicles.corners[index],
            self.scene.camera_position,
            min(camera.fx, camera.fy) * scale,
        )

    def seen_props(self, clip: Doubles, scale: float) -> list[tuple[GpuMesh, int, NDArray[np.intp]]]:
        """Meshes, levels and the rows of their instances in view."""
        density = self._density(self.props, scale)
        groups: dict[tuple[int, int], list[int]] = {}
        for i in self.props.seen(clip).tolist():
            key = id(self.props.meshes[i]), level_of(PROP_LEVELS, density[i])
            groups.setdefault(key, []).append(i)
        return [(self.props.meshes[v[0]], level, np.array(v)) for (_, level), v in groups.items()]

    def _density(self, things: Things[Drawable], scale: float) -> Doubles:
        """Drawn pixels per metre at the middle of each thing."""
        away = np.linalg.norm(things.corners.mean(axis=1) - self.scene.camera_position, axis=1)
        return np.asarray(self.scene.camera.fx * scale / np.maximum(away, 0.5))


class Stage:
    """Keeps meshes, roads and skies in OpenGL's memory, and the last scene."""

    def __init__(self) -> None:
        """Compile the programs that draw meshes."""
        gl = context()
        self.programs = {
            "vehicle": program("vehicle"), "pane": program("vehicle", defines=("GLASS",)),
            "far_vehicle": program("vehicle", defines=("CORNERS",)),
            "far_pane": program("vehicle", defines=("GLASS", "CORNERS")),
            "prop": program("prop"), "leaf": program("leaf"),
            "ground": program("ground"), "wet_ground": program("ground", defines=("WET",)),
            "vehicle_depth": program("vehicle", "depth"), "prop_depth": program("prop", "depth"),
            "leaf_depth": program("prop", "depth", ("HOLES",)),
        }  # fmt: skip
        self.shadow_map = gl.depth_texture((2 * _SHADOW_SIZE, _SHADOW_SIZE))
        self.shadow_map.compare_func = "<="
        self.shadow_map.repeat_x = self.shadow_map.repeat_y = False
        self._shadow_target = gl.framebuffer(depth_attachment=self.shadow_map)
        self._bodies: Pool[BodyMesh] = Pool(_BODIES)
        self._props: Pool[GpuMesh] = Pool(_PROPS)
        self._panoramas: dict[int, Any] = {}
        self._road: tuple[Road, Ground] | None = None
        self._last: Staged | None = None
        self.constants = {
            "leaves": (textures.layer("foliage"), textures.layer("needles")),
            "facades": (textures.layer("house"), textures.layer("stone_house")),
            "crack_layer": textures.layer("cracks"),
        }

    def prepare(self, scene: Scene) -> Staged:
        """The prepared scene; the last one is cached."""
        if self._last is not None and self._last.scene is scene:
            return self._last
        self._bodies.trim()
        self._props.trim()
        vehicles = self._place_vehicles(scene)
        staged = Staged(
            scene, self._ground(scene.road), self._panorama(scene.light.sky), vehicles,
            _contact_rows(scene, vehicles), self._place_props(scene),
        )  # fmt: skip
        staged.uniforms = {**illumination(scene.light), "surfaces": surfaces(scene)}
        self._cast_shadows(staged)
        self._last = staged
        return staged

    def _place_vehicles(self, scene: Scene) -> Things[BodyMesh]:
        used = {n: self.programs[n] for n in ("vehicle", "pane", "far_vehicle", "far_pane", "vehicle_depth")}
        meshes = [
            self._bodies.get((v.class_name, v.seed), lambda v=v: BodyMesh(used, v.class_name, v.seed))  # type: ignore[misc]
            for v in scene.vehicles
        ]
        rows = np.array([_vehicle_row(v) for v in scene.vehicles], "f4").reshape(-1, INSTANCE_FLOATS)
        return Things(meshes, rows, _placed(meshes, rows))

    def _place_props(self, scene: Scene) -> Things[GpuMesh]:
        """Place the vehicles, near ones first: they hide the others, which then cost little."""
        used = {name: self.programs[name] for name in ("prop", "leaf", "prop_depth", "leaf_depth")}
        positions = np.array([p.position for p in scene.props], float).reshape(-1, 3)
        order = np.argsort(np.linalg.norm(positions - scene.camera_position, axis=1), kind="stable")
        placed = [scene.props[i] for i in order.tolist()]
        meshes = []
        for p in placed:
            key = p.kind, props.variant(p.kind, p.seed)
            meshes.append(self._props.get(key, lambda key=key: GpuMesh(used, PROP, prop_levels(*key))))  # type: ignore[misc]
        rows = np.array([_prop_row(p) for p in placed], "f4").reshape(-1, INSTANCE_FLOATS)
        return Things(meshes, rows, _placed(meshes, rows, rows[:, 12:15]))

    def _ground(self, road: Road) -> Ground:
        """The mesh of the road, cached while the road is the same."""
        if self._road is None or self._road[0] is not road:
            if self._road is not None:
                self._road[1].release()
            self._road = (road, Ground(self.programs, road))
        return self._road[1]

    def _panorama(self, sky: int) -> Any:
        if sky not in self._panoramas:
            gl, picture = context(), environments()[sky].panorama
            texture = gl.texture(
                (picture.shape[1], picture.shape[0]), 3, np.ascontiguousarray(picture).tobytes()
            )
            texture.build_mipmaps()
            texture.filter = (gl.LINEAR_MIPMAP_LINEAR, gl.LINEAR)
            texture.repeat_y = False
            self._panoramas[sky] = texture
        return self._panoramas[sky]

    def _cast_shadows(self, staged: Staged) -> None:
        """Two maps side by side: a fine one near the camera, a wide one ahead."""
        scene, gl = staged.scene, context()
        sun = np.asarray(scene.light.sun_direction, float)
        forward = scene.R_camera_from_world[2] * [1.0, 0.0, 1.0]
        eye, forward = scene.camera_position, forward / np.linalg.norm(forward)
        self._shadow_target.clear(depth=1.0)
        self._shadow_target.use()
        gl.enable_only(gl.DEPTH_TEST)
        gl.depth_func = "<"
        gl.polygon_offset = 1.5, 3.0
        for side, name, (ahead, radius) in ((0, "shadow_near", _NEAR_SHADOW), (1, "shadow_far", _FAR_SHADOW)):
            frame = sun_frame(sun, eye + ahead * forward, radius, _SHADOW_DEPTH)
            staged.uniforms[name] = np.ascontiguousarray(frame.T, dtype="f4")
            if scene.light.sun_strength <= 0.0:
                continue
            gl.viewport = (side * _SHADOW_SIZE, 0, _SHADOW_SIZE, _SHADOW_SIZE)
            clip = np.diag([2.0, 2.0, 2.0, 1.0]) @ frame
            clip[:3, 3] -= 1.0
            self._draw_casters(staged, clip, _SHADOW_SIZE / (2.0 * radius))
        gl.polygon_offset = 0.0, 0.0

    def _draw_casters(self, staged: Staged, clip: Doubles, texels_per_metre: float) -> None:
        for name in ("vehicle_depth", "prop_depth", "leaf_depth"):
            set_uniforms(self.programs[name], {"clip_from_world": np.ascontiguousarray(clip.T, dtype="f4")})
        level, prop_level = (level_of(table, texels_per_metre) for table in (BODY_LEVELS, PROP_LEVELS))
        for i in staged.vehicles.seen(clip).tolist():
            staged.vehicles.meshes[i].draw("vehicle_depth", staged.vehicles.rows[i : i + 1], level)
        leaves = "leaf_depth" if texels_per_metre > _HOLES_SEEN else "prop_depth"
        groups: dict[int, list[int]] = {}
        for i in staged.props.seen(clip).tolist():
            groups.setdefault(id(staged.props.meshes[i]), []).append(i)
        for shown in groups.values():
            mesh = staged.props.meshes[shown[0]]
            rows = staged.props.rows[shown]
            mesh.draw("prop_depth", rows, prop_level)
            mesh.draw(leaves, rows, prop_level, second=True)


def _placed(meshes: list[Drawable], rows: Floats, sizes: Floats | None = None) -> Doubles:
    """Corners (N, 8, 3) in the world of the boxes around meshes."""
    corners = box_corners(np.array([m.box for m in meshes]).reshape(-1, 2, 3))
    if sizes is not None:
        corners = corners * sizes[:, None]
    pose = rows[:, :12].reshape(-1, 3, 4).astype(float)
    return np.asarray(np.einsum("nij,nkj->nki", pose[..., :3], corners) + pose[:, None, :, 3])


def _vehicle_row(vehicle: Vehicle) -> list[float]:
    """An instance of vehicle.vert."""
    seen = look(vehicle.class_name, vehicle.look_seed)
    pose = np.column_stack([vehicle.R_world, vehicle.t_world]).ravel().tolist()
    return [
        *pose, *seen.paint, seen.flakes, *seen.second, seen.coat_roughness,
        seen.dirt, float(vehicle.lamps_on), float(vehicle.braking), float(seen.plate),
        seen.random, seen.glass, vehicle.steering, _indicating(vehicle),
    ]  # fmt: skip


def _indicating(vehicle: Vehicle) -> float:
    """Side (1 right, -1 left) whose indicators shine, 0 none: half the time of a turn."""
    blinking = vehicle.state == "turning" and vehicle.look_seed % 2 == 0
    return math.copysign(1.0, vehicle.steering) if blinking and vehicle.steering else 0.0


def _contact_rows(scene: Scene, vehicles: Things[BodyMesh]) -> Floats:
    """Instances of contact.vert: pose; half width and length, reach, spare."""
    rows = [
        [*row[:12], 0.5 * width - 0.12, 0.5 * length - 0.1, 0.7, 0.0]
        for row, (width, _, length) in zip(
            vehicles.rows.tolist(), (m.box[1] - m.box[0] for m in vehicles.meshes), strict=True
        )
    ]
    return np.array(rows, "f4").reshape(-1, 16)


def _prop_row(prop: Prop) -> list[float]:
    """An instance of prop.vert."""
    c, s = np.cos(prop.yaw), np.sin(prop.yaw)
    x, y, z = prop.position
    random = (prop.seed * 0.6180339887) % 1.0
    rows = [c, 0.0, s, x, 0.0, 1.0, 0.0, y, -s, 0.0, c, z]
    return [*rows, *prop.size, random, *props.tint(prop.kind, prop.seed), *[0.0] * 9]
