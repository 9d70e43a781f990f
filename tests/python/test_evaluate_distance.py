"""`groundpose evaluate distance`: what is known is used, and its page."""

import math
from dataclasses import replace
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.demo.street import IMAGE, example
from groundpose.formats.kitti.dataset import KittiSet
from groundpose.lab.evaluate import distance_sets
from groundpose.lab.evaluate.kitti import distance
from groundpose.lab.evaluate.kitti.bench import make_folder
from groundpose.lab.evaluate.kitti.distance import MARKS, SETTINGS, Set, Setting, measure, write_page
from groundpose.lab.evaluate.kitti.frame import Task
from groundpose.lab.evaluate.kitti.keypoints import Simulated


@pytest.fixture(scope="module")
def frames(tmp_path_factory) -> Set:
    root = tmp_path_factory.mktemp("kitti")
    make_folder(root, 12, seed=3)
    return Set.of("table", KittiSet(root), Simulated(), Task(keypoints="simulated"))


def test_every_setting_gives_other_distances(frames):
    rows = [measure(frames, setting) for setting in SETTINGS]
    assert [row["setting"] for row in rows] == [setting.name for setting in SETTINGS]
    single = [row for row in rows if not row["drives"]]
    assert len({row["distance bias %"] for row in single}) == len(single)
    # every frame is a drive here, of which it is the first frame
    bias = {row["setting"]: row["distance bias %"] for row in rows}
    for name in ("one road, height, region", "one road, height"):
        assert bias[f"{name}, over frames"] == pytest.approx(bias[name], abs=1e-9)
    for row in rows:
        assert row["objects"] > 10
        assert 0.0 <= row["95 % interval of distance holds %"] <= 100.0
    assert [row["drives"] > 0 for row in rows] == [setting.camera_state for setting in SETTINGS]


def test_a_larger_height_means_larger_distances(frames):
    bias = [measure(frames, Setting("", height, "europe"))["distance bias %"] for height in (1.3, 1.65, 2.1)]
    assert np.all(np.diff(bias) > 1.0)


def test_the_page_is_written_between_its_marks(frames, tmp_path):
    rows = [measure(frames, SETTINGS[0])]
    path = tmp_path / "page.md"
    path.write_text(f"before\n{MARKS[0]}\nstale numbers\n{MARKS[1]}\nafter\n", encoding="utf-8")
    for _ in range(2):
        write_page({"sets": {"table": rows}}, path)
    text = path.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert text.count("every vehicle alone") == 1
    assert "stale" not in text


def test_the_page_is_that_of_the_stored_numbers():
    root = Path(__file__).parents[2]
    page = (root / distance.PAGE).read_text(encoding="utf-8")
    assert distance.write_stored(root) is not None
    assert (root / distance.PAGE).read_text(encoding="utf-8") == page


def test_a_drive_with_exact_truth():
    frames = list(distance_sets.drive(drives=1))
    rows = [distance_sets.measure(frames, setting) for setting in distance_sets.ON_A_CAR]
    assert [row["drives"] for row in rows] == [int(s.over_frames) for s in distance_sets.ON_A_CAR]
    alone, _, height, _, large, small = rows
    assert alone["objects"] > 100
    assert alone["median tilt error deg"] > 0.2, "the nominal tilt is not the true one"
    assert small["distance bias %"] < height["distance bias %"] < large["distance bias %"]
    exact = replace(distance_sets.ON_A_CAR[0], exact_tilt=True)
    assert distance_sets.measure(frames, exact)["median tilt error deg"] < 1e-5


def test_the_street_of_the_demo_wants_its_tilt_beside_its_height():
    """Its camera looks up by 2.4 degrees and is said to be level: a true height then makes all too near."""
    street = example()
    known = replace(street.view, height=street.true_view.height)
    told = gp.FramePriors(pitch_sigma=math.radians(2.5), roll_sigma=math.radians(2.5))
    pipeline = gp.Pipeline(threads=1)

    def bias(view: gp.View, frame: gp.FramePriors) -> float:
        poses = pipeline(IMAGE, street.bboxes, view, frame=frame)
        return float(np.nanmedian(np.linalg.norm(poses.t, axis=1) / np.linalg.norm(street.t, axis=1) - 1.0))

    level, unsure, exact = bias(known, gp.FramePriors()), bias(known, told), bias(street.true_view, told)
    assert level < -0.03
    assert abs(unsure) < 0.02
    assert abs(exact) < 0.015
