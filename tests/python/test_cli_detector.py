"""`groundpose estimate` without boxes: a detector of the user's finds them; pictures by a pattern, frames of
videos with their time."""

import csv
import json
from pathlib import Path

import detectors
import numpy as np
import pytest
import stand_in
from groundpose.cli.inputs import is_image, pictures
from groundpose.keypoints.video import VideoFrame, video_frames
from PIL import Image
from test_cli import one_line, run
from test_cli_images import dump, lines
from test_detector import NAMES, street

WIDE = (300, 120)
NO_POSE = 1
"""Exit status: the network of these tests sees its keypoints anywhere."""
CAMERA = {"fx": 300, "fy": 300, "cx": 150, "cy": 60, "pitch_deg": 1.0}


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """A folder with a detector, a keypoint network, a camera and pictures of a red rectangle."""
    monkeypatch.chdir(tmp_path)
    detectors.write(tmp_path / "found.onnx", metadata=NAMES)
    stand_in.write(tmp_path / "car.onnx")
    dump("camera.json", CAMERA)
    for number in (2, 10, 9):
        path = tmp_path / "frames" / f"frame_{number:04d}.png"
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(street(WIDE)[0]).save(path)
    dump("frames/notes_0001.txt", "no picture")
    return tmp_path


def estimate(*arguments: object):
    return run("estimate", *arguments, "--network", "car.onnx", "--calib", "camera.json", "--no-pictures")


def test_a_detector_instead_of_boxes(here):
    result = estimate("frames", "--detector", "found.onnx", "-o", "poses.jsonl")
    assert result.exit_code == NO_POSE, result.output
    found = lines("poses.jsonl")
    assert [line["id"] for line in found] == ["frame_0002", "frame_0009", "frame_0010"]
    for line in found:
        (item,) = line["objects"]
        np.testing.assert_allclose(item["bbox"], street(WIDE)[1], atol=5.0)
        assert item["detection_score"] == pytest.approx(0.9)
    assert "detector: found.onnx: YOLOv8, YOLO11; 96 x 64; 3 classes" in result.stderr


def test_classes_and_scores_of_a_detector(here):
    detectors.write(here / "found.onnx", metadata={"names": "['a', 'b', 'excavator']"})
    arguments = ("frames/frame_0002.png", "--detector", "found.onnx", "-o")
    result = estimate(*arguments, "poses.jsonl")
    assert lines("poses.jsonl")[0]["objects"] == []
    assert "detector: found no vehicle but 1 excavator; --classes NAME=CLASS says" in result.stderr
    estimate(*arguments, "meant.jsonl", "--classes", "excavator=vehicle")
    assert len(lines("meant.jsonl")[0]["objects"]) == 1
    estimate(*arguments, "number.jsonl", "--classes", "2=vehicle")
    assert len(lines("number.jsonl")[0]["objects"]) == 1
    estimate(*arguments, "sure.jsonl", "--classes", "2=vehicle", "--detector-score", 0.95)
    assert lines("sure.jsonl")[0]["objects"] == []


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("frames", "--detector", "found.onnx", "--boxes", "camera.json"), "expected no --boxes beside it"),
        (
            ("frames", "--boxes", "camera.json", "--detector-score", 0.5),
            "--detector-score: is for --detector",
        ),
        (("frames",), "give the 2D boxes too, --boxes FILE, or --detector FILE"),
        (("frames", "--detector", "camera.json"), "camera.json: expected an ONNX network"),
        (("frames", "--detector", "car.onnx"), "car.onnx: expected an input (1, 3, height, width)"),
        (("frames", "--detector", "none.onnx"), "none.onnx: No such file"),
        (("frames/x_%04d.png", "--detector", "found.onnx"), "frames/x_%04d.png: expected names of pictures"),
        (("none/x_%04d.png", "--detector", "found.onnx"), "none/x_%04d.png: expected names of pictures"),
        (("frames/*.jpg", "--detector", "found.onnx"), "frames/*.jpg: expected names of pictures, got none"),
        (("camera.json", "--detector", "found.onnx"), "camera.json: expected a picture, got another kind"),
        (("camera.json", "--detector-score", 0.5), "--detector-score: is for images, which are given with"),
    ],
)
def test_a_mistake_is_one_line_and_status_2(arguments, text, here):
    result = estimate(*arguments, "-o", "poses.jsonl")
    assert result.exit_code == 2, result.output
    assert text in " ".join(result.stderr.split())


def test_pictures_by_a_pattern(here):
    for pattern, numbers in (
        ("frames/frame_%04d.png", [2, 9, 10]),
        ("frames/frame_%d.png", [2, 9, 10]),
        ("frames/frame_00*.png", [2, 9, 10]),
        ("frames/*_000[29].*", [2, 9]),
        ("frames/*", [2, 9, 10]),
    ):
        assert is_image(Path(pattern))
        labels = [label for label, _ in pictures(Path(pattern))]
        assert labels == [f"frame_{number:04d}" for number in numbers]
    estimate("frames/*_000[29].*", "--detector", "found.onnx", "-o", "poses.jsonl")
    assert [line["id"] for line in lines("poses.jsonl")] == ["frame_0002", "frame_0009"]


