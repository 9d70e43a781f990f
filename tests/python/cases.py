"""How every collected input of users ends: right, refused with a line that names the file, or with a remark.

`python tests/python/cases.py` writes results/cases.json; `test_cases.py` asks the same. The inputs are not
part of the repository: they are looked for in `cases` beside the folder that GROUNDPOSE_DATA names.
"""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import pickle
import tempfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import groundpose as gp
import numpy as np
import pytest
from conftest import make_batch
from groundpose.cli.box_choice import BoxChoice
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.images import ImageWork
from groundpose.cli.run import Mounting
from groundpose.demo import example
from groundpose.formats.calibrations import read_calibration
from groundpose.formats.coco_keypoints import read_keypoints
from groundpose.vehicles import shape_model
from PIL import Image
from test_cli import run

CASES = Path(os.environ["GROUNDPOSE_DATA"]).parent / "cases"
OUT = Path("results/cases.json")
RIGHT, REFUSED, REMARKED = "right", "refused in a line that names the file", "with a remark"
Ending = tuple[str, str]
"""How it ended, and what was said."""

F, C = 2015.437, (956.5, 539.5)


def _lens(*distortion: float, lens: str = "brown_conrady", **more: Any) -> dict[str, Any]:
    return {"distortion": distortion, "lens": lens, **more}


_TOOLS_LENS = _lens(0.01, -0.02, 0.001, 0.0005, 0.0)
CAMERAS: dict[str, dict[str, Any] | None] = {
    **dict.fromkeys(("ci_uncalibrated.yaml", "normalised.json", "kitti_skew.txt")),
    "colmap_cameras.txt": {"c": (956.0, 539.0)},  # pixel centres at halves
    "matlab.json": {"c": (955.5, 538.5)},  # pixels from 1
    "carla.json": {"f": 0.5 * 1914 / math.tan(math.radians(25.4))},
    "ci_binned_roi.yaml": {"f": 0.5 * F, "c": (478.0, 269.5), "image_size": (957, 540)},
    "cam_fisheye.yaml": _lens(-0.02, 0.01, -0.008, 0.002, lens="equidistant", f=600.0, c=(640.0, 360.0)),
    "ros_equidistant.yaml": _lens(0.01, -0.02, 0.001, 0.0005, lens="equidistant"),
    "ros_rational8.yaml": _lens(0.01, -0.02, 0.001, 0.0005, 0.01, 0.1, 0.02, 0.003, lens="rational"),
    "ci_ros2_rational.yaml": _lens(
        *(-0.0306, 0.0352, -0.00014, -0.00015, -0.012, 0.1, 0.02, 0.003), lens="rational"
    ),
    "ci_ros2_plumb8.yaml": _lens(-0.0306, 0.0352, -0.00014, -0.00015, -0.012),
    "D_dist_coeffs.yaml": _lens(-0.3, 0.08, 0.0, 0.0, 0.0),
    **dict.fromkeys(
        ("ros_radtan.yaml", "ros_rational5.yaml", "nested_K.yaml", "ros_blocklist.yaml"), _TOOLS_LENS
    ),
    **{
        f"inline_D_{name}.yaml": _lens(-0.17, 0.10, 0.005, -0.0003, 0.0)
        for name in ("after_K", "after_K_then_T", "before_K")
    },
}
"""What is not that of the others, by the file's name; None: it must be refused."""


def camera(path: Path) -> Ending:
    """A calibration has the numbers that stand in it, or is refused."""
    expected = CAMERAS.get(path.name, {})
    if path.name == "nuscenes_all.json":  # of several cameras one is named
        assert "one of a, e" in refused(lambda: read_calibration(path), path)[1]
    if expected is None:
        return refused(lambda: read_calibration(path), path)
    found = read_calibration(path, "a" if path.name == "nuscenes_all.json" else None).camera
    f = expected.get("f", F)
    np.testing.assert_allclose((found.fx, found.fy, found.cx, found.cy), (f, f, *expected.get("c", C)))
    given = np.zeros(len(found.distortion or ()))
    given[: len(expected.get("distortion", ()))] = expected.get("distortion", ())
    np.testing.assert_allclose(found.distortion or (), given)
    assert found.lens == expected.get("lens", "brown_conrady")
    assert found.image_size in (None, expected.get("image_size", found.image_size))
    return RIGHT, f"f {found.fx:g}, c {found.cx:g} {found.cy:g}, {found.lens} {found.distortion}"


