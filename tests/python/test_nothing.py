"""Crops without a vehicle: their boxes, their records, that they repeat."""

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.drive import scene, scene_seed
from groundpose.lab.training import nothing, nothing_boxes
from groundpose.lab.training.crops import LABEL, STORED, record_of
from groundpose.lab.training.nothing_boxes import LARGEST_PIECE, MOST_COVERED, MOST_SHOWN, View, covered
from groundpose.lab.training.nothing_patterns import PATTERNS, pattern
from groundpose.lab.training.rendered import FRAME_STEP
from groundpose.vehicles import CLASSES

FRAMES = [scene(scene_seed(3), number) for number in (0, 40, 210, 380)]
FREE = ("anywhere", "on the road", "thing")


def places(name, count=15):
    choose = next(kind.choose for kind in nothing.KINDS if kind.name == name)
    for frame in FRAMES:
        view, rng = View.of(frame), np.random.default_rng(5)
        for place in (choose(rng, view) for _ in range(count)):
            if place is not None:
                yield view, place


def test_fractions_add_up():
    assert sum(kind.fraction for kind in nothing.KINDS) == pytest.approx(1.0)


@pytest.mark.parametrize("name", [*FREE, "piece of a vehicle", "empty place"])
def test_boxes_have_a_detectors_shapes(name):
    found = list(places(name))
    assert len(found) >= 10
    for view, place in found:
        cut = nothing_boxes.inside(place.box, view.size)
        assert cut is not None
        np.testing.assert_array_equal(cut, place.box)


@pytest.mark.parametrize("name", [*FREE, "empty place"])
def test_no_vehicle_of_the_scene_is_in_the_box(name):
    for _, place in places(name):
        assert (covered(place.box, View.of(place.scene).vehicles) <= MOST_COVERED).all()


def test_an_empty_place_is_a_vehicles_and_its_neighbours_stay():
    for view, place in places("empty place"):
        assert (view.vehicles == place.box).all(axis=1).any()
        gone = len(view.scene.vehicles) - len(place.scene.vehicles)
        assert gone == (covered(place.box, view.vehicles) > MOST_COVERED).sum() >= 1


def test_a_piece_is_a_small_part_of_one_vehicle():
    for view, place in places("piece of a vehicle"):
        meets = covered(place.box, view.vehicles) > MOST_COVERED
        assert meets.sum() == 1
        vehicle = view.vehicles[meets][0]
        assert covered(place.box, vehicle[None])[0] == pytest.approx(1.0)
        assert covered(vehicle, place.box[None])[0] <= LARGEST_PIECE + 1e-9
        assert covered(vehicle, nothing_boxes._CROP.windows(place.box[None]))[0] <= MOST_SHOWN


def test_covered():
    boxes = np.array([[0, 0, 10, 10], [5, 5, 15, 15], [20, 20, 30, 30]], float)
    np.testing.assert_allclose(covered(boxes[0], boxes), [1.0, 0.25, 0.0])


@pytest.mark.parametrize("draw", range(len(PATTERNS)))
@pytest.mark.parametrize("size", [(160, 120), (320, 240)])
def test_patterns(draw, size):
    for seed in range(5):
        drawn = PATTERNS[draw](np.random.default_rng(seed), *size)
        assert drawn.shape == (size[1], size[0], 3)
        assert np.isfinite(drawn).all()
        made = [pattern(np.random.default_rng(seed), *size) for _ in range(2)]
        assert made[0].dtype == np.uint8
        np.testing.assert_array_equal(*made)


def test_a_record_of_nothing():
    box, window = np.array([1.0, 2, 31, 22]), np.array([0.0, 0, 40, 30])
    made = record_of(box=box, window=window, image_size=(640, 480), frame=7, object=-3)
    assert made.dtype == LABEL
    assert (made["kind"], made["frame"], made["object"], made["occluded"]) == (len(CLASSES), 7, -3, 0)
    assert np.isnan(made["keypoints"]).all()
    assert not made["state"].any()
    np.testing.assert_array_equal(made["box"], box)
    np.testing.assert_array_equal(made["window"], window)
    np.testing.assert_array_equal(made["image_size"], [640, 480])


@pytest.fixture(scope="module")
def renderer():
    pytest.importorskip("moderngl", reason="moderngl is not installed (extra [simulate])")
    from groundpose.lab.drive.render import Renderer

    try:
        return Renderer()
    except RuntimeError as error:
        pytest.skip(str(error))


def test_samples_depend_on_the_arguments_alone(renderer):
    from groundpose.lab.training.mixed import DriveSamples

    for source in (nothing.nothing_samples, DriveSamples()):
        both = list(source(3, "validation", 0, 2, STORED))
        second = list(source(3, "validation", 1, 1, STORED))
        assert 0 < len(second) < len(both)
        for a, b in zip(both[-len(second) :], second, strict=True):
            np.testing.assert_array_equal(a.image, b.image)
            assert a.label.tobytes() == b.label.tobytes()


def test_a_quarter_of_the_mixed_crops_is_nothing(renderer):
    from groundpose.lab.training.mixed import NOTHING_PER_VEHICLE, DriveSamples

    kinds = np.array([int(s.label["kind"]) for s in DriveSamples()(3, "train", 0, 25, STORED)])
    vehicles, empty = (kinds < len(CLASSES)).sum(), (kinds == len(CLASSES)).sum()
    assert vehicles > 40
    assert empty / vehicles == pytest.approx(NOTHING_PER_VEHICLE, abs=0.15)


def test_vehicles_of_the_mixed_crops_are_the_rendered_ones(renderer):
    from groundpose.lab.training.mixed import DriveSamples

    mixed = [s for s in DriveSamples("car")(3, "train", 0, 2, STORED) if s.label["kind"] < len(CLASSES)]
    alone = list(DriveSamples("car", nothing=0.0)(3, "train", 0, 2, STORED))
    assert len(alone) > 0
    for a, b in zip(mixed, alone, strict=True):
        np.testing.assert_array_equal(a.image, b.image)
        assert a.label.tobytes() == b.label.tobytes()


def test_a_window_is_the_crop_of_a_vehicle_with_its_seed(renderer):
    frame = next(f for f in FRAMES if f.vehicles)
    box = (400.0, 300.0, 560.0, 420.0)
    crop = renderer.crop(frame, 0, box, (64, 48))
    same = renderer.window(frame, box, (64, 48), (85, frame.seed, frame.number, 0))
    np.testing.assert_array_equal(crop, same)
    clean = renderer.crop(frame, 0, box, (64, 48), effects=False)
    np.testing.assert_array_equal(clean, renderer.window(frame, box, (64, 48), None))


def test_a_folder_of_another_drive_is_not_continued(tmp_path, monkeypatch):
    from groundpose.lab.training import crops
    from groundpose.lab.training.mixed import DriveSamples, drive_version

    monkeypatch.setattr(DriveSamples, "__call__", lambda *_: iter(()))

    def write(source: DriveSamples) -> int:
        return crops.write_crops(tmp_path, source, "train", 1)

    assert [write(DriveSamples()), write(DriveSamples())] == [1, 0]
    stated = f"rigs='mixed', nothing=0.25, frame_step={FRAME_STEP}, drive='{drive_version()}'"
    assert stated in (tmp_path / "index.json").read_text()
    for other in (DriveSamples(frame_step=3), DriveSamples(rigs="car"), DriveSamples(drive="0" * 16)):
        with pytest.raises(gp.InputError, match="expected crops made with the same source"):
            write(other)
