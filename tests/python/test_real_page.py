"""docs/real_data.md is what the stored numbers say."""

from pathlib import Path

import pytest
from groundpose.lab.evaluate.real_page import PAGE, RESULTS, SECTIONS, render

ROOT = Path(__file__).parents[2]


def test_the_page_is_made_of_the_stored_numbers():
    if not (ROOT / RESULTS).is_dir():
        pytest.skip("no results/real in this copy")
    text = render(ROOT / RESULTS)
    assert text == (ROOT / PAGE).read_text(encoding="utf-8"), "run groundpose evaluate pages"
    stored = {path.stem for path in (ROOT / RESULTS).glob("*.json")}
    assert stored <= {name for name, _ in SECTIONS}, "numbers that are on no page"
    assert {"vehicles_class", "vehicles_rigid", "kitti_labels", "apollo", "tilt", "speed"} <= stored


def test_a_page_of_nothing_is_the_introduction(tmp_path):
    assert render(tmp_path).startswith("# Real data")
    assert "ours, default" not in render(tmp_path)
