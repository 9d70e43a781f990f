"""Recordings for the Rerun viewer: what is logged where, and that the viewer's own tools read it."""

import importlib.util
import subprocess
import sys
import types
from collections import defaultdict

import groundpose as gp
import numpy as np
import pytest
from conftest import make_batch
from groundpose.cli.main import app
from groundpose.formats.rerun_log import RerunLog
from groundpose.lab.evaluate.kitti.bench import make_folder
from groundpose.vehicles import shape_model
from typer.testing import CliRunner

BATCH = make_batch(5, seed=8, model=shape_model("car"))


class Stand:
    """Stands in for the package: keeps what is logged."""

    def __init__(self):
        self.logged, self.frame = defaultdict(list), None
        stream = types.SimpleNamespace(
            save=lambda path: None,
            log=self._log,
            set_time=self._set_time,
            flush=lambda: None,
            disconnect=lambda: self.logged["end"].append((None, None, {})),
        )
        self.RecordingStream = lambda name: stream
        self.ViewCoordinates = types.SimpleNamespace(RDF="RDF")
        self.Box2DFormat = types.SimpleNamespace(XYXY="XYXY")
        self.Image = lambda image: types.SimpleNamespace(compress=lambda jpeg_quality: image)
        self.Quaternion = lambda xyzw: xyzw

    def __getattr__(self, name):
        return lambda *args, **more: (name, args, more)

    def _log(self, path, value, static=False):
        self.logged[path].append((self.frame, value, static))

    def _set_time(self, name, sequence):
        self.frame = sequence


@pytest.fixture
def stand(monkeypatch) -> Stand:
    made = Stand()
    monkeypatch.setitem(sys.modules, "rerun", made)
    return made


def estimate(keypoints):
    return gp.estimate_poses(BATCH.view, keypoints, BATCH.bboxes, BATCH.models, threads=1)


def test_everything_is_logged_in_its_place(stand, tmp_path):
    keypoints = BATCH.keypoints_2d.copy()
    keypoints[1] = np.nan
    keypoints[2, :4] = np.nan
    poses = estimate(keypoints)
    image = np.zeros((720, 1280, 3), np.uint8)
    size = np.broadcast_to([1.5, 1.8, 4.4], (5, 3))
    with RerunLog(tmp_path / "a.rrd") as log:
        log.add(3, poses, image, [f"car {k}" for k in range(5)], (BATCH.R, BATCH.t, size))
        log.add(4, poses)
    at = "world/camera"
    assert [entry[0] for entry in stand.logged[f"{at}/image/boxes"]] == [3, 4]
    _, (_, _, boxes), _ = stand.logged[f"{at}/image/boxes"][0]
    np.testing.assert_array_equal(boxes["array"], BATCH.bboxes)
    assert boxes["labels"][1] == "car 1: too_few_keypoints"
    counts = {
        name: len(stand.logged[f"{at}/image/keypoints/{name}"][0][1][1][0])
        for name in ("inliers", "outliers", "not_seen")
    }
    assert counts == {
        "inliers": int(poses.inlier_mask.sum()),
        "outliers": int((np.isfinite(keypoints).all(axis=2) & ~poses.inlier_mask).sum()),
        "not_seen": 4,
    }
    _, (_, _, found), _ = stand.logged[f"{at}/objects/boxes"][0]
    assert found["labels"] == ["car 0", "car 2", "car 3", "car 4"]
    _, (_, _, truth), _ = stand.logged[f"{at}/objects/truth"][0]
    np.testing.assert_allclose(truth["half_sizes"], size[:, [1, 0, 2]] / 2)
    np.testing.assert_allclose(truth["centers"], BATCH.t - 0.75 * BATCH.R[:, :, 1])
    off = np.linalg.norm(truth["centers"][poses.ok] - found["centers"], axis=1)
    assert np.median(off) < 1.0
    _, (_, (strips,), _), _ = stand.logged[f"{at}/objects/shape_lines"][0]
    assert len(strips) > 4 * 20
    assert stand.logged[f"{at}/image/picture"][0][1] is image
    assert stand.logged[f"{at}/image/picture"][1][1][0] == "Clear"
    np.testing.assert_allclose(stand.logged[at][0][1][2]["mat3x3"], BATCH.view.R_camera_from_ground.T)
    assert len(stand.logged["end"]) == 1


def test_a_frame_without_objects_clears_the_one_before(stand, tmp_path):
    none = gp.estimate_poses(BATCH.view, np.empty((0, 28, 2)), np.empty((0, 4)), BATCH.models)
    with RerunLog(tmp_path / "a.rrd") as log:
        log.add(0, none)
    assert stand.logged["world/camera/objects/boxes"][0][1][2]["labels"] == []
    assert len(stand.logged["world/camera/image/keypoints/inliers"][0][1][1][0]) == 0


def test_without_the_package_it_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(gp.InputError, match=r"pip install 'groundpose\[rerun\]'"):
        RerunLog(tmp_path / "a.rrd")


def test_the_command_says_so_before_it_works(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun", None)
    make_folder(tmp_path / "k", 1)
    arguments = ["--root", tmp_path / "k", "--keypoints", "simulated", "-o", tmp_path / "a.json"]
    result = CliRunner().invoke(app, ["evaluate", "kitti", *map(str, arguments), "--rerun", "a.rrd"])
    assert result.exit_code == 2
    assert "pip install" in result.output
    assert not (tmp_path / "a.json").exists()


def test_a_path_that_cannot_be_is_an_oserror(stand, tmp_path):
    with pytest.raises(FileNotFoundError):
        RerunLog(tmp_path / "none" / "a.rrd")


def test_the_command_records_frames(stand, tmp_path):
    make_folder(tmp_path / "k", 4)
    arguments = ["--root", tmp_path / "k", "--keypoints", "simulated", "--jobs", 1]
    arguments += ["-o", tmp_path / "a.json", "--rerun", tmp_path / "a.rrd"]
    result = CliRunner().invoke(app, ["evaluate", "kitti", *map(str, arguments)])
    assert result.exit_code == 0, result.output
    assert "a.rrd, 4 frames" in "".join(result.output.splitlines())
    assert [entry[0] for entry in stand.logged["world/camera/objects/truth"]] == [0, 1, 2, 3]


def test_the_viewers_own_tools_read_it(tmp_path):
    if importlib.util.find_spec("rerun") is None:
        pytest.skip("rerun-sdk is not installed (extra rerun)")
    path = tmp_path / "a.rrd"
    with RerunLog(path) as log:
        for number in range(3):
            log.add(number, estimate(BATCH.keypoints_2d), np.zeros((720, 1280, 3), np.uint8))
    command = [sys.executable, "-m", "rerun", "rrd"]
    done = subprocess.run([*command, "verify", path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    stats = subprocess.run([*command, "stats", path], capture_output=True, text=True, check=True).stdout
    for entity in ("image/boxes", "image/keypoints/inliers", "objects/boxes", "objects/shape_lines"):
        assert f"/world/camera/{entity}:" in stats


def test_figure_6_is_drawn(tmp_path):
    make_folder(tmp_path / "k", 2)
    given = ["--root", tmp_path / "k", "--keypoints", "simulated", "-o", tmp_path / "f.png"]
    result = CliRunner().invoke(app, ["evaluate", "figure6", *map(str, given), "--frame", "000001"])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "f.png").stat().st_size > 20_000
    refused = CliRunner().invoke(app, ["evaluate", "figure6", *map(str, given), "--frame", "000009"])
    assert refused.exit_code == 2
    assert "frame: expected a frame with vehicles" in refused.output
