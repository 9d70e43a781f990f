"""The picture of the demo's street: a small painter of ground, houses and vehicles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.demo_scene import CAMERA_HEIGHT, KEYPOINT_NAMES, Scene

_SCALE = 2  # painted this much larger and then reduced: smooth edges

_SKY_HIGH, _SKY_LOW = np.array([116.0, 164.0, 208.0]), np.array([226.0, 234.0, 240.0])
_ASPHALT, _PARKING, _PAVEMENT = (
    np.array([112.0, 114.0, 118.0]),
    np.array([124.0, 125.0, 127.0]),
    np.array([178.0, 174.0, 166.0]),
)
_GRASS, _PAINT = np.array([126.0, 150.0, 98.0]), np.array([236.0, 236.0, 230.0])
_GLASS, _RUBBER, _RIM = (58, 70, 84), (34, 34, 36), (168, 170, 174)
_LAMP, _TAIL_LAMP = (250, 246, 220), (196, 34, 30)
_HAZE = 160.0  # metres at which colours have faded by 63 %

# Both kerbs, the lanes' edges and where parking places end (metres to the right of the camera).
_LEFT_KERB, _LEFT_PARKING, _MIDDLE, _RIGHT_PARKING, _RIGHT_KERB = -7.7, -5.25, -1.75, 2.2, 4.6

_Colour = tuple[int, int, int]
_Detail = tuple[FloatArray, _Colour]
_Panel = tuple[FloatArray, _Colour, Sequence[_Detail]]


def paint(scene: Scene) -> NDArray[np.uint8]:
    """The street as the camera sees it, (600, 1280, 3)."""
    from PIL import Image, ImageDraw

    image = Image.fromarray(_background(scene).astype(np.uint8))
    draw = ImageDraw.Draw(image, "RGBA")
    for outline, colour in _houses(scene):
        draw.polygon([tuple(p) for p in outline.tolist()], fill=colour)
    for index in np.argsort(-scene.t[:, 2]):
        _paint_vehicle(draw, scene, int(index))
    size = scene.view.camera.image_size
    assert size is not None
    return np.asarray(image.resize(size, Image.Resampling.LANCZOS))


def _background(scene: Scene) -> FloatArray:
    """Sky and ground, each pixel by where its ray goes."""
    camera = scene.view.camera
    assert camera.image_size is not None
    width, height = camera.image_size
    v, u = np.mgrid[: height * _SCALE, : width * _SCALE]
    pixels = (np.stack([u, v], axis=-1) + 0.5) / _SCALE - 0.5
    rays = np.concatenate(
        [(pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones((*u.shape, 1))], axis=-1
    )
    rays = rays @ scene.true_view.R_camera_from_ground
    down = rays[..., 1]
    up = np.clip(-down / 0.35, 0.0, 1.0)[..., None]
    colours = _SKY_LOW + up * (_SKY_HIGH - _SKY_LOW)
    ground = down > 1e-6
    points = rays[ground] * (CAMERA_HEIGHT / down[ground])[:, None]
    shade = _ground_colour(points[:, 0], points[:, 2])
    colours[ground] = _faded(shade, points[:, 2:])
    return np.asarray(colours)


def _ground_colour(x: FloatArray, z: FloatArray) -> FloatArray:
    colours = np.broadcast_to(_ASPHALT, (*x.shape, 3)).copy()
    colours[(x < _LEFT_PARKING) | (x > _RIGHT_PARKING)] = _PARKING
    colours[(x < _LEFT_KERB) | (x > _RIGHT_KERB)] = _PAVEMENT
    colours[(x < _LEFT_KERB - 2.5) | (x > _RIGHT_KERB + 2.5)] = _GRASS
    side_road = (np.abs(z - 37.5) < 3.6) & (x < _LEFT_PARKING)
    colours[side_road] = _ASPHALT
    dash = (np.abs(x - _MIDDLE) < 0.07) & (z % 6.0 < 3.0)
    edges = (np.abs(x - _LEFT_PARKING) < 0.06) | (np.abs(x - _RIGHT_PARKING) < 0.06)
    places = ((x < _LEFT_PARKING) & (x > _LEFT_KERB)) | ((x > _RIGHT_PARKING) & (x < _RIGHT_KERB))
    bars = places & (np.abs((z - 4.0) % 6.6) < 0.12)
    colours[(dash | edges | bars) & ~side_road] = _PAINT
    kerbs = (np.abs(x - _LEFT_KERB) < 0.09) | (np.abs(x - _RIGHT_KERB) < 0.09)
    colours[kerbs & ~side_road] = 0.82 * _PAVEMENT
    return np.asarray(colours)


def _faded(colours: FloatArray, depth: FloatArray) -> FloatArray:
    """Haze: colours go over into the low sky with the distance."""
    share = np.exp(-np.maximum(depth, 0.0) / _HAZE)
    return np.asarray(colours * share + _SKY_LOW * (1.0 - share))


def _pixels(scene: Scene, ground_points: FloatArray) -> FloatArray:
    """Points of the ground frame in the enlarged picture."""
    view = scene.true_view
    return (view.project(ground_points @ view.R_camera_from_ground.T) + 0.5) * _SCALE - 0.5


def _houses(scene: Scene) -> Iterator[tuple[FloatArray, _Colour]]:
    """Fronts along both sides, far ones first: the wall along the street and the one that faces us."""
    rng = np.random.default_rng(7)
    for z in np.arange(112.0, 4.0, -12.0):
        for side in (-1.0, 1.0):
            x0 = side * rng.uniform(11.5, 13.0)
            height = rng.uniform(6.0, 13.0)
            colour = rng.uniform(160.0, 206.0) + rng.uniform((0.0, -10.0, -34.0), (14.0, 4.0, -4.0))
            depth = rng.uniform(9.0, 11.5)
            if abs(z + 6.0 - 37.5) < 9.0 and side < 0:
                continue  # the side road
            y0, y1 = CAMERA_HEIGHT, CAMERA_HEIGHT - height
            front = np.array([[x0, y0, z], [x0 + side * 14, y0, z], [x0 + side * 14, y1, z], [x0, y1, z]])
            along = np.array([[x0, y0, z], [x0, y0, z + depth], [x0, y1, z + depth], [x0, y1, z]])
            for wall, light in ((front, 0.86), (along, 1.0)):
                yield _pixels(scene, wall), _colour(_faded(colour * light, np.array(z)))
            yield from _windows(scene, x0, z, depth, height)


def _windows(
    scene: Scene, x: float, z: float, depth: float, height: float
) -> Iterator[tuple[FloatArray, _Colour]]:
    for up in np.arange(1.6, height - 1.6, 2.9):
        for start in np.arange(z + 1.2, z + depth - 1.6, 2.6):
            y0, y1 = CAMERA_HEIGHT - up, CAMERA_HEIGHT - up - 1.4
            pane = np.array([[x, y0, start], [x, y0, start + 1.3], [x, y1, start + 1.3], [x, y1, start]])
            yield _pixels(scene, pane), _colour(_faded(np.array([104.0, 120.0, 138.0]), np.array(start)))


def _colour(values: FloatArray) -> _Colour:
    r, g, b = (int(v) for v in np.clip(values, 0.0, 255.0))
    return r, g, b


def _paint_vehicle(draw: object, scene: Scene, index: int) -> None:
    from PIL import ImageDraw

    assert isinstance(draw, ImageDraw.ImageDraw)
    R, t, points = scene.R[index], scene.t[index], scene.bodies[index]
    half, _, nose = points.max(axis=0)
    angles = np.linspace(0.0, 2.0 * np.pi, 40)
    # A soft shadow: a few flat ovals, each smaller than the last.
    for size in (1.16, 1.08, 1.0):
        x, z = half * size * _rounded(np.cos(angles)), nose * size * _rounded(np.sin(angles))
        oval = np.stack([x, np.zeros_like(x), z], axis=1)
        draw.polygon([tuple(p) for p in _enlarged(scene, oval @ R.T + t).tolist()], fill=(20, 22, 26, 70))
    for tyre in _tyres(points):
        draw.polygon([tuple(p) for p in _enlarged(scene, tyre @ R.T + t).tolist()], fill=_RUBBER)
    panels = []
    for panel, colour, details in _panels(points, scene.paints[index]):
        camera = panel @ R.T + t
        normal = np.cross(camera[1] - camera[0], camera[2] - camera[1])
        if normal @ camera[0] < 0.0:  # else turned away, and all that is on it
            parts = [(camera, colour), *((detail @ R.T + t, shade) for detail, shade in details)]
            panels.append(
                (float(np.linalg.norm(camera.mean(axis=0))), normal / np.linalg.norm(normal), parts)
            )
    for _, normal, parts in sorted(panels, key=lambda panel: -panel[0]):
        light = 0.82 + 0.26 * float(normal @ [0.35, -0.85, -0.4])
        for camera, colour in parts:
            shade = _colour(_faded(np.array(colour, dtype=float) * light, camera[:1, 2]))
            edge = _colour(np.array(shade) * 0.72)
            draw.polygon(
                [tuple(p) for p in _enlarged(scene, camera).tolist()], fill=shade, outline=edge, width=2
            )


def _rounded(share: FloatArray) -> FloatArray:
    """Sines to the power one half: an oval that fills most of its rectangle."""
    return np.sign(share) * np.sqrt(np.abs(share))


def _enlarged(scene: Scene, camera_points: FloatArray) -> FloatArray:
    return (scene.true_view.project(camera_points) + 0.5) * _SCALE - 0.5


def _tyres(points: FloatArray) -> Iterator[FloatArray]:
    """What is seen of the tyres below the body from ahead and behind."""
    for name, (x, y, z) in zip(KEYPOINT_NAMES, points, strict=True):
        if name.startswith("wheel"):
            inner = x - 0.22 * np.sign(x)
            yield np.array([[inner, 0.0, z], [x, 0.0, z], [x, y, z], [inner, y, z]])


def _panels(points: FloatArray, paint: _Colour) -> Iterator[_Panel]:
    """The outside of a body: polygons clockwise as seen from outside, with what is mounted on them."""
    at = dict(zip(KEYPOINT_NAMES, points, strict=True))

    def across(front: str, back: str, colour: _Colour, details: Sequence[_Detail] = ()) -> _Panel:
        names = (f"{front}_left", f"{back}_left", f"{back}_right", f"{front}_right")
        return np.stack([at[name] for name in names]), colour, details

    yield across("bumper_front", "hood_front", paint, _lamps(at, "bumper_front", "hood_front", _LAMP))
    yield across("hood_front", "windshield_base", paint)
    yield across("windshield_base", "roof_front", _GLASS)
    yield across("roof_front", "roof_rear", paint)
    yield across("roof_rear", "rear_window_base", _GLASS)
    yield across("rear_window_base", "tail", paint)
    yield across("tail", "bumper_rear", paint, _lamps(at, "bumper_rear", "tail", _TAIL_LAMP))
    yield from _side(at, "left", paint)
    yield from _side(at, "right", paint)


def _lamps(at: dict[str, FloatArray], low: str, high: str, colour: _Colour) -> list[_Detail]:
    lamps = []
    for side, other in (("left", "right"), ("right", "left")):
        corner, below, inner = at[f"{high}_{side}"], at[f"{low}_{side}"], at[f"{high}_{other}"]
        a, b = corner + 0.14 * (below - corner), corner + 0.46 * (below - corner)
        inset, step = 0.03 * (inner - corner), 0.24 * (inner - corner)
        lamps.append((np.stack([a + inset, a + step, b + step, b + inset]), colour))
    return lamps


def _side(at: dict[str, FloatArray], side: str, paint: _Colour) -> Iterator[_Panel]:
    lower = ("bumper_front", "hood_front", "windshield_base", "rear_window_base", "tail", "bumper_rear")
    upper = ("windshield_base", "roof_front", "roof_rear", "rear_window_base")
    flank, cabin = (np.stack([at[f"{name}_{side}"] for name in names]) for names in (lower, upper))
    turn = slice(None, None, -1) if side == "left" else slice(None)
    window = cabin.mean(axis=0) + 0.82 * (cabin - cabin.mean(axis=0))
    pillar = at[f"door_{side}"]
    post = np.stack([cabin[0] + share * (cabin[3] - cabin[0]) for share in (0.44, 0.49)])
    top = np.stack([cabin[1] + share * (cabin[2] - cabin[1]) for share in (0.49, 0.44)])
    handle = pillar + np.array([[0.0, 0.10, -0.16], [0.0, 0.10, 0.04], [0.0, 0.14, 0.04], [0.0, 0.14, -0.16]])
    yield cabin[turn], paint, [(window, _GLASS), (np.concatenate([post, top]), paint)]
    angles = np.linspace(0.0, 2.0 * np.pi, 28, endpoint=False)
    circle = np.stack([np.zeros(28), np.sin(angles), np.cos(angles)], axis=1)
    wheels = [at[f"wheel_{end}_{side}"] for end in ("front", "rear")]
    radii = ((1.0, _RUBBER), (0.6, _RIM))
    discs = [(hub - share * hub[1] * circle, colour) for hub in wheels for share, colour in radii]
    yield flank[turn], paint, [*discs, (handle, _GLASS)]
