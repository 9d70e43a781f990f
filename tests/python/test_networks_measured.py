"""Networks measured: their page, and that poses from true keypoints are the true poses."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is not installed (extra [train])")
pytest.importorskip("moderngl", reason="moderngl is not installed (extra [simulate])")
from groundpose import InputError
from groundpose.keypoints.codec import Codec
from groundpose.keypoints.decode import VIEWING_ANGLES, Calibration, Detections
from groundpose.lab.drive.render import Renderer
from groundpose.lab.drive.rigs import Rig
from groundpose.lab.evaluate.networks import page, poses, reliability, renders, sweeps
from groundpose.lab.evaluate.networks.judged import Judged, judge, other_half
from groundpose.lab.evaluate.networks.measure import _same_file, measure
from groundpose.lab.evaluate.networks.targets import WANTED, target_table
from groundpose.lab.evaluate.simulated.errors import Errors
from groundpose.lab.evaluate.simulated.run import everybody
from groundpose.lab.timing import Clock
from groundpose.lab.training.crops import NOTHING, Crops, write_crops
from groundpose.lab.training.evaluate import Answers
from groundpose.lab.training.sources import source_named
from groundpose.vehicles import CLASSES


class KnowsAll:
    """Stands in for a network: says what the labels say."""

    codec = Codec(128, 96)
    calibration = Calibration()

    def __init__(self, crops: Crops) -> None:
        self.labels = crops.labels
        self.windows = self.codec.windows(crops.labels["box"].astype(float))

    def detect(self, pictures):
        n = len(pictures)
        labels, windows = self.labels[:n], self.windows[:n]
        self.labels, self.windows = self.labels[n:], self.windows[n:]
        points = self.codec.crop_from_image(labels["keypoints"].astype(float), windows)
        classes = np.eye(len(CLASSES))[labels["kind"]]
        spread, peak = np.full(points.shape[:2], 0.5), np.full(points.shape[:2], 0.9)
        angles = np.full((n, VIEWING_ANGLES), np.nan)
        known = np.isfinite(labels["alpha"])
        bins = np.rint(labels["alpha"][known] / (2.0 * np.pi / VIEWING_ANGLES)).astype(int)
        angles[known] = np.eye(VIEWING_ANGLES)[bins % VIEWING_ANGLES]
        return Detections.of(points, spread, peak, classes, np.ones(n), angles)


@pytest.fixture(scope="module")
def crops(tmp_path_factory):
    try:
        Renderer()
    except RuntimeError as error:
        pytest.skip(str(error))
    folder = tmp_path_factory.mktemp("crops")
    write_crops(folder, source_named("car"), "test", 6, frames_per_shard=3)
    return Crops(folder, "test")


def test_true_keypoints_give_the_true_poses(crops):
    objects, rows = poses._truth(crops)
    assert len(objects) > 5
    same = crops.of(rows, objects.seen.bboxes)
    given, _ = poses.detected(KnowsAll(same), crops, "G1", "true boxes", 0)
    np.testing.assert_allclose(given.keypoints_2d, objects.seen.keypoints_2d, atol=1e-3)
    ours = next(c for c in everybody("G1") if c.name == "ours, default, scores as weights")
    errors = Errors.of(objects, ours.solve(given, Clock()), given.shapes())
    assert np.median(errors.e_r_deg) < 0.1


def test_crops_as_if_other_boxes_had_been_found(crops):
    rows = np.array([3, 1])
    boxes = crops.labels["box"][rows] + 2.0
    some = crops.of(rows, boxes)
    images, labels = some.take(np.arange(2))
    np.testing.assert_array_equal(labels["box"], boxes)
    np.testing.assert_array_equal(images, crops.take(rows)[0])
    assert not np.array_equal(crops.labels["box"][rows], boxes)


def test_page_is_made_between_its_marks(tmp_path):
    (tmp_path / "docs").mkdir()
    path = tmp_path / page.PAGE
    path.write_text("before <!-- measured: begin -->old<!-- measured: end --> after")
    held_out = {"crops": 7.0, "class_accuracy": 0.99, "error_px": 9.0}
    held_out |= {"error_px_visible": 5.0, "error_share": 0.03}
    errors = {"trials": 7, "mean_e_r_deg": 3.0, "median_e_r_deg": 1.2, "mean_e_t_percent": 2.5}
    trained = {
        "held_out": {"all": held_out | {"within_visible": 0.95}},
        "poses": {"G1, true boxes": {"ours, default, scores as weights": errors}},
        "mb": 1.5,
        "crop_ms": {"network alone, 1 thread": 2.0},
        "object_ms": {"crop": 0.1, "network": 0.8, "all": 1.0},
    }
    page.write_page(tmp_path, {"costs": {}, "trained": {"lite": trained}})
    text = path.read_text()
    assert text.startswith("before ")
    assert text.endswith(" after")
    assert "old" not in text
    assert "| lite | all: 7 | 99 | 9 | 5 | 3 | 95 |" in text
    assert "| lite | G1, true boxes | 7 | 3 / 1.2 / 2.5 |" in text
    assert "| lite | 1.5 | 2 | 0.1 | 0.8 | 1 |" in text
    page.write_page(tmp_path / "nowhere", {})


def test_renders_are_those_wanted_and_true_keypoints_give_their_poses(tmp_path, monkeypatch, crops):
    wanted = renders.Wanted(
        Rig((6.0, 6.0), (-30.0, -20.0), fov_deg=(90.0, 90.0), standing=True), 6, (30.0, 200.0)
    )
    monkeypatch.setitem(renders.SETS, "toy", wanted)
    told = []
    seen = renders.renders(tmp_path, "toy", told.append)
    assert len(seen.crops) == 6
    assert told[-1] == "toy: 6 of 6 vehicles"
    heights = seen.crops.labels["box"][:, 3] - seen.crops.labels["box"][:, 1]
    assert ((heights >= 30.0) & (heights < 200.0)).all()
    np.testing.assert_allclose([view.pitch for view in seen.views], np.radians(-25.0), atol=np.radians(8.0))
    np.testing.assert_allclose(seen.crops.labels["alpha"], seen.alpha, atol=1e-6)
    judged = judge(KnowsAll(seen.crops), seen)
    assert np.median(judged.rotation_error) < 5.0  # the class's mean shape, not the body's
    assert judged.numbers()["class_accuracy"] == 1.0
    assert judged.turned()["turned_told"] is None  # none is turned
    assert judged.turned()["right_told_turned"] == 0.0
    np.testing.assert_array_equal(judged.other_half, 0.0)
    twice = renders.moved(seen, 2)
    assert sorted(np.concatenate(twice.rows)) == list(range(12))
    np.testing.assert_array_equal(twice.crops.labels["box"][:6], seen.crops.labels["box"])
    assert np.abs(twice.crops.labels["box"][6:] - seen.crops.labels["box"]).max() > 0.1
    np.testing.assert_array_equal(twice.R[6:], seen.R)


def test_square_on_means_seen_from_the_front_or_from_behind():
    wanted = renders.Wanted(Rig(), square_on=True, heights=(0.0, 1000.0))
    for alpha, chosen in ((0.5 * np.pi, True), (-0.5 * np.pi + 0.3, True), (0.0, False), (1.1, False)):
        label = SimpleNamespace(
            alpha=alpha,
            occluded_share=0.0,
            truncation=0.0,
            bbox=np.array([0.0, 0.0, 9.0, 9.0]),
            keypoints_2d=np.zeros((3, 2)),
        )
        assert wanted._has(label) == chosen


def test_probability_of_the_other_half_of_the_viewing_angles():
    bins = np.zeros((3, VIEWING_ANGLES))
    bins[0, 4] = 1.0  # 90 degrees
    bins[1, [4, 12]] = 0.7, 0.3
    bins[2] = np.nan
    found = other_half(bins, np.radians([80.0, 80.0, 80.0]))
    np.testing.assert_allclose(found, [0.0, 0.3, np.nan])
    np.testing.assert_allclose(other_half(bins[:2], np.radians([-100.0, -100.0])), [1.0, 0.7])


def test_turned_poses_and_what_the_viewing_angle_says():
    yaw, other = np.array([170.0, 100.0, 2.0, 3.0]), np.array([0.9, 0.1, 0.3, 0.0])
    judged = Judged(yaw, yaw, np.ones(4, dtype=bool), other, np.array([1.0, 0.2, 1.0, 1.0]))
    found = judged.turned()
    assert found == {
        "vehicles": 4, "turned": 0.5, "turned_count": 2, "turned_told": 0.5, "right_told_turned": 0.5
    }  # fmt: skip
    assert judged.numbers()["called_none"] == 0.25


def test_scores_that_say_what_they_are():
    rng = np.random.default_rng(0)
    scores = rng.random(20_000)
    good = rng.random(20_000) < scores
    assert reliability.numbers(scores, good)["calibration_error"] < 0.02
    assert reliability.numbers(scores, ~good)["calibration_error"] > 0.3


def test_reliability_by_place(crops):
    labels = crops.labels.copy()
    labels["kind"][0] = NOTHING
    labels["keypoints"][0] = np.nan
    codec, rows = Codec(128, 96), len(labels)
    detections = KnowsAll(crops).detect(np.zeros((rows, 1)))
    errors = np.where(np.isnan(labels["keypoints"][..., 0]), np.nan, 0.0)
    sides = np.full(rows, 50.0)
    windows = codec.windows(labels["box"].astype(float))
    found = reliability.reliability(
        Answers(detections, labels, windows, errors, sides, sides), codec, Calibration()
    )
    assert found["nothing there"]["good"] == 0.0
    assert found["inside the crop"]["good"] == 1.0
    assert found["all"]["keypoints"] == sum(m["keypoints"] for name, m in found.items() if name != "all")


def test_targets_name_what_is_stored(tmp_path):
    assert len({wanted.target.id for wanted in WANTED}) == len(WANTED)
    sweep = {"focal length": {}, "roll": {}}
    numbers = {"vehicles": 3, "median_e_r_deg": 1.0, "class_accuracy": 0.9}
    sweep["focal length"] = {f"{x:g}": numbers for x in renders.FOCAL}
    sweep["roll"] = {f"{x:g}": numbers for x in renders.ROLL}
    bins = {"keypoints": 9, "mean_score": 0.8, "good": 0.7, "calibration_error": 0.1, "bins": [[0.8, 0.7, 9]]}
    one = {
        "looks": {"all: yaw above 15 deg %": 3.0, "all: yaw above 30 deg %": 2.0},
        "road_side": {place: numbers for place in renders.ROAD_SIDE},
        "sweeps": sweep | {"worst focal length": 1.5, "worst roll": 3.0},
        "reliability": {"all": bins},
        "mb": 1.0,
    }
    found = {"costs": {}, "trained": {"default": one}}
    looks = "real streets, development cars, 12 looks each"
    lines = {(line["measure"], line["number"]): line for line in target_table(found)}
    assert lines[(looks, "yaw above 15 deg")]["met"] is True
    assert lines[(looks, "yaw above 30 deg")]["met"] is False
    assert lines[(looks, "mean e_r")]["met"] is None
    (tmp_path / "docs").mkdir()
    (tmp_path / page.PAGE).write_text("<!-- measured: begin --><!-- measured: end -->")
    page.write_page(tmp_path, found)
    text = (tmp_path / page.PAGE).read_text()
    assert "| default |" + 5 * " 1 / 90 |" in text
    assert "| default | 1.5 | 3 |" in text
    assert (tmp_path / sweeps.FIGURE).exists()
    assert (tmp_path / reliability.FIGURE).exists()


def test_only_known_parts_and_numbers_of_the_same_file(tmp_path):
    with pytest.raises(InputError, match="only"):
        measure(tmp_path, [], tmp_path, 0, False, print, "guesses")
    (tmp_path / "a.onnx").write_bytes(b"weights")
    stored = _same_file({"looks": 1}, tmp_path / "a.onnx")
    assert stored["looks"] == 1
    (tmp_path / "a.onnx").write_bytes(b"others")
    assert "looks" not in _same_file(stored, tmp_path / "a.onnx")


def test_vehicles_of_another_camera_are_refused(crops):
    some = crops.of(np.arange(len(crops)), crops.labels["box"] + 5.0)
    with pytest.raises(InputError, match="crops"):
        poses._truth(some)
