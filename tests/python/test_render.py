"""Pictures of scenes: crops against frames, boxes, light, repeatability, messages."""

import dataclasses

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.drive import props
from groundpose.lab.drive.body_cache import body
from groundpose.lab.drive.drive import scene
from groundpose.lab.drive.labels import labels
from groundpose.lab.drive.render import Renderer, camera
from groundpose.lab.drive.render.context import context
from groundpose.lab.drive.render.staged import _indicating
from groundpose.lab.drive.render.view import Window
from groundpose.lab.drive.scene import Light, Prop, Scene
from groundpose.lab.drive.splits import scene_seed
from groundpose.lab.drive.surroundings import light
from PIL import Image

CAMERA = gp.Camera.from_fov(400, 226, np.radians(50.8))
SUN = Light("sun", np.array([0.6, -0.7, -0.39]), 3.0, 6, 0.9, 3)


@pytest.fixture(scope="module")
def renderer():
    try:
        return Renderer()
    except RuntimeError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def street() -> Scene:
    """A frame with a car ahead on the open road, small to be fast."""
    made = scene(scene_seed(5), 0)
    car = made.vehicles[0]
    s, d = 14.0, 0.5
    s0 = made.road.locate(*made.camera_position[[0, 2]])[0][0]
    frame = made.road.frame(s0 + s, d)[0]
    yaw = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    car = dataclasses.replace(
        car, R_world=frame @ yaw, t_world=made.road.world(s0 + s, d)[0], lamps_on=False, braking=False
    )
    return dataclasses.replace(made, camera=CAMERA, vehicles=(car,), light=SUN)


@pytest.fixture(scope="module")
def whole(renderer, street):
    return renderer.frame(street, effects=False)


def test_frame_shows_something(whole):
    assert whole.shape == (226, 400, 3)
    assert whole.dtype == np.uint8
    assert whole.std() > 20.0


def test_crop_is_the_cut_of_the_frame(renderer, street, whole):
    crop = renderer.crop(street, 0, (119.5, 69.5, 279.5, 189.5), (160, 120), effects=False)
    difference = np.abs(crop.astype(int) - whole[70:190, 120:280])
    assert (difference > 3).mean() < 0.002  # edges fall a hair beside a pixel's middle
    assert difference.mean() < 0.05


def test_resampled_crop_is_the_resampled_cut(renderer, street, whole):
    box = (150.2, 80.7, 230.4, 140.9)
    crop = renderer.crop(street, 0, box, (128, 96), effects=False)
    cut = Image.fromarray(whole).resize((128, 96), Image.Resampling.BILINEAR, box=tuple(v + 0.5 for v in box))
    assert np.abs(crop.astype(int) - np.asarray(cut)).mean() < 1.0


def test_smaller_crop_looks_like_the_reduced_cut(renderer, street, whole):
    crop = renderer.crop(street, 0, (39.5, 19.5, 359.5, 199.5), (128, 72), effects=False)
    cut = Image.fromarray(whole[20:200, 40:360]).resize((128, 72), Image.Resampling.BILINEAR)
    assert np.abs(crop.astype(int) - np.asarray(cut)).mean() < 4.0


def test_crop_beyond_the_border_of_the_image(renderer, street):
    assert renderer.crop(street, 0, (-60, -40, 100, 80), (64, 48)).shape == (48, 64, 3)


def test_same_scene_same_bytes(renderer, street):
    box, size = (100.0, 60.0, 260.0, 180.0), (128, 96)
    first = renderer.crop(street, 0, box, size)
    other = dataclasses.replace(street, number=street.number + 1)
    assert not np.array_equal(renderer.crop(other, 0, box, size), first)
    again = dataclasses.replace(street)  # staged anew
    np.testing.assert_array_equal(renderer.crop(again, 0, box, size), first)


