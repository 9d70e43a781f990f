"""`groundpose estimate` of images: what goes in, in every form, what comes out, and what a mistake costs."""

import itertools
import json
import os
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
import stand_in
from conftest import project, rotation_y
from groundpose import vehicles
from groundpose.cli import inputs as cli_inputs
from groundpose.formats.kitti.labels import format_calibration
from groundpose.keypoints.codec import Codec
from groundpose.vehicles.keypoints import keypoint_indices
from PIL import Image
from test_cli import one_line, run

SIZE = (640, 300)
VIEW = gp.View(gp.Camera(600.0, 600.0, 320.0, 130.0, image_size=SIZE), pitch=0.01, height=1.6)
MODEL = vehicles.shape_model("car")
R = VIEW.R_camera_from_ground @ rotation_y(np.array(0.6))
T = VIEW.R_camera_from_ground @ [1.0, 1.6, 12.0]


def _box() -> np.ndarray:
    corners = project(VIEW, R, T, np.array(list(itertools.product(*MODEL.bbox_3d.T))))
    return np.concatenate([corners.min(axis=0), corners.max(axis=0)]).round(2)


BOX = _box()
CAR = {"bbox": BOX.tolist(), "class": "car", "score": 0.9, "truth": {"R": R.tolist(), "t": T.tolist()}}
CALIBRATION = {"fx": 600, "fy": 600, "cx": 320, "cy": 130, "pitch_deg": float(np.degrees(VIEW.pitch))}


def car_places() -> np.ndarray:
    """Crop pixels (K, 2) of the car that is projected into BOX."""
    codec = Codec(stand_in.WIDTH, stand_in.HEIGHT)
    places = np.zeros((stand_in.K, 2))
    pixels = project(VIEW, R, T, MODEL.keypoints_3d)
    places[keypoint_indices("car")] = codec.crop_from_image(pixels[None], codec.windows(BOX[None]))[0]
    return places


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> Path:
    """Sees the car that is projected into BOX, in whatever box."""
    return stand_in.write(tmp_path_factory.mktemp("model") / "car.onnx", 0, car_places())


@pytest.fixture
def street(tmp_path, monkeypatch) -> Path:
    """A folder with a picture, its boxes and its calibration; it is the current one."""
    monkeypatch.chdir(tmp_path)
    picture(tmp_path / "street.png")
    dump("boxes.json", [CAR["bbox"]])
    dump("camera.json", CALIBRATION)
    return tmp_path


@pytest.fixture
def undrawn(monkeypatch):
    """Pictures are empty files: drawing takes a second."""
    monkeypatch.setattr(gp.PoseBatch, "draw", lambda poses, image, path, **more: Path(path).write_bytes(b""))


def picture(path: Path, size: tuple[int, int] = SIZE) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.random.default_rng(0).integers(90, 130, (size[1], size[0], 3), dtype=np.uint8)).save(
        path
    )
    return path


def dump(name: str, content: object) -> Path:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def lines(path: str) -> list[dict]:
    return [json.loads(line) for line in Path(path).read_text().splitlines()]


def kitti(*rows: tuple[str, np.ndarray]) -> str:
    return "".join(
        f"{name} -1 -1 -10 {' '.join(map(str, box))} -1 -1 -1 -1000 -1000 -1000 -10 0.9\n"
        for name, box in rows
    )


def estimate(model: Path, *arguments: object, source: str = "street.png", boxes: str = "boxes.json"):
    return run("estimate", source, "--boxes", boxes, "--network", model, *arguments)


def everything() -> set[str]:
    return {path.as_posix() for path in Path().rglob("*") if path.is_file()}


def test_one_image_gives_its_line_and_its_picture(street, model):
    result = estimate(model, "--calib", "camera.json", "-o", "o.jsonl")
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr.startswith("1 image, 1 vehicle, 1 pose, o.jsonl, ")
    (line,) = lines("o.jsonl")
    assert (line["id"], line["image"]) == ("street", "street.png")
    assert line["pitch_deg"] == pytest.approx(CALIBRATION["pitch_deg"])
    (car,) = line["objects"]
    assert (car["id"], car["model"], car["status"], car["bbox"]) == (0, "car", "ok", CAR["bbox"])
    assert car["model_probability"] == pytest.approx(0.7)
    assert len(car["keypoints_2d"]) == len(car["keypoint_scores"]) == len(car["residuals"]) == 28
    np.testing.assert_allclose(car["t"], T, atol=0.15)
    np.testing.assert_allclose(car["R"], R, atol=0.02)
    with Image.open("o.png") as drawn:
        assert drawn.width > 1000