def refused(read: Callable[[], object], path: Path) -> Ending:
    """What the error says; it must name the file."""
    with pytest.raises(gp.InputError) as caught:
        read()
    said = str(caught.value)
    assert said.startswith(str(path)), said
    return REFUSED, said.replace(str(path.parent), ".")


@cache
def pipeline() -> gp.Pipeline:
    """The smaller network is enough to see what boxes are made of."""
    return gp.Pipeline("int8", threads=1)


@cache
def depths() -> np.ndarray:
    """Of the vehicles in the boxes as they are meant."""
    street = example()
    return pipeline()(street.image, street.bboxes, street.view).t[:, 2]


def work(boxes: Path, calibration: Path | None = None) -> ImageWork:
    """The command `estimate` of the street with these boxes."""
    street = Path(example().path)
    seen = CameraChoice(calibration or CASES / "coco_paths" / "camera.json")
    return ImageWork(street, BoxChoice(boxes, None, None), seen, Mounting(), -math.inf, pipeline())


def boxes(path: Path) -> Ending:
    """The vehicles of the street where they are, without one where one entry of the file is bad."""
    done = work(path)
    (result,) = done
    assert not isinstance(result, gp.InputError), result
    assert result is not None
    bad = done.boxes.skipped.total
    assert len(result.poses) + bad == len(depths())
    np.testing.assert_allclose(result.poses.t[:, 2], depths()[bad:], rtol=0.05)
    said = "; ".join([*done.remarks(), *result.poses.remarks]).replace(str(path.parent), ".")
    if path.parent.name in ("coco_one_bad_annotation", "coco_other_image_size"):
        assert path.name in said or bad == 0
    return (REMARKED if said else RIGHT), said


def other_convention(path: Path) -> Ending:
    """Boxes that mean something else."""
    (result,) = work(path)
    assert isinstance(result, gp.InputError)
    return refused(partial(_raise, result), path)


def _raise(error: Exception) -> None:
    raise error


# What is no file.


def blank() -> Ending:
    """No vehicle in a picture without any."""
    random = np.random.default_rng(0)
    at = np.arange(10.0)
    found = np.stack([200 + 90 * at, 200 + 7 * at, 260 + 98 * at, 250 + 12 * at], axis=1)
    view = gp.View(gp.Camera(1000, 1000, 640, 360))
    shape = (720, 1280, 3)
    pictures = [np.full(shape, level, np.uint8) for level in (0, 128, 255)]
    for image in (*pictures, random.integers(0, 256, shape, dtype=np.uint8)):
        assert not pipeline()(image, found, view).ok.any()
    return RIGHT, "no pose in 40 boxes of plain and noisy pictures"


class _Detections:
    """As supervision has them."""

    xyxy = np.array([[885.9, 497.7, 1115.4, 734.0], [200.0, 500.0, 260.0, 640.0]])
    confidence = np.array([0.9, 0.8])
    class_id = np.array([5, 0])
    data = {"class_name": np.array(["bus", "person"])}  # noqa: RUF012 - as theirs
    tracker_id = np.array([17, 18])


def person() -> Ending:
    """A person is no vehicle, tracks are kept, an array with classes is taken."""
    street, given = example(), _Detections()
    table = np.c_[given.xyxy, given.confidence, given.class_id]
    for detections in (given, table):
        poses = pipeline()(street.image, detections, street.view)
        assert poses.status.tolist() == ["ok", "not_a_vehicle"]
    assert pipeline()(street.image, given, street.view).ids.tolist() == [17, 18]
    return RIGHT, "the person is not_a_vehicle, tracks 17 and 18"


def height() -> Ending:
    """A wrong height is said where all vehicles stand on one road, an absurd one refused."""
    street, frame = example(), gp.FramePriors()

    def at(metres: float) -> gp.PoseBatch:
        view = gp.View(street.view.camera, height=metres)
        return pipeline()(street.image, street.bboxes, view, frame=frame)

    (remark,) = (said for said in at(0.5).remarks if said.startswith("height"))
    assert "the camera is higher" in remark
    with pytest.raises(gp.InputError, match=r"height: expected 0\.1 to 300 metres"):
        at(1500.0)
    return REMARKED, remark