def test_vehicle_fills_its_box_and_no_more(renderer, street, whole):
    (label,) = labels(street)
    # Without a sun there is no cast shadow; the contact shadow stays low.
    dull = dataclasses.replace(street.light, sun_strength=0.0)
    lit = dataclasses.replace(street, light=dull)
    empty = dataclasses.replace(lit, vehicles=())
    both = [renderer.frame(s, effects=False).astype(int) for s in (lit, empty)]
    left, top, right, bottom = label.bbox
    middle = round(0.4 * top + 0.6 * bottom)
    changed = np.abs(both[0] - both[1]).max(axis=2)[:middle] > 6
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    # Thin things at the edge, a roof aerial or a mirror's rim, may be fainter than the threshold.
    assert -1.5 < rows[0] - top < 4.0
    assert -1.5 < columns[0] - left < 4.0
    assert -4.0 < columns[-1] - right < 1.5


def test_vehicle_darkens_the_road_under_it(renderer, street, whole):
    (label,) = labels(street)
    empty = renderer.frame(dataclasses.replace(street, vehicles=()), effects=False)
    bottom, middle = round(label.bbox[3]), round(0.5 * (label.bbox[0] + label.bbox[2]))
    under = np.s_[bottom - 4 : bottom, middle - 20 : middle + 20]
    assert whole[under].mean() < 0.7 * empty[under].mean()


def _brightness(renderer, street, **changes):
    return renderer.frame(
        dataclasses.replace(street, light=dataclasses.replace(street.light, **changes)), effects=False
    ).mean()


def test_light_changes_brightness_the_right_way(renderer, street):
    plain = _brightness(renderer, street)
    assert _brightness(renderer, street, exposure=0.5) < 0.85 * plain
    assert _brightness(renderer, street, sun_strength=0.5) < plain
    assert _brightness(renderer, street, kind="night", sun_strength=0.3) < 0.6 * plain


def test_front_wheels_steer_and_nothing_else_moves(renderer, street, whole):
    car = street.vehicles[0]
    steered = dataclasses.replace(car, steering=0.5)
    picture = renderer.frame(dataclasses.replace(street, vehicles=(steered,)), effects=False)
    changed = np.argwhere(np.abs(picture.astype(int) - whole).max(axis=2) > 12)[:, ::-1]
    made = body(car.class_name, car.seed)
    R, t = street.camera_from_object(car)
    wheels = CAMERA.project(made.wheels[:2, :3] @ R.T + t)
    radius = 1.6 * made.wheels[0, 3] * CAMERA.fx / t[2]
    away = np.linalg.norm(changed[:, None] - wheels, axis=2).min(axis=1)
    assert len(changed) > 20
    assert (away < radius).mean() > 0.97  # the rest is shadow


def test_indicators_shine_on_the_side_of_the_turn(street):
    car = dataclasses.replace(street.vehicles[0], look_seed=4, state="turning")
    values = [_indicating(dataclasses.replace(car, steering=angle)) for angle in (0.3, -0.2, 0.0)]
    assert values == [1.0, -1.0, 0.0]
    assert _indicating(dataclasses.replace(car, steering=0.3, state="parked")) == 0.0


def test_lamps_shine(renderer, street):
    lit = dataclasses.replace(street.vehicles[0], lamps_on=True, braking=True)
    on = renderer.frame(dataclasses.replace(street, vehicles=(lit,)), effects=False).astype(int)
    off = renderer.frame(street, effects=False).astype(int)
    assert (on - off).max() > 60


@pytest.mark.parametrize(("fence", "seen"), [("planks", False), ("railing", True), ("wire", True)])
def test_a_vehicle_is_seen_through_bars_only(renderer, street, fence, seen):
    car = street.vehicles[0].t_world
    between = car + 0.7 * (street.camera_position - car)
    foot = np.array([between[0], car[1], between[2]])
    away = (car - street.camera_position)[[0, 2]]
    across = float(np.arctan2(away[0], away[1])) + 0.5 * np.pi
    prop = Prop("fence", props.FENCES.index(fence), foot, across, np.array([0.05, 4.0, 20.0]))
    dull = dataclasses.replace(street.light, sun_strength=0.0)
    fenced = dataclasses.replace(street, props=(prop,), light=dull)
    empty = dataclasses.replace(fenced, vehicles=())
    both = [renderer.frame(s, effects=False).astype(int) for s in (fenced, empty)]
    (label,) = labels(dataclasses.replace(street, props=()))
    left, top, right, bottom = label.bbox.astype(int)
    inside = np.abs(both[0] - both[1]).max(axis=2)[top + 3 : bottom - 3, left + 3 : right - 3] > 6
    assert (inside.mean() > 0.3) if seen else (inside.mean() == 0.0)