def test_the_tilt_given_by_hand_wins(street, model):
    result = estimate(model, "--calib", "camera.json", "--pitch-deg", -2, "--roll-deg", 1)
    line = json.loads(result.stdout)
    assert (line["pitch_deg"], line["roll_deg"]) == (pytest.approx(-2.0), pytest.approx(1.0))


@pytest.mark.parametrize(
    ("out", "form", "files"),
    [
        ("o.jsonl", "jsonl", {"o.jsonl", "o.png"}),
        ("o.png", "jsonl", {"o.jsonl", "o.png"}),
        ("o", "jsonl", {"o/poses.jsonl", "o/street_poses.png"}),
        ("o", "kitti", {"o/poses.txt", "o/street_poses.png"}),
        ("o.txt", "table", {"o.txt", "o.png"}),
    ],
)
def test_where_results_go(out, form, files, street, model, undrawn):
    before = everything()
    arguments = ("--calib", "camera.json", "-o", out, "--format", form)
    assert estimate(model, *arguments).exit_code == 0
    assert everything() - before == files
    for name in files:
        Path(name).unlink()
    assert estimate(model, *arguments, "--no-pictures").exit_code == 0
    assert everything() - before == {name for name in files if not name.endswith(".png")}


FORMATS = {
    "KITTI": kitti(("Car", BOX)),
    "COCO": {
        "images": [{"id": 3, "file_name": "street.png"}],
        "annotations": [{"id": 0, "image_id": 3, "bbox": [*BOX[:2], *(BOX[2:] - BOX[:2])], "category_id": 1}],
        "categories": [{"id": 1, "name": "car"}],
    },
    "our frame": {"objects": [CAR]},
    "a list": [CAR["bbox"]],
}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("calibration", ["JSON", "KITTI"])
def test_boxes_and_cameras_of_every_format(form, calibration, street, model):
    dump("boxes.any", FORMATS[form])
    dump(
        "camera.any", {"JSON": json.dumps(CALIBRATION), "KITTI": format_calibration(VIEW.camera)}[calibration]
    )
    result = estimate(
        model, "--calib", "camera.any", "--pitch-deg", np.degrees(VIEW.pitch), boxes="boxes.any"
    )
    assert result.exit_code == 0, result.stderr
    (car,) = json.loads(result.stdout)["objects"]
    np.testing.assert_allclose(car["bbox"], BOX, atol=1e-9)
    np.testing.assert_allclose(car["t"], T, atol=0.15)


def test_boxes_may_bring_the_camera_and_the_truth(street, model):
    camera = {name: CALIBRATION[name] for name in ("fx", "fy", "cx", "cy")}
    dump("boxes.json", {"camera": camera, "pitch_deg": CALIBRATION["pitch_deg"], "objects": [CAR]})
    result = estimate(model, "--format", "table")
    assert result.exit_code == 0
    assert "error" in result.stdout
    assert " m " in result.stdout.splitlines()[-1]


@pytest.fixture
def drive(street) -> Path:
    """Five pictures, one of them broken, one without boxes."""
    for i in range(4):
        picture(street / "images" / f"00000{i}.png")
        dump(f"boxes/00000{i}.txt", kitti(("Car", BOX), ("Pedestrian", BOX), ("Van", BOX)))
        dump(f"calib/00000{i}.txt", format_calibration(VIEW.camera))
    picture(street / "images" / "000009.png")
    dump("images/000002.png", "no picture")
    dump("images/notes.txt", "passed over")
    return street


def test_a_folder_loses_only_what_is_bad(drive, model, undrawn):
    result = estimate(model, "--calib", "calib", "-o", "out", source="images", boxes="boxes")
    assert result.exit_code == 1
    assert [(line["id"], len(line["objects"])) for line in lines("out/poses.jsonl")] == [
        ("000000", 2),
        ("000001", 2),
        ("000003", 2),
    ]
    assert {path.name for path in Path("out").glob("*.png")} == {f"00000{i}_poses.png" for i in (0, 1, 3)}
    *errors, summary = result.stderr.splitlines()
    assert summary.startswith("3 images, 6 vehicles, 6 poses, out/poses.jsonl, ")
    assert errors == [
        "error: images/000002.png: expected a picture, got another kind of file",
        "error: boxes: expected a file 000009.*, got none",
        "left out: 3 x Pedestrian, no vehicle",
        "error: images: 2 of 5 images left out",
    ]


