"""The command that measures how a call grows."""

import json
import sys

import pytest
from groundpose.lab.bench import growth


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_growth_measures_every_size(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(growth, "sizes", lambda quick: [(1, None, 1), (100, 8, 1)])
    out = tmp_path / "growth.json"
    monkeypatch.setattr(sys, "argv", ["growth", "--quick", "-o", str(out)])
    growth.main()
    assert str(out) in capsys.readouterr().out
    rows = json.loads(out.read_text())["rows"]
    assert [(row["objects"], row["threads"]) for row in rows] == [(1, 1), (100, 1)]
    assert rows[1]["keypoints"] == 8
    assert all(0.0 < row["us per object"] < 1e5 for row in rows)


def test_sizes_go_to_a_million_objects():
    assert max(objects for objects, _, _ in growth.sizes(False)) == 1_000_000
    assert {threads for _, _, threads in growth.sizes(True)} == {1, 2}