@pytest.mark.parametrize(
    ("index", "box", "size", "message"),
    [
        (1, (0, 0, 9, 9), (8, 8), "index: expected 0 to 0"),
        (0, (9, 0, 0, 9), (8, 8), "box: expected left < right"),
        (0, (0, 0, 9), (8, 8), "box: expected shape"),
        (0, (0, 0, 9, 9), (0, 8), "size: expected a positive"),
    ],
)
def test_wrong_arguments(renderer, street, index, box, size, message):
    with pytest.raises(gp.InputError, match=message):
        renderer.crop(street, index, box, size)


def test_missing_egl_names_the_packages(monkeypatch):
    moderngl = pytest.importorskip("moderngl")

    def fail(**_):
        raise Exception("(detect) libEGL.so: cannot open shared object file")

    monkeypatch.setattr(moderngl, "create_context", fail)
    with pytest.raises(RuntimeError, match=r"libegl1 libgl1-mesa-dri.*libEGL"):
        context.__wrapped__()


def test_missing_moderngl_names_the_extra(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "moderngl", None)
    with pytest.raises(RuntimeError, match=r"groundpose\[simulate\]"):
        context.__wrapped__()


# The camera


def _grey(value: float) -> np.ndarray:
    return np.full((48, 64, 3), value, dtype=np.float32)


def _developed(street, linear, seed=0):
    window = Window(99.5, 99.5, 163.5, 147.5, 64, 48)
    return camera.develop(linear, street, window, np.random.default_rng(seed))


def test_camera_is_drawn_from_its_seed(street):
    linear = _grey(0.2)
    np.testing.assert_array_equal(_developed(street, linear), _developed(street, linear))
    assert not np.array_equal(_developed(street, linear, 0), _developed(street, linear, 1))


@pytest.mark.parametrize("seed", range(8))
def test_camera_keeps_dark_dark_and_bright_bright(street, seed):
    means = [_developed(street, _grey(v), seed).mean() for v in (0.0, 0.05, 0.3, 4.0)]
    assert means == sorted(means)
    assert means[0] < 40
    assert means[-1] > 200


def test_every_stage_does_something(street):
    rng = np.random.default_rng(1)
    linear = rng.random((48, 64, 3), dtype=np.float32) + (rng.random((48, 64, 1)) > 0.95) * np.float32(9.0)
    window = Window(9.5, 9.5, 73.5, 57.5, 64, 48)
    for _, stage in camera.STAGES:
        shot = camera.Shot(0.7, window, (400, 226), 1.0, np.random.default_rng(3))
        out = stage(linear, shot)
        assert out.shape == linear.shape, stage
        assert out.dtype == np.float32, stage
        assert np.abs(out - linear).max() > 0.01, stage


@pytest.mark.parametrize("size", [(128, 96), (256, 192)])
@pytest.mark.parametrize("box", [(10.3, 20.8, 50.1, 51.0), (-100.0, 0.0, 1500.0, 1080.0)])
def test_window_covers_the_box(box, size):
    window = camera.sampled_window(box, size)
    assert window.left <= box[0]
    assert window.top <= box[1]
    assert window.right >= box[2]
    assert window.bottom >= box[3]
    # never finer than the frame, never much finer than the crop
    assert window.width <= min(box[2] - box[0] + 5, 1.45 * size[0] + 5)


def test_every_kind_of_light_is_drawn():
    rng = np.random.default_rng(0)
    assert len({light(rng).kind for _ in range(300)}) == 6
