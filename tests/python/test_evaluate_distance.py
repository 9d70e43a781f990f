"""`groundpose evaluate distance`: what is known is used, and its page."""

from pathlib import Path

import numpy as np
import pytest
from groundpose.formats.kitti.dataset import KittiSet
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
    assert len({row["distance bias %"] for row in rows}) == len(rows)
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
