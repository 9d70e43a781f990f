"""Networks measured: their page, and that poses from true keypoints are the true poses."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is not installed (extra [train])")
pytest.importorskip("moderngl", reason="moderngl is not installed (extra [simulate])")
from groundpose.keypoints.codec import Codec
from groundpose.keypoints.decode import Calibration, Detections
from groundpose.lab.drive.render import Renderer
from groundpose.lab.evaluate.networks import page, poses
from groundpose.lab.evaluate.simulated.errors import Errors
from groundpose.lab.evaluate.simulated.run import everybody
from groundpose.lab.timing import Clock
from groundpose.lab.training.crops import Crops, write_crops
from groundpose.lab.training.rendered import rendered_samples
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
        return Detections.of(points, np.full(points.shape[:2], 0.5), np.full(points.shape[:2], 0.9), classes)


@pytest.fixture(scope="module")
def crops(tmp_path_factory):
    try:
        Renderer()
    except RuntimeError as error:
        pytest.skip(str(error))
    folder = tmp_path_factory.mktemp("crops")
    write_crops(folder, rendered_samples, "test", 6, frames_per_shard=3)
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