def exif() -> Ending:
    """A picture that is stored turned has the poses of the upright one."""
    street, ways = example(), Image.Transpose
    view = gp.View(street.view.camera)
    for turn, orientation in ((ways.ROTATE_180, 3), (ways.ROTATE_90, 6)):
        said, file = Image.Exif(), io.BytesIO()
        said[0x0112] = orientation
        turned = Image.fromarray(np.asarray(street.image)).transpose(turn)
        turned.save(file, "JPEG", quality=92, exif=said.tobytes())
        poses = pipeline()(file.getvalue(), street.bboxes, view)
        np.testing.assert_allclose(poses.t[:, 2], depths(), rtol=0.05)
    return RIGHT, "orientations 3 and 6"


def fisheye() -> Ending:
    """The car of the case, 40 degrees off the axis: 11.5 m and not 17.4 m."""
    view = read_calibration(CASES / "opencv_fisheye_flag" / "cam_fisheye.yaml")
    car, angle = shape_model("car"), math.radians(40.0)
    t = np.array([15.0 * math.sin(angle), 1.5, 15.0 * math.cos(angle)])
    x, y, z = (car.keypoints_3d + t).T
    r = np.hypot(x, y)
    theta = np.arctan2(r, z)
    k = (-0.02, 0.01, -0.008, 0.002)  # the equidistant model, written out
    bent = theta * (1.0 + sum(k[i] * theta ** (2 * i + 2) for i in range(4)))
    pixels = 600.0 * (bent / r)[:, None] * np.stack([x, y], axis=1) + (640.0, 360.0)
    box = [*pixels.min(axis=0), *pixels.max(axis=0)]
    pose = gp.estimate_poses(view, pixels[None], [box], car)[0]
    np.testing.assert_allclose(pose.t, t, atol=0.15)
    return RIGHT, f"{pose.t[2]:.2f} m of {t[2]:.2f} m"


def tilt() -> Ending:
    """A sign of the other convention is said, with and without an estimated tilt."""
    camera = gp.Camera(1000.0, 1000.0, 960.0, 540.0, image_size=(1920, 1080))
    batch = make_batch(12, seed=2, outliers=0.1, view=gp.View(camera, pitch=math.radians(-12.0)))
    wrong, given = gp.View(camera, pitch=math.radians(12.0)), (batch.keypoints_2d, batch.bboxes, batch.models)
    said = [gp.estimate_poses(wrong, *given, frame_tilt_sigma=s).remarks for s in (None, math.radians(5.0))]
    assert all(any("pitch" in remark for remark in remarks) for remarks in said), said
    return REMARKED, said[0][0]


def other_size() -> Ending:
    """Intrinsics of an image twice as large."""
    street = example()
    c = street.view.camera
    large = gp.Camera(2 * c.fx, 2 * c.fy, 2 * c.cx, 2 * c.cy)
    remarks = pipeline()(street.image, street.bboxes, gp.View(large)).remarks
    (said,) = (remark for remark in remarks if remark.startswith("principal point"))
    return REMARKED, said


def cluster() -> Ending:
    """A pipeline is sent to other processes; a picture may be bytes or a file object."""
    street, file = example(), io.BytesIO()
    Image.fromarray(np.asarray(street.image)).save(file, "PNG")
    sent: gp.Pipeline = pickle.loads(pickle.dumps(pipeline()))
    for picture in (file.getvalue(), file, Image.open(io.BytesIO(file.getvalue()))):
        file.seek(0)
        np.testing.assert_array_equal(sent(picture, street.bboxes, street.view).t[:, 2], depths())
    poses = sent(street.image, street.bboxes, street.view)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(poses)).t, poses.t)
    return RIGHT, "Pipeline and poses pickled; bytes, a file object and a Pillow image"


