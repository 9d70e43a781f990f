"""Poses in the terms of other libraries, boxes of other detectors, keypoints of COCO: there and back."""

import copy
import json
import types

import groundpose as gp
import numpy as np
import pytest
from conftest import MODEL, VIEW, make_batch
from groundpose.formats.boxes import Box, Boxes
from groundpose.formats.coco_keypoints import format_keypoints, read_keypoints
from groundpose.formats.conversions import (
    from_kitti,
    from_matrices,
    from_rvec_tvec,
    to_kitti,
    to_matrices,
    to_rvec_tvec,
)
from groundpose.formats.detections import bboxes_of, boxes_of
from groundpose.formats.frames import Frame, FrameObject
from groundpose.formats.kitti.labels import KittiLabel, format_labels
from groundpose.formats.skips import Skips

BATCH = make_batch(6, seed=4)


def random_rotations(n: int, seed: int = 0) -> np.ndarray:
    q = np.random.default_rng(seed).normal(size=(n, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]
    rows += [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]
    rows += [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def test_matrices_round_trip():
    R, t = random_rotations(20), np.random.default_rng(1).normal(size=(20, 3))
    matrices = to_matrices(R, t)
    point = np.array([1.0, 2.0, 3.0, 1.0])
    np.testing.assert_allclose((matrices @ point)[:, :3], R @ point[:3] + t)
    for given, back in zip((R, t), from_matrices(matrices), strict=True):
        np.testing.assert_array_equal(given, back)
    t[3] = np.nan
    assert np.isnan(to_matrices(R, t)[3]).all()
    with pytest.raises(gp.InputError, match="matrices"):
        from_matrices(np.zeros((2, 3, 4)))


def test_rotation_vectors_round_trip():
    R, t = random_rotations(200), np.random.default_rng(1).normal(size=(200, 3))
    rvec, tvec = to_rvec_tvec(R, t)
    assert np.linalg.norm(rvec, axis=1).max() <= np.pi
    for given, back in zip((R, t), from_rvec_tvec(rvec[..., None], tvec[..., None]), strict=True):
        np.testing.assert_allclose(given, back, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-5, 1.0, np.pi - 1e-3, np.pi - 1e-7, np.pi])
def test_rotation_vectors_at_the_ends(angle):
    axes = np.random.default_rng(2).normal(size=(50, 3))
    axes = np.concatenate([axes, np.eye(3), -np.eye(3)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    R, _ = from_rvec_tvec(angle * axes, np.zeros_like(axes))
    again, _ = from_rvec_tvec(to_rvec_tvec(R, np.zeros_like(axes))[0], np.zeros_like(axes))
    np.testing.assert_allclose(R, again, atol=1e-8)
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)


def test_rotation_vectors_are_those_of_opencv():
    cv2 = pytest.importorskip("cv2")
    R = random_rotations(30, 5)
    for mine, rotation in zip(to_rvec_tvec(R, np.zeros((30, 3)))[0], R, strict=True):
        np.testing.assert_allclose(mine, cv2.Rodrigues(rotation)[0].ravel(), atol=1e-9)
        np.testing.assert_allclose(from_rvec_tvec([mine], [[0, 0, 0]])[0][0], rotation, atol=1e-9)


def test_kittis_numbers_round_trip():
    batch = make_batch(8, seed=6, view=gp.View(VIEW.camera), noise=0.0, outliers=0.0)
    keypoints = batch.keypoints_2d.copy()
    keypoints[2] = np.nan
    poses = gp.estimate_poses(batch.view, keypoints, batch.bboxes, MODEL)
    offset = [0.06, 0.0, 0.003]
    rows = to_kitti(poses, offset)
    assert np.isnan(rows[2]).all()
    R, t = from_kitti(rows, offset)
    low, high = MODEL.bbox_3d
    bottom = [(low[0] + high[0]) / 2, high[1], (low[2] + high[2]) / 2]
    good = poses.ok
    np.testing.assert_allclose(R[good], poses.R[good], atol=0.02)
    np.testing.assert_allclose(t[good], (poses.R @ bottom + poses.t)[good], atol=1e-9)
    x, _, z, angle, alpha = rows[good][:, 3:].T
    np.testing.assert_allclose(np.cos(angle - alpha), np.cos(np.arctan2(x, z)), atol=1e-9)


# --- boxes of other detectors ------------------------------------------------------------------------------

CORNERS = np.array([[10.0, 20.0, 110.0, 90.0], [5.0, 6.0, 7.5, 9.0]])
SCORES = np.array([0.9, 0.25])


class Tensor:
    """A tensor on a graphics card: it must be detached and copied before numpy can see it."""

    def __init__(self, values, home=False):
        self.values, self.home = np.asarray(values), home

    def detach(self):
        return self

    def cpu(self):
        return Tensor(self.values, True)

    def numpy(self):
        assert self.home, "still on the card"
        return self.values

    def __array__(self, dtype=None, copy=None):
        raise TypeError("a tensor of a graphics card")


def supervision(names=("car", "truck")):
    data = {} if names is None else {"class_name": np.array(names)}
    return types.SimpleNamespace(xyxy=CORNERS, confidence=SCORES, class_id=np.array([2, 7]), data=data)


def ultralytics():
    boxes = types.SimpleNamespace(xyxy=Tensor(CORNERS), conf=Tensor(SCORES), cls=Tensor([2.0, 7.0]))
    return types.SimpleNamespace(boxes=boxes, names={2: "car", 7: "truck"})


KITTI = [
    KittiLabel(name, -1, -1, -10, tuple(box), -1, -1, -1, (-1000.0,) * 3, -10, score)
    for name, box, score in zip(("car", "truck"), CORNERS.tolist(), SCORES.tolist(), strict=True)
]
XYWH = [[10.0, 20.0, 100.0, 70.0], [5.0, 6.0, 2.5, 3.0]]
COCO = [
    {"image_id": 1, "bbox": box, "score": score, "category_name": name}
    for box, score, name in zip(XYWH, SCORES.tolist(), ("car", "truck"), strict=True)
]
NAMED = {
    "supervision": supervision(),
    "supervision without names": supervision(None),
    "torchvision": {"boxes": Tensor(CORNERS), "scores": Tensor(SCORES), "labels": Tensor([3, 8])},
    "classes in a sixth column": np.column_stack([CORNERS, SCORES, [2, 7]]).tolist(),
    "ultralytics": ultralytics(),
    "ultralytics, a list of one": [ultralytics()],
    "COCO": COCO,
    "KITTI": KITTI,
}
PLAIN = {
    "scores in a fifth column": np.column_stack([CORNERS, SCORES]),
    "a tensor": Tensor(np.column_stack([CORNERS, SCORES])),
}


@pytest.mark.parametrize("kind", [*NAMED, *PLAIN])
def test_boxes_are_taken_as_a_detector_gives_them(kind):
    found = boxes_of({**NAMED, **PLAIN}[kind]).boxes
    np.testing.assert_allclose([box.bbox for box in found], CORNERS)
    np.testing.assert_allclose([box.score for box in found], SCORES)
    assert [box.name for box in found] == (["car", "truck"] if kind in NAMED else ["", ""])
    np.testing.assert_array_equal(bboxes_of({**NAMED, **PLAIN}[kind]), CORNERS)


@pytest.mark.parametrize("kind", ["supervision", "ultralytics", "COCO"])
def test_tracks_are_the_ids(kind):
    given = {"supervision": supervision(), "ultralytics": ultralytics(), "COCO": copy.deepcopy(COCO)}[kind]
    if kind == "supervision":
        given.tracker_id = np.array([17, 18])
    elif kind == "ultralytics":
        given.boxes.id = Tensor([17.0, 18.0])
    else:
        given = [row | {"track_id": 17 + k} for k, row in enumerate(given)]
    assert [box.id for box in boxes_of(given).boxes] == [17, 18]


def test_boxes_without_scores_and_of_files(tmp_path):
    np.testing.assert_array_equal(bboxes_of(CORNERS), CORNERS)
    np.testing.assert_array_equal(bboxes_of(CORNERS.tolist()), CORNERS)
    given = Boxes((Box((1.0, 2.0, 3.0, 4.0), 0),))
    assert boxes_of(given) is given
    path = tmp_path / "000001.txt"
    path.write_text(
        format_labels(KittiLabel("Car", 0, 0, 0, tuple(b), 1, 1, 1, (0, 0, 9), 0) for b in CORNERS.tolist())
    )
    for name in (path, str(path)):
        np.testing.assert_allclose(bboxes_of(name), CORNERS)
    assert np.isnan(boxes_of(CORNERS).boxes[0].score)


@pytest.mark.parametrize("nothing", [[], (), np.empty((0, 4)), np.empty((0, 6)), Tensor(np.empty((0, 5)))])
def test_no_boxes_are_no_boxes(nothing):
    assert bboxes_of(nothing).shape == (0, 4)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        ("nowhere.json", OSError, "nowhere"),
        (7, TypeError, "detections: expected boxes"),
        (None, TypeError, "detections: expected boxes"),
        (np.zeros((2, 3)), gp.InputError, "shape"),
        (["a", "b"], TypeError, "detections"),
        ([{"bbox": [1, 2, 3]}], gp.InputError, r"detections\[0\]\['bbox'\]"),
        ([ultralytics(), ultralytics()], gp.InputError, "the result of one image"),
        (types.SimpleNamespace(xyxy=CORNERS, confidence=SCORES[:1], class_id=None), gp.InputError, "as many"),
    ],
)
def test_what_is_no_boxes_is_refused(value, error, text):
    with pytest.raises(error, match=text):
        boxes_of(value)


