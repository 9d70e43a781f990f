"""The page of an evaluation: what it says, and that a browser shows it."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.formats.kitti.dataset import KittiSet
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import html
from groundpose.lab.evaluate.kitti import page
from groundpose.lab.evaluate.kitti.bench import make_folder
from groundpose.lab.evaluate.kitti.frame import Task
from groundpose.lab.evaluate.kitti.keypoints import Simulated
from groundpose.lab.evaluate.kitti.run import Worker, run
from PIL import Image
from typer.testing import CliRunner

REAL = data_folder() / "kitti"


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    """The page of a made-up folder with one bad label, by two methods."""
    root = tmp_path_factory.mktemp("kitti")
    make_folder(root / "k", 25, seed=5)
    with (root / "k" / "training" / "label_2" / "000003.txt").open("a") as stream:
        stream.write("Car <b>bold</b>\n")
    arguments = ["--root", root / "k", "--keypoints", "simulated", "--jobs", 1, "-m", "default"]
    arguments += ["-m", "p1p+hre", "-o", root / "a.json", "--report", root / "page"]
    result = CliRunner().invoke(app, ["evaluate", "kitti", *map(str, arguments)])
    assert result.exit_code == 0, result.output
    assert "index.html" in result.output
    return root / "page" / "index.html"


def test_the_page_says_everything_and_needs_nothing(written):
    text = written.read_text()
    for words in ("ours, default", "RNSC-P1P+HRE", "easy / moderate / hard", "Average precision", "24 worst"):
        assert words in text
    assert "cut-off line" in text
    assert "&lt;b&gt;bold" in text  # what stands in files is text
    assert "<b>bold" not in text
    assert "simulated" in text
    assert not re.search(r'(?:src|href)="(?!data:)', text)
    assert "<script" not in text
    assert text.count("data:image/svg+xml") == 1  # by distance; all stand on one flat road
    assert text.count("data:image/png") == 1
    assert len(text) < 5_000_000


def test_a_browser_shows_the_page(written, tmp_path):
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no chromium is installed")
    picture = tmp_path / "page.png"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1300,2400"]
    options += [f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}"]
    done = subprocess.run(
        [browser, *options, written.as_uri()], capture_output=True, timeout=120, check=False
    )
    assert picture.exists(), done.stderr.decode()[-500:]
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    assert pixels.shape == (2400, 1300, 3)
    inked = (pixels < 200).any(axis=2)
    assert inked[:300].any()
    assert inked.mean() > 0.02
    blue = (pixels[..., 2] - pixels[..., 0] > 100).sum()  # the curve of our method
    assert blue > 200
    assert not inked[:, -20:].any()  # nothing runs over the side


def test_a_page_of_nothing_says_why(tmp_path):
    make_folder(tmp_path / "k", 2)
    for path in (tmp_path / "k" / "training" / "calib").iterdir():
        path.unlink()
    worker = Worker(KittiSet(tmp_path / "k"), Task(keypoints="simulated"), Simulated())
    content, _ = run(worker, tmp_path / "b.json")
    text = page.write(content, worker, tmp_path / "page").read_text()
    assert "0 frames" in text
    assert "frame without a readable file in calib" in text


def test_the_same_run_gives_the_same_page(tmp_path):
    make_folder(tmp_path / "k", 6)
    worker = Worker(KittiSet(tmp_path / "k"), Task(keypoints="simulated"), Simulated())
    content, _ = run(worker, tmp_path / "c.json")
    first = page.write(content, worker, tmp_path / "one").read_text()
    assert page.write(content, worker, tmp_path / "two").read_text() == first


def test_pictures_of_real_frames(tmp_path):
    if not REAL.is_dir():
        pytest.skip(f"no KITTI frames in {REAL} (GROUNDPOSE_DATA)")
    worker = Worker(KittiSet(REAL), Task(keypoints="simulated"), Simulated())
    content, _ = run(worker, tmp_path / "d.json", limit=3)
    text = page.write(content, worker, tmp_path / "page").read_text()
    assert "data:image/png" in text
    assert f"{len(content['worst'])} worst" in text


def test_tables_are_plain_text():
    text = html.table([{"a": 1.23456, "b": None}, {"a": [1.0, None], "c": "<x>"}])
    assert "<td>1.23</td><td>–</td><td>–</td>" in text
    assert "<td>1 / –</td>" in text
    assert "&lt;x&gt;" in text
    assert html.page("A & B", []).count("A &amp; B") == 2


def test_pages_are_made_without_pytorch():
    code = "import sys; sys.modules['torch'] = None; import groundpose.lab.evaluate.honesty.page"
    subprocess.run([sys.executable, "-c", code], check=True)