def keypoint_sets() -> Ending:
    """The data sets of the script: read, or refused by file and field."""
    batch = make_batch(1, seed=1)
    (model,) = {batch.models} if isinstance(batch.models, gp.ShapeModel) else set(batch.models)
    names = [f"c{k}" for k in range(len(model.keypoints_3d))]
    named = gp.ShapeModel(model.keypoints_3d, model.bbox_3d, keypoint_names=names)
    xyv = [float(v) for point in batch.keypoints_2d[0] for v in (*point, 2)]

    def data(rows: list[Any], **category: Any) -> dict[str, Any]:
        kind = {"id": 1, "name": "car", "keypoints": names} | category
        one = {"id": 1, "image_id": 1, "category_id": 1, "bbox": [1, 2, 30, 40], "keypoints": rows}
        empty = one | {"id": 2, "keypoints": [], "bbox": [0, 0, 0, 0]}
        return {
            "images": [{"id": 1, "file_name": "a.png"}],
            "categories": [kind],
            "annotations": [one, empty],
        }

    read = {"plain, and a track without a shape": data(xyv), "one name differs": data(xyv)}
    read["one name differs"]["categories"][0]["keypoints"] = [*names[:-1], "other"]
    bad = {
        "17 numbers": data(xyv[:17]),
        "text": data([str(v) for v in xyv]),
        "nested": data([xyv[:3]]),
        "names in capitals": data(xyv, keypoints=[name.upper() for name in names]),
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "keypoints.json"
        for content in read.values():
            path.write_text(json.dumps(content))
            (frame,) = read_keypoints(path, batch.view, {"car": named})
            assert len(frame.objects) == 1
        for content in bad.values():
            path.write_text(json.dumps(content))
            refused(lambda: list(read_keypoints(path, batch.view, {"car": named})), path)
    return RIGHT, f"{len(read)} read, {len(bad)} refused by file and field"


MESSAGES = {
    "--pitch-deg 95": ("--pitch-deg: expected degrees between -90 and 90, got 95", 2),
    "--network int-8": ("did you mean int8?", 2),
    "-o out.csw": ("expected a file that ends in .jsonl", 2),
    "-o out.csv --network int8 --no-pictures": ("1 image, 8 vehicles, 8 poses, out.csv", 0),
    "-o out --network int8 --no-pictures": ("1 image, 8 vehicles, 8 poses, out/poses.jsonl", 0),
}


def messages() -> Ending:
    """What the command line says."""
    here = Path.cwd()
    files = (CASES / "coco_paths" / "coco_backslash.json", CASES / "coco_paths" / "camera.json")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for options, (text, status) in MESSAGES.items():
                given = ("--boxes", files[0], "--calib", files[1], *options.split())
                result = run("estimate", example().path, *given)
                assert (result.exit_code, text in result.stderr) == (status, True), result.stderr
            assert Path("out.csv").read_text().startswith("frame,image,object,class,status")
        finally:
            os.chdir(here)
    return RIGHT, "; ".join(MESSAGES)


BOXES = (
    *("boxes_not_read", "class_names", "coco_one_bad_annotation", "coco_other_image_size", "coco_paths"),
    "kitti_text",
)
CALIBRATIONS = (
    *("calibrations_not_read", "camera_info_roi_binning", "errors_without_file_name", "wrong_matrix_taken"),
    *("implausible_intrinsics", "inline_distortion_dropped", "opencv_fisheye_flag", "ros_distortion_names"),
)
PROGRAMS: dict[str, Callable[[], Ending]] = {
    "blank_image_ok/run.py": blank,
    "person_becomes_car/run.py": person,
    "camera_height_ignored/run.py": height,
    "exif_rotation/run.py": exif,
    "opencv_fisheye_flag/run.py": fisheye,
    "frame_tilt_away/run.py": tilt,
    "implausible_intrinsics, full-size K": other_size,
    "cluster/glue.py": cluster,
    "coco_one_bad_annotation/coco.py": keypoint_sets,
    "messages": messages,
}


def _files(folder: str) -> list[Path]:
    ends = (".yaml", ".json", ".xml", ".txt", ".csv")
    found = sorted(path for path in (CASES / folder).glob("*") if path.suffix in ends)
    return [path for path in found if path.name not in ("camera.json", "boxes.json")]


def inputs() -> Iterator[tuple[str, Callable[[], Ending]]]:
    """Every input with what it must come to."""
    for folders, judge in (
        (CALIBRATIONS, camera),
        (BOXES, boxes),
        (("boxes_wrong_convention",), other_convention),
    ):
        for folder in folders:
            for path in _files(folder):
                yield f"{folder}/{path.name}", partial(judge, path)
    if CASES.is_dir():
        yield from PROGRAMS.items()


def main() -> None:
    """Judge all of them and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    table = {}
    for name, judge in inputs():
        try:
            ending, said = judge()
        except Exception as error:
            ending, said = "wrong", f"{type(error).__name__}: {error}"[:500]
        table[name] = {"ending": ending, "said": said}
        print(f"{ending:40s} {name}  {said[:100]}")
    endings = [row["ending"] for row in table.values()]
    total = {ending: endings.count(ending) for ending in (RIGHT, REMARKED, REFUSED, "wrong")}
    content = {
        "command": "python tests/python/cases.py",
        "inputs": len(table),
        "total": total,
        "table": table,
    }
    given.out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(total)


if __name__ == "__main__":
    main()
