"""KITTI's folders: what is read, and what is said of files that are not as they should be."""

import tempfile
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.formats.kitti.dataset import KittiSet, difficulty
from groundpose.formats.kitti.labels import (
    KittiLabel,
    TrackedLabel,
    format_labels,
    format_tracking,
    read_labels,
    read_tracking,
)
from groundpose.formats.skips import PLACES_KEPT, Skips
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate.kitti.bench import make_folder
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

REAL = data_folder() / "kitti"
GOOD = "Car 0.00 0 -1.58 587.01 173.33 614.12 200.12 1.65 1.67 3.64 -0.65 1.71 46.70 -1.59"
LABEL = KittiLabel("Car", 0.0, 0, -1.58, (587.0, 173.0, 614.0, 200.0), 1.6, 1.7, 3.6, (-0.6, 1.7, 46.0), -1.6)


def real_set() -> KittiSet:
    if not REAL.is_dir():
        pytest.skip(f"no KITTI frames in {REAL} (GROUNDPOSE_DATA)")
    return KittiSet(REAL)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make_folder(tmp_path / "kitti", 3)
    return tmp_path / "kitti"


def read(folder: Path, frame_id: str = "000000") -> tuple[object, Skips]:
    skipped = Skips()
    return KittiSet(folder).read(frame_id, skipped), skipped


def label_file(folder: Path) -> Path:
    return folder / "training" / "label_2" / "000000.txt"


def test_real_frames_are_read():
    folder, skipped = real_set(), Skips()
    frames = {frame.id: frame for frame in folder.frames(None, skipped)}
    assert len(frames) == 9
    assert skipped.total == 0
    assert frames["916002"].image_size == (1224, 370)
    # KITTI's 6 cm between the cameras
    np.testing.assert_allclose(frames["000008"].camera_from_labels, [0.0599, -0.0004, 0.0027], atol=1e-4)
    assert [difficulty(label) for label in frames["000008"].labels[:6]] == [3, 1, 3, 1, 1, 0]


def test_labelled_boxes_are_those_of_the_labelled_poses():
    """The fourth column of P2 and the angle's convention, on real labels."""
    differences = []
    for frame in real_set().frames(None, Skips()):
        for label in frame.labels:
            if not label.has_pose or label.truncated > 0.0 or label.location[2] < 8.0:
                continue
            c, s = np.cos(label.rotation_y), np.sin(label.rotation_y)
            R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])  # KITTI's own: x forward, z left
            x, z = np.meshgrid([-label.length / 2, label.length / 2], [-label.width / 2, label.width / 2])
            ground = np.stack([x.ravel(), np.zeros(4), z.ravel()], axis=1)
            corners = np.concatenate([ground, ground - [0, label.height, 0]]) @ R.T
            corners += label.location + frame.camera_from_labels
            pixels = corners @ frame.camera.K.T
            pixels = pixels[:, :2] / pixels[:, 2:]
            differences.append(np.r_[pixels.min(axis=0), pixels.max(axis=0)] - label.bbox)
    assert len(differences) > 20
    assert np.median(np.abs(differences)) < 1.0


def test_labels_results_and_tracks_round_trip(tmp_path):
    path = tmp_path / "a.txt"
    scored = KittiLabel(*list(LABEL.__dict__.values())[:-1], score=0.75)
    for rows in ([LABEL, LABEL], [scored]):
        path.write_text(format_labels(rows))
        assert read_labels(path) == rows
    tracked = [TrackedLabel(0, 1, LABEL), TrackedLabel(0, -1, LABEL), TrackedLabel(7, 1, LABEL)]
    path.write_text(format_tracking(tracked))
    assert read_tracking(path) == {0: tracked[:2], 7: tracked[2:]}


