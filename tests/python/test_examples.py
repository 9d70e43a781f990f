"""The programs of examples/python run as their users run them, on small inputs."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import groundpose as gp
import pytest
from groundpose.cli.main import app
from groundpose.demo import example
from groundpose.keypoints.network import bundled
from PIL import Image, ImageChops
from typer.testing import CliRunner

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "python"
STREET = EXAMPLES / "street"
needs_network = pytest.mark.skipif(not bundled().exists(), reason="the bundled network is not there")


def run(name: str, folder: Path, *arguments: object) -> str:
    """What an example prints; it runs in `folder`."""
    command = [sys.executable, str(EXAMPLES / name), *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def size(path: Path) -> tuple[int, int]:
    """Width and height of a picture."""
    with Image.open(path) as picture:
        return picture.size


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_an_example_is_short_and_shows_its_command(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 60
    assert f"python examples/python/{path.name}" in text.split('"""')[1]


@needs_network
def test_image_to_poses(tmp_path):
    printed = run("image_to_poses.py", tmp_path)
    assert printed.count("car, ") == 2, printed
    assert (tmp_path / "street_poses.png").stat().st_size > 100_000


def test_own_models(tmp_path):
    rows = run("own_models.py", tmp_path).splitlines()
    assert len(rows) == 3
    assert all(row.startswith("ok: ") for row in rows), rows


@needs_network
@pytest.mark.parametrize("beside", [True, False], ids=["a file of boxes per image", "one file"])
def test_folder(tmp_path, beside):
    """Three images, boxes in one file or in one per image, the camera with them."""
    images, boxes = tmp_path / "images", tmp_path / "boxes"
    images.mkdir()
    boxes.mkdir()
    frame = json.loads((STREET / "street.json").read_text(encoding="utf-8"))
    rows = []
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        (images / name).write_bytes((STREET / "street.jpg").read_bytes())
        rows.append(json.dumps({**frame, "image": name}))
        (boxes / name).with_suffix(".json").write_text(rows[-1], encoding="utf-8")
    together = tmp_path / "boxes.jsonl"
    together.write_text("\n".join(rows), encoding="utf-8")
    out = tmp_path / "poses.csv"
    run("folder.py", tmp_path, images, "--boxes", boxes if beside else together, "--out", out)
    with out.open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert [row["image"] for row in table] == ["a.jpg"] * 2 + ["b.jpg"] * 2 + ["c.jpg"] * 2
    assert {row["status"] for row in table} == {"ok"}
    assert {row["class"] for row in table} == {"car"}


@needs_network
def test_video(tmp_path):
    """An animated picture whose second frame is the first moved aside, and a third without boxes."""
    street = example()
    first = Image.fromarray(street.image)
    moved = ImageChops.offset(first, 20, 0)
    first.save(tmp_path / "drive.tif", save_all=True, append_images=[moved, first])
    camera = street.view.camera
    head = {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")}
    rows = [
        {"id": number, "camera": head, "objects": [{"bbox": (box + shift).tolist()} for box in boxes]}
        for number, (shift, boxes) in enumerate(
            [([0, 0, 0, 0], street.bboxes), ([20, 0, 20, 0], street.bboxes), ([0] * 4, [])]
        )
    ]
    (tmp_path / "boxes.jsonl").write_text("\n".join(map(json.dumps, rows)), encoding="utf-8")
    printed = run("video.py", tmp_path, "drive.tif", "--boxes", "boxes.jsonl").splitlines()
    assert [row.split(":")[0] for row in printed] == ["frame 0", "frame 1", "frame 2"]
    assert printed[2].startswith("frame 2: no vehicle")
    assert all(" m, yaw " in row for row in printed[:2])


@needs_network
def test_the_photograph_of_the_readme_is_what_its_command_makes(tmp_path):
    """The two cars stand in their lanes: ahead, on one ground, 3 to 4.5 m apart (a lane is 3.7 m wide)."""
    here = "examples/python/street/street"
    command = f"groundpose estimate {here}.jpg --boxes {here}.json --draw docs/street.jpg"
    assert command in (STREET / "README.md").read_text(encoding="utf-8")
    assert (ROOT / "docs" / "street.jpg").stat().st_size < 400_000
    given = [STREET / "street.jpg", "--boxes", STREET / "street.json", "--draw", tmp_path / "street.jpg"]
    result = CliRunner().invoke(app, ["estimate", *map(str, given), "-o", str(tmp_path / "poses.jsonl")])
    assert result.exit_code == 0, result.output
    cars = json.loads((tmp_path / "poses.jsonl").read_text(encoding="utf-8"))["objects"]
    assert [car["status"] for car in cars] == ["ok", "ok"]
    assert all(abs(car["yaw"]) < 0.1 and 15.0 < car["t"][2] < 22.0 for car in cars)
    assert 3.0 < cars[1]["t"][0] - cars[0]["t"][0] < 4.5
    assert size(tmp_path / "street.jpg") == size(ROOT / "docs" / "street.jpg")


def test_the_camera_of_the_photograph_is_as_its_file_says():
    from groundpose.formats.boxes import read_boxes

    view = read_boxes(STREET / "street.json").of("street.jpg").view
    assert isinstance(view, gp.View)
    assert view.camera.image_size == size(STREET / "street.jpg")