def test_a_folder_with_one_file_for_all(drive, model):
    coco = {
        "images": [{"id": i, "file_name": f"left/00000{i}.png"} for i in range(4)],
        "annotations": [{"image_id": i, "bbox": [100, 100, 80, 60], "score": 0.1 * i} for i in range(4)],
    }
    dump("coco.json", coco)
    arguments = (
        "--calib",
        "camera.json",
        "--format",
        "kitti",
        "-o",
        "out",
        "--no-pictures",
        "--min-score",
        0.15,
    )
    result = estimate(model, *arguments, source="images", boxes="coco.json")
    assert result.exit_code == 1
    texts = {path.name: path.read_text() for path in Path("out").iterdir()}
    assert {name: text.count("\n") for name, text in texts.items()} == {
        "000000.txt": 0,
        "000001.txt": 0,
        "000003.txt": 1,
    }
    assert texts["000003.txt"].startswith("Car -1 -1 ")
    assert texts["000003.txt"].endswith(" 0.3000\n")  # the detector's score
    assert "left out: 2 x score below 0.15" in result.stderr
    assert "coco.json: expected boxes of 000009.png, got none" in result.stderr


def test_no_folder_that_is_read_is_written_onto(drive, model, undrawn):
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    arguments = ("--calib", "calib", "--no-pictures", "--format", "kitti")
    for folder in ("boxes", "calib"):
        result = estimate(model, *arguments, "-o", folder, source="images", boxes="boxes")
        assert result.exit_code == 2
        assert f"{folder}/000000.txt is an input; give another folder" in result.stderr
    picture(drive / "images" / "000000_poses.png")
    before[Path("images/000000_poses.png")] = Path("images/000000_poses.png").read_bytes()
    result = estimate(model, "--calib", "calib", "-o", "images", source="images", boxes="boxes")
    assert "images/000000_poses.png is an input" in result.stderr
    assert all(path.read_bytes() == content for path, content in before.items())


def test_strict_asks_for_a_pose_of_every_box(drive, model, undrawn):
    for name in ("000002.png", "000009.png"):
        Path("images", name).unlink()
    arguments = ("--calib", "calib", "-o", "out")
    assert estimate(model, *arguments, source="images", boxes="boxes").exit_code == 0
    assert estimate(model, *arguments, "--strict", source="images", boxes="boxes").exit_code == 1
    for i in (0, 1, 3):
        dump(f"boxes/00000{i}.txt", kitti(("Car", BOX)))
    assert estimate(model, *arguments, "--strict", source="images", boxes="boxes").exit_code == 0


def test_a_table_of_images_has_what_the_network_says(street, model, undrawn):
    result = estimate(model, "--calib", "camera.json", "-o", "out", "--format", "csv")
    assert result.exit_code == 0, result.output
    rows = [line.split(",") for line in Path("out/poses.csv").read_text().splitlines()]
    row = dict(zip(*rows, strict=True))
    assert (row["frame"], row["image"], row["object"], row["class"]) == ("street", "street.png", "0", "car")
    assert float(row["class_probability"]) == pytest.approx(0.7)
    assert 0.0 < float(row["vehicle_probability"]) <= 1.0
    np.testing.assert_allclose([float(row[axis]) for axis in "xyz"], T, atol=0.2)


def test_objects_that_cannot_be_are_kept_with_their_status(street, model, undrawn):
    dump("boxes.json", [[0, 0, 0, 0], CAR["bbox"], [700, 10, 800, 60], [100, 50, 90, 70], [None, 1, 2, 3]])
    result = estimate(model, "--calib", "camera.json", "-o", "o.jsonl")
    assert result.exit_code == 0, result.stderr
    objects = lines("o.jsonl")[0]["objects"]
    assert [o["status"] == "ok" for o in objects] == [False, True, False, False, False]
    np.testing.assert_allclose(objects[1]["t"], lines_of_the_car_alone(model)["t"])
    assert objects[0]["model"] == ""
    assert objects[0]["model_probability"] is None
    dump("boxes.json", [])
    result = estimate(model, "--calib", "camera.json")
    assert json.loads(result.stdout)["objects"] == []