@pytest.mark.parametrize(
    ("line", "reason", "expected"),
    [
        (GOOD[:40], "cut-off line", "a type and 14 numbers"),
        (GOOD + " 0.9 7", "too many values", "a type and 14 numbers"),
        (GOOD.replace("1.65", "tall"), "not a number", "a type and 14 numbers"),
        (GOOD.replace("1.65", "nan"), "not a finite number", "all finite"),
        (GOOD.replace("Car", "car"), "unknown class", "one of Car, Van"),
    ],
)
def test_a_bad_line_is_an_error_with_its_place_or_is_counted(tmp_path, line, reason, expected):
    path = tmp_path / "a.txt"
    path.write_text(f"{GOOD}\n\n{line}\n{GOOD}\n")
    with pytest.raises(gp.InputError, match=rf"a.txt:3: expected .*{expected}"):
        read_labels(path)
    skipped = Skips()
    assert len(read_labels(path, skipped)) == 2
    assert skipped.counts == {reason: 1}
    assert f"{path}:3" in skipped.places[reason][0]


def test_windows_line_ends_are_no_difference(folder):
    text = label_file(folder).read_text()
    before, _ = read(folder)
    for path in (label_file(folder), folder / "training" / "calib" / "000000.txt"):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    after, skipped = read(folder)
    assert text
    assert skipped.total == 0
    assert after.labels == before.labels
    assert after.camera == before.camera


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (GOOD.replace("587.01", "687.01"), "box without area"),
        (GOOD.replace("587.01", "1587.01").replace("614.12", "1614.12"), "box outside the image"),
        (GOOD.replace("1.65", "-1"), "label without size or place"),
        (GOOD.replace("46.70", "-46.70"), "label behind the camera"),
        (f"{GOOD}\n{GOOD}", "duplicate label"),
    ],
)
def test_a_label_that_cannot_be_used_is_left_out_and_counted(folder, line, reason):
    label_file(folder).write_text(f"{line}\n")
    frame, skipped = read(folder)
    assert skipped.counts == {reason: 1}
    assert "000000" in skipped.places[reason][0]
    assert len(frame.labels) == (reason == "duplicate label")


def test_regions_to_ignore_need_no_size(folder):
    label_file(folder).write_text(
        "DontCare -1 -1 -10 503.89 169.71 590.61 190.13 -1 -1 -1 -1000 -1000 -1000 -10\n"
    )
    frame, skipped = read(folder)
    assert skipped.total == 0
    assert len(frame.labels) == 1


def test_an_empty_frame_is_a_frame(folder):
    label_file(folder).write_text("")
    frame, skipped = read(folder)
    assert frame.labels == []
    assert skipped.total == 0


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("calib", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\n", "frame with a bad calibration"),
        ("calib", "P2: 1 0 0\n", "frame with a bad calibration"),
        ("calib", "P2: 0 0 600 0 0 0 170 0 0 0 1 0\n", "frame with a bad calibration"),
        ("calib", "P2: 700 0 600 0 0 nan 170 0 0 0 1 0\n", "frame with a bad calibration"),
        ("calib", None, "frame without a readable file in calib"),
        ("label_2", None, "frame without a readable file in label_2"),
    ],
)
def test_a_frame_that_cannot_be_used_is_named(folder, name, text, reason):
    path = folder / "training" / name / "000000.txt"
    path.unlink()
    if text is not None:
        path.write_text(text)
    frame, skipped = read(folder)
    assert frame is None
    assert skipped.counts == {reason: 1}
    assert "000000" in skipped.places[reason][0]


def test_the_size_of_the_image_counts(folder):
    images = folder / "training" / "image_2"
    images.mkdir()
    Image.new("RGB", (1224, 370)).save(images / "000000.png")
    Image.new("RGB", (640, 480)).save(images / "000001.png")
    (images / "000002.png").write_bytes(b"no image")
    assert read(folder)[0].image_size == (1224, 370)
    frame, skipped = read(folder, "000001")
    assert frame is None
    assert skipped.counts == {"frame with an image that is not its camera's": 1}
    frame, skipped = read(folder, "000002")
    assert frame.image is None
    assert skipped.counts == {"image that cannot be read": 1}