def test_real_supervision_and_ultralytics_if_they_are_here():
    sv = pytest.importorskip("supervision")
    given = sv.Detections(xyxy=CORNERS, confidence=SCORES, data={"class_name": np.array(["car", "truck"])})
    assert [box.name for box in boxes_of(given).boxes] == ["car", "truck"]


# --- COCO keypoints ----------------------------------------------------------------------------------------

NAMES = tuple(f"point {k}" for k in range(len(MODEL.keypoints_3d)))
NAMED_MODEL = gp.ShapeModel(MODEL.keypoints_3d, MODEL.bbox_3d, keypoint_names=NAMES, name="car")


def coco_frames(scores: bool) -> list[Frame]:
    rng = np.random.default_rng(3)
    frames = []
    for k in range(2):
        objects = []
        for i in range(3):
            points = BATCH.keypoints_2d[3 * k + i].copy()
            points[rng.random(len(points)) < 0.3] = np.nan
            seen = np.isfinite(points[:, 0])
            given = np.where(seen, rng.uniform(0.05, 0.95, len(points)), 0.0).tolist() if scores else None
            number = 3 * k + i + 1
            objects.append(FrameObject(number, "car", points, given, BATCH.bboxes[number - 1].tolist(), None))
        models = (NAMED_MODEL,) * 3
        frames.append(Frame(k + 10, "x", VIEW, None, tuple(objects), models))
    return frames