def test_numbers_of_any_width_are_in_their_order(here):
    for number in (1, 2, 10, 100):
        Image.new("RGB", (8, 6)).save(here / f"n{number}.png")
    assert [label for label, _ in pictures(Path("n%d.png"))] == ["n1", "n2", "n10", "n100"]
    Image.new("RGB", (8, 6)).save(here / "odd_[1].png")  # a file of this very name is no pattern
    assert pictures(Path("odd_[1].png")) == [("odd_[1]", Path("odd_[1].png"))]


def film(path: Path, count: int = 4, turned: float = 0.0) -> Path:
    """A red rectangle, ten frames a second; the first is shown after 0.5 s."""
    av = pytest.importorskip("av", reason="PyAV is not installed (extra [video])")
    image, _ = street(WIDE)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = *WIDE, "yuv420p"
        if turned:
            if not hasattr(stream, "set_display_rotation"):
                pytest.skip("this PyAV writes no turned videos")
            stream.set_display_rotation(turned)
        for number in range(count):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts = number + 5
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def test_a_video_is_a_row_of_numbered_images_with_their_time(here):
    film(here / "drive.mp4")
    result = estimate("drive.mp4", "--detector", "found.onnx", "-o", "poses.jsonl")
    assert result.exit_code == NO_POSE, result.output
    found = lines("poses.jsonl")
    assert [line["id"] for line in found] == [0, 1, 2, 3]
    assert [line["time"] for line in found] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert {line["image"] for line in found} == {"drive.mp4"}
    np.testing.assert_allclose(found[3]["objects"][0]["bbox"], street(WIDE)[1], atol=6.0)


def test_a_table_of_a_video_has_its_times(here):
    film(here / "drive.mp4")
    estimate("drive.mp4", "--detector", "found.onnx", "-o", "poses.csv")
    with open("poses.csv", encoding="utf-8") as stream:
        assert [float(row["time"]) for row in csv.DictReader(stream)] == pytest.approx([0.0, 0.1, 0.2, 0.3])


def test_boxes_of_a_video_are_those_of_its_numbers(here):
    film(here / "drive.mp4")
    dump("boxes.json", [{"image_id": k, "bbox": [60, 30, 80 + k, 60]} for k in range(4)])
    estimate("drive.mp4", "--boxes", "boxes.json", "-o", "poses.jsonl")
    assert [line["objects"][0]["bbox"][2] for line in lines("poses.jsonl")] == [140, 141, 142, 143]


def test_frames_are_turned_as_players_turn_them(here):
    image, _ = street(WIDE)
    (upright, *_), (stored, *_) = (
        list(video_frames(film(here / "turned.mp4", turned=90.0), exif)) for exif in (True, False)
    )
    assert isinstance(upright, VideoFrame)
    assert (stored.image.shape, upright.image.shape) == (image.shape, (WIDE[0], WIDE[1], 3))
    np.testing.assert_array_equal(upright.image, np.rot90(stored.image))
    assert np.abs(stored.image.astype(int) - image).mean() < 4.0


def test_what_is_no_video_says_so(here, monkeypatch):
    pytest.importorskip("av", reason="PyAV is not installed (extra [video])")
    dump("drive.mp4", "no video")
    result = estimate("drive.mp4", "--detector", "found.onnx", "-o", "poses.jsonl")
    assert result.exit_code == 2
    assert "drive.mp4: expected a video, got" in one_line(result)
    film(here / "film.mp4")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    with pytest.raises(ValueError, match=r"film\.mp4: expected frames of at most 0 million pixels"):
        next(video_frames("film.mp4"))


def test_a_damaged_part_costs_itself_alone(here):
    path = film(here / "drive.avi", 40)
    content = bytearray(path.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 300] = bytes(300)
    path.write_bytes(content)
    found = list(video_frames(path))
    assert len([frame for frame in found if isinstance(frame, VideoFrame)]) >= 30


def test_without_pyav_it_says_what_to_install(here, monkeypatch):
    monkeypatch.setattr("groundpose.keypoints.video.find_spec", lambda name: None)
    dump("drive.mp4", "")
    result = estimate("drive.mp4", "--detector", "found.onnx", "-o", "poses.jsonl")
    assert result.exit_code == 2
    assert "drive.mp4: expected PyAV to read videos, pip install groundpose[video], got none" in one_line(
        result
    )


def test_frames_with_keypoints_keep_their_time(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    frame = {
        "camera": {name: CAMERA[name] for name in ("fx", "fy", "cx", "cy")},
        "time": 2.5,
        "models": {"car": "bundled:car"},
        "objects": [],
    }
    dump("frame.json", frame)
    assert json.loads(run("estimate", "frame.json").stdout)["time"] == 2.5