def test_a_split_chooses_frames(folder, tmp_path):
    split, skipped = tmp_path / "val.txt", Skips()
    split.write_bytes(b"000002\r\n000000\r\n\r\n000002\r\n../000001\r\n")
    assert KittiSet(folder).ids(split, skipped) == ["000002", "000000"]
    assert skipped.counts == {"duplicate id in the split": 1, "id that is no name": 1}
    split.write_text("\n")
    with pytest.raises(gp.InputError, match=r"val.txt: expected ids"):
        KittiSet(folder).ids(split)


def test_detections_are_read_beside_the_labels(folder, tmp_path):
    found = tmp_path / "found"
    found.mkdir()
    row = "Car -1 -1 -10 100 150 200 220 -1 -1 -1 -1000 -1000 -1000 -10 0.9\n"
    (found / "000000.txt").write_text(row + row[:30] + "\n")
    skipped = Skips()
    frame = KittiSet(folder, found).read("000000", skipped)
    assert [d.score for d in frame.detections] == [0.9]
    assert skipped.counts == {"cut-off line": 1}
    assert KittiSet(folder, found).read("000001", skipped) is None
    assert "frame without a readable file in found" in skipped.counts


def test_the_tracking_set_is_read_frame_by_frame(tmp_path):
    for name in ("label_02", "calib"):
        (tmp_path / "training" / name).mkdir(parents=True)
    make_folder(tmp_path / "other", 1)
    calib = (tmp_path / "other" / "training" / "calib" / "000000.txt").read_text()
    (tmp_path / "training" / "calib" / "0003.txt").write_text(calib)
    rows = [TrackedLabel(0, 1, LABEL), TrackedLabel(2, 1, LABEL), TrackedLabel(2, 1, LABEL)]
    (tmp_path / "training" / "label_02" / "0003.txt").write_text(format_tracking(rows))
    folder, skipped = KittiSet(tmp_path), Skips()
    assert folder.tracking
    frames = list(folder.frames(None, skipped))
    assert [frame.id for frame in frames] == ["0003/000000", "0003/000002"]
    assert [len(frame.labels) for frame in frames] == [1, 1]
    assert skipped.counts == {"duplicate track": 1}


def test_a_folder_that_is_no_kitti_is_refused(tmp_path):
    with pytest.raises(gp.InputError, match="label_2"):
        KittiSet(tmp_path)
    (tmp_path / "training" / "label_2").mkdir(parents=True)
    with pytest.raises(gp.InputError, match="a folder of detections"):
        KittiSet(tmp_path, tmp_path / "none")


def test_skips_count_all_and_keep_few_places():
    skipped, more = Skips(), Skips()
    for k in range(PLACES_KEPT + 5):
        skipped.add("bad", str(k))
    more.merge(skipped)
    more.add("other", "x")
    assert more.counts == {"bad": PLACES_KEPT + 5, "other": 1}
    assert len(more.places["bad"]) == PLACES_KEPT
    assert Skips.from_record(more.record()) == more
    assert more.lines()[0] == f"{PLACES_KEPT + 5} x bad: 0, ..."


@given(st.binary(max_size=200), st.sampled_from(["label_2", "calib", "image_2", "found"]))
@settings(max_examples=150, deadline=None)
def test_whatever_stands_in_a_file_is_read_or_counted(noise, name):
    with tempfile.TemporaryDirectory() as made:
        root = Path(made)
        make_folder(root, 1)
        for folder in ("image_2", "found"):
            (root / "training" / folder).mkdir()
        (root / "training" / "found" / "000000.txt").write_text(GOOD + " 0.5\n")
        path = root / "training" / name / ("000000.png" if name == "image_2" else "000000.txt")
        before = path.read_bytes() if path.exists() else b""
        path.write_bytes(before[: len(before) // 2] + noise + before[len(before) // 2 :])
        skipped = Skips()
        frame = KittiSet(root, root / "training" / "found").read("000000", skipped)
        assert frame is not None or skipped.total > 0
