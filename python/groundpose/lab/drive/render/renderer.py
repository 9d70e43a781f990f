"""Pictures of scenes: whole frames and crops of one vehicle from one set of meshes and shaders."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error, integer, shaped
from groundpose.lab.drive.render import camera, textures
from groundpose.lab.drive.render.context import context, program, set_uniforms
from groundpose.lab.drive.render.faces import Aim
from groundpose.lab.drive.render.look import plates, surface_tables
from groundpose.lab.drive.render.meshes import GpuMesh
from groundpose.lab.drive.render.pictures import SIZE
from groundpose.lab.drive.render.staged import Stage, Staged
from groundpose.lab.drive.render.view import Window, camera_from_world, clip_from_camera, ray_from_clip
from groundpose.lab.drive.scene import Scene

Image = NDArray[np.uint8]
Radiance = NDArray[np.float32]

# Pictures are drawn at this many times their width and height and averaged. On a CPU this costs less than
# four samples per pixel (results/renderer.json) and also smooths textures and highlights; a factor of 2 looks
# the same.
OVERSAMPLED = 1.5
# Below this many drawn pixels per metre the faces of a body are hardly larger than a pixel. Light is then
# computed per vertex, which costs much less than per pixel.
_CORNER_DENSITY = 110.0
_BY_DENSITY = (("vehicle", "far_vehicle"), ("pane", "far_pane"))
# Texture units.
_UNITS = {"panorama": 0, "grain": 1, "shadow_map": 2, "layers": 3, "plates": 4}


class Renderer:
    """Draws scenes. Make one per process. It keeps meshes and the last scene, so draw crops scene by scene.

    Raises:
        RuntimeError: no OpenGL; the text says what to install.
    """

    def __init__(self) -> None:
        """Compile the shaders and load the pictures."""
        self._gl = context()
        self._stage = Stage()
        self._sky, self._contact = program("sky"), program("contact")
        self._sky_array = self._gl.vertex_array(self._sky, [])
        self._average = program("average")
        self._average_array = self._gl.vertex_array(self._average, [])
        corners = np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)], dtype="f4")
        self._corner_buffer = self._gl.buffer(corners)
        self._bound: Staged | None = None
        self._targets: dict[tuple[int, int], tuple[Any, Any, Any]] = {}
        self._textures = _textures()
        base, layer = surface_tables()
        for target in self._programs().values():
            set_uniforms(target, {**_UNITS, "base": base, "layer": layer, **self._stage.constants})

    def frame(self, scene: Scene, effects: bool = True) -> Image:
        """The picture (H, W, 3) uint8 of the scene's camera; without `effects` a clean one."""
        window = Window.whole(scene)
        linear = self._draw(scene, window)
        if not effects:
            return camera.plain(linear, scene.light.exposure)
        own = np.random.default_rng([84, scene.seed, scene.number])
        if scene.film:
            return camera.develop(linear, scene, window, np.random.default_rng([87, scene.seed]), own)
        return camera.develop(linear, scene, window, own)

    def crop(
        self, scene: Scene, index: int, box: object, size: tuple[int, int], effects: bool = True
    ) -> Image:
        """The part of the frame inside `box`, resampled to `size`: vehicle `index` and its surroundings.

        Args:
            scene: the frame's scene.
            index: of the vehicle; seeds the effects of the camera.
            box: left, top, right, bottom in pixels of the frame; may reach beyond it.
            size: width, height of the crop.
            effects: False gives a clean picture.

        Returns:
            (height, width, 3) uint8.

        Raises:
            InputError: an index out of range, a box without area, a size that is not positive.
        """
        if not 0 <= integer("index", index) < len(scene.vehicles):
            raise input_error("index", f"0 to {len(scene.vehicles) - 1}", index)
        return self.window(scene, box, size, (85, scene.seed, scene.number, index) if effects else None)

    def window(self, scene: Scene, box: object, size: tuple[int, int], seed: tuple[int, ...] | None) -> Image:
        """The part of the frame inside `box`, resampled to `size`, whatever is there.

        Args:
            scene: the frame's scene.
            box: left, top, right, bottom in pixels of the frame; may reach beyond it.
            size: width, height of the picture.
            seed: of the effects of the camera; None gives a clean picture.

        Returns:
            (height, width, 3) uint8.

        Raises:
            InputError: a box without area, a size that is not positive.
        """
        left, top, right, bottom = shaped("box", box, (4,)).tolist()
        width, height = (integer("size", n) for n in size)
        if not (right > left and bottom > top):
            raise input_error("box", "left < right and top < bottom", [left, top, right, bottom])
        if width < 1 or height < 1:
            raise input_error("size", "a positive width and height", size)
        window = camera.sampled_window((left, top, right, bottom), (width, height))
        linear = self._draw(scene, window)
        if seed is None:
            picture = camera.plain(linear, scene.light.exposure)
        else:
            picture = camera.develop(linear, scene, window, np.random.default_rng(seed))
        return camera.resample(picture, window, (left, top, right, bottom), (width, height))

    def stage(self, scene: Scene) -> Staged:
        """Prepare a scene for drawing; `frame` and `crop` call it."""
        for name, texture in self._textures.items():
            texture.use(_UNITS[name])
        return self._stage.prepare(scene)

    def _programs(self) -> dict[str, Any]:
        return {**self._stage.programs, "sky": self._sky, "contact": self._contact}

    def _draw(self, scene: Scene, window: Window) -> Radiance:
        """Linear radiance (height, width, 3) of a window."""
        staged = self.stage(scene)
        target, picture, resolved = self._target(window.width, window.height)
        self.draw_into(target, staged, window)
        self._gl.enable_only(self._gl.NOTHING)
        resolved.use()
        picture.use(0)
        set_uniforms(self._average, {"size": (window.width, window.height)})
        self._average_array.render(vertices=3)
        data = resolved.read(components=3, dtype="f4", alignment=1)
        return np.frombuffer(data, np.float32).reshape(window.height, window.width, 3)

    def draw_into(self, target: Any, staged: Staged, window: Window) -> None:
        """Draw a window of a scene into a framebuffer."""
        gl, scene = self._gl, staged.scene
        clip = clip_from_camera(scene, window) @ camera_from_world(scene)
        scale = window.width / (window.right - window.left)
        self._bind(scene, staged, clip, window)
        target.use()
        target.clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        gl.enable_only(gl.DEPTH_TEST | gl.CULL_FACE)
        gl.front_face, gl.depth_func = "cw", "<"
        vehicles = staged.seen_vehicles(clip, scale)
        aims = {i: staged.aim(i, clip, scale) for i, *_ in vehicles}
        self._draw_vehicles(staged, vehicles, aims, second=False)
        gl.disable(gl.CULL_FACE)
        props = staged.seen_props(clip, scale)
        self._draw_props(staged, props, second=False)
        staged.ground.draw(clip, staged.uniforms["wear"][3] > 0.0)
        self._draw_props(staged, props, second=True)
        gl.depth_func = "<="
        self._sky_array.render(vertices=3)
        self._draw_contacts(staged, [i for i, *_ in vehicles])
        gl.enable(gl.CULL_FACE | gl.BLEND)
        gl.blend_func = gl.ONE, gl.ONE_MINUS_SRC_ALPHA
        target.depth_mask = False
        self._draw_vehicles(staged, vehicles[::-1], aims, second=True)
        target.depth_mask = True

    def _draw_vehicles(
        self,
        staged: Staged,
        vehicles: list[tuple[int, int, float]],
        aims: dict[int, Aim | None],
        second: bool,
    ) -> None:
        """Draw the bodies or (second) their panes."""
        for i, level, density in vehicles:
            name = _BY_DENSITY[second][density < _CORNER_DENSITY]
            staged.vehicles.meshes[i].draw(name, staged.vehicles.rows[i : i + 1], level, second, aims[i])

    def _draw_props(
        self, staged: Staged, props: list[tuple[GpuMesh, int, NDArray[np.intp]]], second: bool
    ) -> None:
        """Draw walls and houses or (second) leaves and other small things."""
        for mesh, level, shown in props:
            mesh.draw("leaf" if second else "prop", staged.props.rows[shown], level, second)

    def _draw_contacts(self, staged: Staged, order: list[int]) -> None:
        """Darken the road under the vehicles."""
        if not order:
            return
        gl = self._gl
        buffer = gl.buffer(np.ascontiguousarray(staged.contacts[order]))
        array = gl.vertex_array(
            self._contact,
            [
                (self._corner_buffer, "2f", "in_corner"),
                (buffer, "4f 4f 4f 4f/i", "in_row0", "in_row1", "in_row2", "in_half"),
            ],
        )
        gl.enable(gl.BLEND)
        gl.blend_func = gl.ZERO, gl.SRC_COLOR
        array.render(gl.TRIANGLE_STRIP, instances=len(order))
        gl.disable(gl.BLEND)
        array.release()
        buffer.release()

    def _bind(self, scene: Scene, staged: Staged, clip: NDArray[np.float64], window: Window) -> None:
        """Set the uniforms of the view and, when the scene changed, its uniforms and textures."""
        values: dict[str, Any] = {
            "clip_from_world": np.ascontiguousarray(clip.T, dtype="f4"),
            "ray_from_clip": np.ascontiguousarray(ray_from_clip(scene, window).T, dtype="f4"),
        }
        if self._bound is not staged:
            values |= staged.uniforms
            values |= {"eye": tuple(scene.camera_position), "forward": tuple(scene.R_camera_from_world[2])}
            self._bound = staged
        for target in self._programs().values():
            set_uniforms(target, values)
        staged.panorama.use(_UNITS["panorama"])
        self._stage.shadow_map.use(_UNITS["shadow_map"])

    def _target(self, width: int, height: int) -> tuple[Any, Any, Any]:
        """Framebuffer to draw into, its texture, framebuffer of the averaged picture; cached by size."""
        found = self._targets.get((width, height))
        if found is None:
            gl, fine = self._gl, (math.ceil(OVERSAMPLED * width), math.ceil(OVERSAMPLED * height))
            if len(self._targets) >= 32:
                for buffers in self._targets.values():
                    for buffer in buffers:
                        buffer.release()
                self._targets.clear()
            picture = gl.texture(fine, 4, dtype="f4")
            picture.repeat_x = picture.repeat_y = False
            drawn = gl.framebuffer([picture], gl.depth_renderbuffer(fine))
            found = (drawn, picture, gl.framebuffer([gl.renderbuffer((width, height), 4, dtype="f4")]))
            self._targets[width, height] = found
        return found


def _textures() -> dict[str, Any]:
    """Load the textures that every scene uses."""
    gl = context()
    layers = textures.layers()
    array = gl.texture_array((SIZE, SIZE, len(layers)), 4, layers.tobytes())
    grain = gl.texture((SIZE, SIZE), 4, textures.noise_texture().tobytes())
    rows = plates()
    plate = gl.texture((rows.shape[1], rows.shape[0]), 3, rows.tobytes())
    for texture in (array, grain, plate):
        texture.build_mipmaps()
        texture.filter = (gl.LINEAR_MIPMAP_LINEAR, gl.LINEAR)
    return {"layers": array, "grain": grain, "plates": plate}