@pytest.mark.parametrize("scores", [False, True])
def test_coco_keypoints_round_trip(tmp_path, scores):
    frames = coco_frames(scores)
    path = tmp_path / "coco.json"
    path.write_text(format_keypoints(frames))
    again = list(read_keypoints(path, VIEW, {"car": NAMED_MODEL}))
    assert [frame.id for frame in again] == [10, 11]
    for a, b in zip(frames, again, strict=True):
        for mine, theirs in zip(a.objects, b.objects, strict=True):
            np.testing.assert_allclose(mine.keypoints_2d, theirs.keypoints_2d)
            np.testing.assert_allclose(mine.bbox, theirs.bbox)
            assert mine.id == theirs.id
            if scores:
                np.testing.assert_allclose(mine.keypoint_scores, theirs.keypoint_scores)
            else:
                assert theirs.keypoint_scores is None
        poses = gp.estimate_poses(**b.arguments)
        np.testing.assert_array_equal(poses.t, gp.estimate_poses(**a.arguments).t)
        assert poses.ok.all()


def test_coco_keypoints_are_put_in_the_models_order(tmp_path):
    content = json.loads(format_keypoints(coco_frames(False)))
    order = np.random.default_rng(0).permutation(len(NAMES))[:-4]  # four that the category does not have
    names = [NAMES[k] for k in order]
    turned = copy.deepcopy(content)
    turned["categories"][0]["keypoints"] = ["extra", *names]
    turned["categories"].append({"id": 9, "name": "person", "keypoints": ["nose"]})
    for row in turned["annotations"]:
        triples = np.array(row["keypoints"]).reshape(-1, 3)[order]
        row["keypoints"] = [1.0, 2.0, 2, *triples.ravel().tolist()]
    turned["annotations"] += [
        {"id": 99, "image_id": 10, "category_id": 9, "keypoints": [1, 2, 2]},
        {**turned["annotations"][0], "id": 98, "iscrowd": 1},
    ]
    path = tmp_path / "coco.json"
    path.write_text(json.dumps(turned))
    again = list(read_keypoints(path, VIEW, {"car": NAMED_MODEL}))
    missing = np.setdiff1d(np.arange(len(NAMES)), order)
    for a, b in zip(coco_frames(False), again, strict=True):
        assert len(b.objects) == 3
        for mine, theirs in zip(a.objects, b.objects, strict=True):
            np.testing.assert_allclose(theirs.keypoints_2d[order], mine.keypoints_2d[order])
            assert np.isnan(theirs.keypoints_2d[missing]).all()