def lines_of_the_car_alone(model: Path) -> dict:
    dump("alone.json", [CAR["bbox"]])
    return json.loads(estimate(model, "--calib", "camera.json", boxes="alone.json").stdout)["objects"][0]


def test_an_interruption_keeps_what_is_done(drive, model, undrawn, monkeypatch):
    calls = itertools.count()

    def interrupted(path, exif):
        if next(calls) == 2:
            raise KeyboardInterrupt
        return stand_in_reader(path, exif)

    from groundpose.cli import images as cli_images

    stand_in_reader = cli_images.as_rgb
    monkeypatch.setattr(cli_images, "as_rgb", interrupted)
    result = estimate(model, "--calib", "calib", "-o", "out", source="images", boxes="boxes")
    assert result.exit_code == 130
    assert [line["id"] for line in lines("out/poses.jsonl")] == ["000000", "000001"]
    assert "interrupted; images finished and written: 2" in result.stderr


MISTAKES = {
    "no such image": ({"source": "none.png"}, "none.png: No such file"),
    "no picture": ({"source": "camera.json"}, "camera.json: expected a picture, got another kind of file"),
    "no boxes file": ({"boxes": "none.json"}, "none.json: No such file"),
    "no boxes in it": ({"boxes": "camera.json"}, "camera.json: expected 2D boxes"),
    "no calibration": (
        {"calib": None},
        "--calib: expected a file with the camera, which the boxes do not have",
    ),
    "no such calibration": ({"calib": "none.txt"}, "none.txt: No such file"),
    "another file": ({"calib": "boxes.json"}, "boxes.json: expected a calibration"),
    "floats": ({"source": "deep.tif"}, "deep.tif: expected whole numbers, got mode F"),
    "image of another size": (
        {"calib": "wide.json"},
        "street.png: image: expected the camera's size (1000, 300)",
    ),
    "no model": ({"model": "none.onnx"}, "none.onnx: No such file"),
    "no model of ours": ({"model": "boxes.json"}, "boxes.json: expected an ONNX network"),
    "model with other keypoints": (
        {"model": "other.onnx"},
        "other.onnx: expected the keypoints of this version",
    ),
    "boxes of one image for many": ({"source": "many"}, "boxes.json: expected boxes that name their images"),
    "folder without pictures": ({"source": "empty"}, "empty: expected a folder with pictures, got none"),
    "result over the boxes": (
        {"out": "boxes.json"},
        "-o boxes.json: boxes.json is an input; give another name",
    ),
    "lines beside a picture over the camera": ({"out": "camera.png", "calib": "camera.jsonl"}, "is an input"),
    "result over the image": ({"out": "street.jsonl"}, "street.png: is the image; give the picture another"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_one_line_and_status_2(case, street, model):
    Image.fromarray(np.full((300, 640), 0.5, dtype=np.float32)).save("deep.tif")
    dump("wide.json", {**CALIBRATION, "image_size": [1000, 300]})
    stand_in.write(street / "other.onnx", keypoints='["nose"]')
    picture(street / "many" / "a.png")
    Path("empty").mkdir()
    changes, text = MISTAKES[case]
    given = {
        "source": "street.png",
        "boxes": "boxes.json",
        "calib": "camera.json",
        "model": model,
        "out": "o",
    } | changes
    calibration = () if given["calib"] is None else ("--calib", given["calib"])
    dump("camera.jsonl", CALIBRATION)
    before = {path: path.read_bytes() for path in Path().glob("*.*")}
    result = estimate(
        given["model"], *calibration, "-o", given["out"], source=given["source"], boxes=given["boxes"]
    )
    assert result.exit_code == 2
    assert text in one_line(result)
    assert all(path.read_bytes() == content for path, content in before.items())


def test_without_a_bundled_network_it_says_what_to_do(street, monkeypatch):
    monkeypatch.setattr("groundpose.keypoints.network.MODELS", street / "none")
    result = run("estimate", "street.png", "--boxes", "boxes.json", "--calib", "camera.json")
    assert result.exit_code == 2
    assert "give the file of one" in one_line(result)


def test_a_camera_of_several_is_named_and_a_field_of_view_needs_no_file(street, model):
    K = [[CALIBRATION["fx"], 0, CALIBRATION["cx"]], [0, CALIBRATION["fy"], CALIBRATION["cy"]], [0, 0, 1]]
    dump("rig.json", {"front": {"K": K}, "rear": {"K": [[9, 0, 1], [0, 9, 1], [0, 0, 1]]}})
    result = estimate(model, "--calib", "rig.json", "-o", "o.jsonl", "--no-pictures")
    assert result.exit_code == 2
    assert "rig.json: camera: expected the name of one of front, rear, got none" in one_line(result)
    named = estimate(model, "--calib", "rig.json", "--camera", "front", "-o", "o.jsonl", "--no-pictures")
    assert named.exit_code == 0, named.output
    fov = np.degrees(2.0 * np.arctan(0.5 * SIZE[0] / CALIBRATION["fx"]))
    seen = estimate(model, "--fov-deg", str(fov), "-o", "fov.jsonl", "--no-pictures")
    assert seen.exit_code == 0, seen.output
    for options, text in (
        (("--camera", "front"), "--camera: expected --calib with a file of several cameras, got none"),
        (("--fov-deg", "50", "--calib", "rig.json"), "--fov-deg: expected no --calib beside it, got both"),
        (("--fov-deg", "180"), "--fov-deg: expected degrees between 0 and 180, got 180"),
    ):
        result = estimate(model, *options, "-o", "x.jsonl")
        assert result.exit_code == 2
        assert text in one_line(result)


def test_a_camera_of_another_image_size_is_remarked_on(street, model):
    dump("large.json", {name: 2.0 * CALIBRATION[name] for name in ("fx", "fy", "cx", "cy")})
    result = estimate(model, "--calib", "large.json", "-o", "o.jsonl", "--no-pictures")
    assert "is far off the middle" in " ".join(result.output.split())


def test_names_that_are_vehicles_are_said(street, model, undrawn):
    dump("boxes.txt", kitti(("Kombi", BOX), ("Person", BOX), ("sedan", BOX)))
    arguments = ("--calib", "camera.json")
    result = estimate(model, *arguments, boxes="boxes.txt")
    assert [o["id"] for o in json.loads(result.stdout)["objects"]] == [0, 2]
    assert result.stderr.splitlines() == ["left out: 1 x Person, no vehicle"]
    result = estimate(
        model, *arguments, "--classes", "sedan=none", "--classes", "kombi=none", boxes="boxes.txt"
    )
    assert json.loads(result.stdout)["objects"] == []
    assert "no box is left; --classes NAME=CLASS says which names are vehicles" in result.stderr
    result = estimate(model, *arguments, "--classes", "Person=car", boxes="boxes.txt")
    assert len(json.loads(result.stdout)["objects"]) == 3
    for wrong, text in (
        ("Kombi", "expected NAME=CLASS, got 'Kombi'"),
        ("Kombi=auto", "a class of car, van_bus"),
    ):
        result = estimate(model, *arguments, "--classes", wrong, boxes="boxes.txt")
        assert result.exit_code == 2
        assert text in one_line(result)


def test_tracks_and_fractions_are_kept_and_mended(street, model, undrawn):
    left, top, right, bottom = BOX / [*SIZE, *SIZE]
    numbers = (2, 0.5 * (left + right), 0.5 * (top + bottom), right - left, bottom - top, 0.5, 17)
    dump("labels/street.txt", " ".join(map(str, numbers)) + "\n")
    result = estimate(model, "--calib", "camera.json", boxes="labels/street.txt")
    (car,) = json.loads(result.stdout)["objects"]
    assert car["id"] == 17
    np.testing.assert_allclose(car["bbox"], BOX, atol=1e-6)


def test_boxes_in_another_convention_are_refused(street, model):
    left, top, right, bottom = BOX.tolist()
    dump(
        "boxes.json",
        [[left, top, right - left, bottom - top], [right, bottom, 100, 80], [right, 150, 100, 80]],
    )
    result = estimate(model, "--calib", "camera.json")
    assert result.exit_code == 2
    expected = "boxes.json: expected left, top, right, bottom pixels of 640 x 300, got boxes that look like"
    assert f"{expected} left, top, width, height" in one_line(result)


def test_remarks_are_said_once_and_are_in_the_lines(street, model, undrawn):
    for name in ("a", "b", "c"):
        picture(street / "many" / f"{name}.png")
        dump(f"boxes/{name}.json", [CAR["bbox"], [100, 50, 90, 70]])
    dump("camera.json", {**CALIBRATION, "cx": 20.0})
    result = estimate(model, "--calib", "camera.json", "-o", "out", source="many", boxes="boxes")
    assert result.exit_code == 0
    kinds = ["principal point", "boxes with right < left or bottom < top"]
    for line in lines("out/poses.jsonl"):
        assert [remark.partition(":")[0] for remark in line["remarks"]][:2] == kinds
    for kind in kinds:
        (said,) = (line for line in result.stderr.splitlines() if kind in line)
        assert said.startswith(f"many/a.png: {kind}: ")
        assert said.endswith("(and 2 more images)")


def test_remarks_on_the_input_stay_beside_those_on_the_estimated_camera(street, model, undrawn):
    dump("camera.json", {**CALIBRATION, "cx": 20.0})
    result = estimate(model, "--calib", "camera.json", "--height", "1.65", "-o", "out")
    assert result.exit_code == 0, result.output
    (line,) = lines("out/poses.jsonl")
    assert "camera_height" in line
    assert line["remarks"][0].startswith("principal point: ")


def test_bad_entries_are_counted_and_named(street, model):
    content = FORMATS["COCO"] | {
        "annotations": [*FORMATS["COCO"]["annotations"], {"image_id": 3, "bbox": []}]
    }
    dump("boxes.any", content)
    result = estimate(model, "--calib", "camera.json", boxes="boxes.any")
    assert (result.exit_code, len(json.loads(result.stdout)["objects"])) == (0, 1)
    assert result.stderr.startswith(
        "left out: 1 x entry without a box: boxes.any: annotations[1].bbox: expected a list"
    )


def test_pictures_are_turned_unless_it_is_said(street, model):
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.open("street.png").transpose(Image.Transpose.ROTATE_90).save("turned.png", exif=exif.tobytes())
    dump("wide.json", {**CALIBRATION, "image_size": list(SIZE)})
    arguments = ("--calib", "wide.json")
    assert estimate(model, *arguments, source="turned.png").exit_code == 0
    result = estimate(model, *arguments, "--no-exif", source="turned.png")
    assert result.exit_code == 2
    assert "expected the camera's size (640, 300), got (300, 640)" in one_line(result)


def test_a_pipe_that_is_called_picture_does_not_hang(street, model):
    os.mkfifo("pipe.png")
    result = estimate(model, "--calib", "camera.json", source="pipe.png")
    assert result.exit_code == 2
    assert "pipe.png: expected a file, got a pipe or a device" in one_line(result)


def test_files_beside_images_are_looked_up_in_one_reading(tmp_path, monkeypatch):
    for name in ("b.txt", "a.json", "a.jpg", "c.one.txt"):
        (tmp_path / name).touch()
    readings = []
    read = Path.iterdir
    monkeypatch.setattr(Path, "iterdir", lambda folder: readings.append(folder) or read(folder))
    found = [
        cli_inputs.companion(tmp_path, name).name for name in ("a.jpg", "in/b.png", "c.jpg", "c.one.jpg")
    ]
    assert found == ["a.json", "b.txt", "c.one.txt", "c.one.txt"]
    assert len(readings) == 1
    with pytest.raises(gp.InputError, match="expected a file d"):
        cli_inputs.companion(tmp_path, "d.jpg")
    (tmp_path / "d.xml").touch()
    os.utime(tmp_path, ns=(1, 1))  # a clock that has gone on
    assert cli_inputs.companion(tmp_path, "d.jpg").name == "d.xml"
    assert len(readings) == 2
    with pytest.raises(gp.InputError, match="expected a file a"):
        cli_inputs.companion(tmp_path / "nowhere", "a.jpg")


def test_frames_of_a_video_as_ultralytics_names_them(street):
    for number in (1, 3):
        dump(f"labels/drive_{number}.txt", "2 0.5 0.5 0.1 0.1\n")
    named = [cli_inputs.frame_companion(Path("labels"), "in/drive.mp4", k) for k in range(3)]
    assert [path and path.name for path in named] == ["drive_1.txt", None, "drive_3.txt"]


def test_images_at_work_ahead_change_no_byte(drive, model, undrawn):
    for threads in ("1", "2"):
        asked = (model, "--calib", "calib", "-o", f"{threads}.jsonl", "--no-pictures", "--threads", threads)
        result = estimate(*asked, source="images", boxes="boxes")
        assert result.exit_code == 1
        assert "000002.png: expected a picture" in result.stderr
    assert Path("1.jsonl").read_bytes() == Path("2.jsonl").read_bytes()
    assert [line["id"] for line in lines("2.jsonl")] == ["000000", "000001", "000003"]
