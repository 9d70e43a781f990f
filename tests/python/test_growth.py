"""The command that measures how time and memory grow, its tables and its figure."""

import json
import sys
from pathlib import Path

import pytest
from groundpose.lab.bench import growth, growth_figure, growth_images, growth_page

ROOT = Path(__file__).parents[2]
IMAGES = [
    {
        "images": n,
        "threads": threads,
        "s": 1.0 + 0.004 * (n - 1) / threads,
        "processor s": 1.0,
        "MB at most": 110.0,
    }
    for n in (1, 11, 101)
    for threads in (1, 2)
]


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_growth_measures_every_size(monkeypatch, tmp_path, capsys):
    sizes = [(1, None, 1, False), (1, None, 2, False), (100, 8, 1, False), (20, None, 1, True)]
    monkeypatch.setattr(growth, "sizes", lambda quick: sizes)
    monkeypatch.setattr(growth, "image_sizes", lambda quick: [(1, 1), (2, 1), (1, 2), (2, 2)])
    out, page = tmp_path / "new" / "growth.json", tmp_path / "growth.md"
    page.write_text((ROOT / "docs/growth.md").read_text("utf-8"), "utf-8")
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["growth", "--quick", "-o", str(out), "--page", str(page)])
    growth.main()
    said = capsys.readouterr().out
    assert all(str(path) in said for path in (out, out.with_suffix(".png"), page))
    content = json.loads(out.read_text())
    rows = content["rows"]
    assert [(row["objects"], row["threads"], row["scene"]) for row in rows[:3]] == [
        (1, 1, "vehicle"),
        (1, 2, "vehicle"),
        (100, 1, "cube"),
    ]
    assert rows[2]["keypoints"] == 8
    assert all(0.0 < row["us per object"] < 1e5 for row in rows)
    assert [row["images"] for row in content["images"]] == [1, 2, 1, 2]
    assert all(row["s"] > 0.0 and row["MB at most"] > 10.0 for row in content["images"])
    assert "| 100,000, extrapolated |" in page.read_text("utf-8")


def test_sizes_go_to_a_million_objects_and_many_images():
    assert max(objects for objects, *_ in growth.sizes(False)) == 1_000_000
    assert {threads for _, _, threads, _ in growth.sizes(True)} == {1, 2}
    assert max(images for images, _ in growth.image_sizes(False)) == 10_000
    assert len(growth.image_sizes(True)) == 4


def test_an_image_more_takes_what_is_left_after_the_start():
    assert growth_images.per_image(IMAGES, 1) == [(11, pytest.approx(4.0)), (101, pytest.approx(4.0))]
    assert growth_images.per_image(IMAGES, 2)[1] == (101, pytest.approx(2.0))
    assert growth_images.extrapolated(IMAGES, 1, 1001) == pytest.approx(5.0)


def row(objects: int, threads: int, scene: str = "vehicle", single: bool = False) -> dict:
    numbers = {"us per object": 10.0, "bytes per object": 444.0, "bytes per object, all fields": 1900.0}
    what = {
        "scene": scene,
        "objects": objects,
        "keypoints": 30,
        "threads": threads,
        "single precision": single,
    }
    return what | numbers


def test_tables_and_figure_follow_from_what_was_measured(tmp_path):
    rows = [row(n, threads) for n in (10, 1000) for threads in (1, 2)]
    rows += [row(1000, 1, "cube"), row(1000, 1, single=True)]
    content = {"machine": "a machine", "versions": {}, "rows": rows, "images": IMAGES}
    many = growth_page.of_objects(content)
    assert [line["bytes per object held"] for line in many] == [None, 444]
    machine = {"memory GB/s": 20.0, "gflops": 40.0}
    assert growth_page.limits(content, {}) == []
    bench = json.loads((ROOT / "results/bench.json").read_text("utf-8"))
    limits = growth_page.limits(content, bench | {"cases": bench["cases"] | {"machine": machine}})
    # 30 x 16 + 32 + 8 read and 444 held in 10 µs: 0.0964 of 20 GB/s
    assert limits[0]["of that, %"] == pytest.approx(0.482)
    assert limits[2]["of that, %"] == pytest.approx(2.0 * limits[1]["of that, %"])
    for path, told in ((tmp_path / "a.png", limits), (tmp_path / "b.png", [])):
        growth_figure.write(content, told, path)
        assert path.stat().st_size > 10_000