@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (lambda c: c.pop("categories"), "categories: expected a value"),
        (lambda c: c["annotations"][1].update(image_id=77), r"annotations\[1\].image_id: expected the id"),
        (
            lambda c: c["annotations"][1].update(category_id=77),
            r"\[1\].category_id: expected the id",
        ),
        (
            lambda c: c["annotations"][0].update(keypoints=[1, 2]),
            r"\[0\].keypoints: expected three",
        ),
        (lambda c: c["categories"][0].update(keypoints=["nose"]), "names of the model, such as point 0"),
    ],
)
def test_bad_coco_files_are_refused_by_field(tmp_path, damage, text):
    content = json.loads(format_keypoints(coco_frames(False)))
    damage(content)
    path = tmp_path / "coco.json"
    path.write_text(json.dumps(content))
    with pytest.raises(gp.InputError, match=text):
        list(read_keypoints(path, VIEW, {"car": NAMED_MODEL}))


def test_one_bad_annotation_of_keypoints_costs_itself_alone(tmp_path):
    content = json.loads(format_keypoints(coco_frames(False)))
    whole = len(content["annotations"])
    content["annotations"][0]["keypoints"] = []  # a track without a shape here
    content["annotations"][1]["image_id"] = 77
    content["annotations"][2]["image_id"] = str(content["annotations"][2]["image_id"])
    path = tmp_path / "coco.json"
    path.write_text(json.dumps(content))
    skipped = Skips()
    frames = list(read_keypoints(path, VIEW, {"car": NAMED_MODEL}, skipped))
    assert sum(len(frame.objects) for frame in frames) == whole - 2
    assert "annotations[1].image_id: expected the id of an image, got 77" in skipped.lines()[0]


def test_a_model_without_names_is_refused(tmp_path):
    path = tmp_path / "coco.json"
    path.write_text(format_keypoints(coco_frames(False)))
    with pytest.raises(gp.InputError, match="keypoint_names"):
        list(read_keypoints(path, VIEW, {"car": MODEL}))
