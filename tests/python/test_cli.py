"""The command line: what a user types, sees and gets, and what a mistake looks like."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from conftest import CAMERA, as_json, frame_of, make_batch
from groundpose.cli.main import app
from PIL import Image
from typer.testing import CliRunner

BATCH = make_batch(3, seed=41)
FRAME = frame_of(BATCH, "first")


def run(*arguments: object, stdin: str | None = None):
    return CliRunner().invoke(app, [str(a) for a in arguments], input=stdin)


def one_line(result) -> str:
    """The single line of a user's mistake."""
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    return lines[0]


def width_of(path: Path) -> int:
    with Image.open(path) as image:
        return image.width


@pytest.fixture
def frame(tmp_path) -> Path:
    path = tmp_path / "frame.json"
    path.write_text(json.dumps(FRAME, indent=1))
    return path


@pytest.fixture
def frames(tmp_path) -> Path:
    """Five lines, the third and the fourth bad."""
    path = tmp_path / "frames.jsonl"
    later = {k: v for k, v in FRAME.items() if k not in ("models", "id")}
    bad = {**later, "pitch_deg": "level"}
    path.write_text(
        "".join(line + "\n" for line in [*map(json.dumps, (FRAME, later, bad)), "{]", json.dumps(later)])
    )
    return path


def test_json_lines_are_the_poses_of_the_api(frame):
    result = run("estimate", frame)
    assert result.exit_code == 0
    assert result.stderr == ""
    record = json.loads(result.stdout)
    expected = gp.estimate_poses(BATCH.view, BATCH.keypoints_2d, BATCH.bboxes, BATCH.models)
    assert record["id"] == "first"
    for written, pose in zip(record["objects"], expected, strict=True):
        np.testing.assert_allclose(written["t"], pose.t, rtol=1e-9)
        assert written["status"] == pose.status


def test_bad_lines_do_not_stop_the_rest(frames, tmp_path):
    out = tmp_path / "poses.jsonl"
    result = run("estimate", frames, "-o", out)
    assert result.exit_code == 1
    assert [json.loads(line)["id"] for line in out.read_text().splitlines()] == ["first", 1, 4]
    errors = result.stderr.splitlines()
    assert errors[0].endswith(f'{frames}:3: pitch_deg: expected a finite number, got "level"')
    assert f"{frames}:4: expected JSON" in errors[1]
    assert "2 of 5 frames left out" in errors[2]


def test_table_shows_poses_and_errors(frame):
    result = run("estimate", frame, "--format", "table")
    assert result.exit_code == 0
    assert "Frame first" in result.stdout
    assert result.stdout.count(" ok ") == 3
    assert "error" in result.stdout


def test_kitti_goes_to_a_file_or_a_folder(frame, frames, tmp_path):
    result = run("estimate", frame, "--format", "kitti")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == ["car"] * 3
    folder = tmp_path / "results"
    assert run("estimate", frames, "--format", "kitti", "-o", folder).exit_code == 1
    assert sorted(p.name for p in folder.iterdir()) == ["000001.txt", "000004.txt", "first.txt"]
    assert (folder / "first.txt").read_text() == result.stdout
    refused = run("estimate", frames, "--format", "kitti")
    assert refused.exit_code == 2
    assert "give a folder, -o FOLDER" in one_line(refused)


def test_draw_writes_pictures(frame, frames, tmp_path):
    Image.fromarray(np.full((720, 1280, 3), 100, dtype=np.uint8)).save(tmp_path / "photo.png")
    frame.write_text(json.dumps(FRAME | {"image": "photo.png"}))
    out = tmp_path / "poses.png"
    assert run("estimate", frame, "--draw", out).exit_code == 0
    assert width_of(out) > 1000
    assert "{id} in the name" in one_line(run("estimate", frames, "--draw", out))
    assert run("estimate", frames, "--draw", tmp_path / "f_{id}.png", "-o", tmp_path / "o").exit_code == 1
    assert {p.name for p in tmp_path.glob("f_*.png")} == {"f_first.png", "f_000001.png", "f_000004.png"}
    frame.write_text(json.dumps(FRAME | {"image": "absent.png"}))
    missing = run("estimate", frame, "--draw", out, "-o", tmp_path / "o")
    assert missing.exit_code == 2
    assert "absent.png: No such file" in one_line(missing)
    frame.write_text(json.dumps(FRAME | {"image": "frame.json"}))
    assert "expected a picture" in one_line(run("estimate", frame, "--draw", out, "-o", tmp_path / "o"))
    frame.write_text(json.dumps(FRAME))
    assert "--draw" in one_line(run("estimate", frame, "--draw", tmp_path / "x.xyz", "-o", tmp_path / "o"))


def test_a_picture_beside_its_frame_is_drawn_again(frame, tmp_path):
    for _ in range(2):
        assert run("estimate", frame, "--draw", tmp_path / "poses.png").exit_code == 0


@pytest.mark.parametrize("piped", [False, True])
def test_no_picture_that_another_frame_names_is_drawn_over(piped, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "photos").mkdir()
    for name in ("a", "b"):
        Image.fromarray(np.full((720, 1280, 3), 100, dtype=np.uint8)).save(tmp_path / f"photos/{name}.png")
    before = [path.read_bytes() for path in sorted(tmp_path.glob("photos/*"))]
    lines = [FRAME | {"id": "b", "image": "photos/a.png"}, FRAME | {"id": "a", "image": "photos/b.png"}]
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (tmp_path / "frames.jsonl").write_text(text)
    source = "-" if piped else "frames.jsonl"
    found = run("estimate", source, "--draw", "photos/{id}.png", "-o", "o.jsonl", stdin=text)
    assert found.exit_code != 0
    assert "give another folder" in found.stderr
    assert [path.read_bytes() for path in sorted(tmp_path.glob("photos/*"))] == before


# option: what is typed and what Options then holds
TYPED = {
    "inlier_threshold": ("--inlier-threshold 2.5", 2.5),
    "relative_threshold": ("--relative-threshold 0.05", 0.05),
    "confidence": ("--confidence 0.9", 0.9),
    "solver": ("--solver p3p", "p3p"),
    "cases": ("--cases paper", "paper"),
    "scoring": ("--scoring inliers", "inliers"),
    "refinement": ("--refinement hre", "hre"),
    "hre_thresholds": ("--hre-thresholds 1 2 4", (1.0, 2.0, 4.0)),
    "tilt_sigma": ("--tilt-sigma-deg 3", np.radians(3.0)),
    "shape_prior": ("--no-shape-prior", False),
    "bbox_sigma": ("--bbox-sigma 2", 2.0),
    "covariance": ("--no-covariance", False),
    "max_iterations": ("--max-iterations 55", 55),
    "min_keypoints": ("--min-keypoints 6", 6),
    "max_log10_nfa": ("--max-log10-nfa -3", -3.0),
    "keypoint_error_factor": ("--keypoint-error-factor 15", 15.0),
    "keypoint_error_dof": ("--keypoint-error-dof 6", 6.0),
    "keypoint_error_shift": ("--keypoint-error-shift 0.01", 0.01),
    "keypoint_error_turn": ("--keypoint-error-turn-deg 1", np.radians(1.0)),
    "ambiguity_coefficients": ("--ambiguity-coefficients -0.6 0.9", (-0.6, 0.9)),
    "probability_coefficients": (
        "--probability-coefficients 1 0.5 -0.3 -1 0 0.4 -0.2",
        (1.0, 0.5, -0.3, -1.0, 0.0, 0.4, -0.2),
    ),
    "min_probability": ("--min-probability 0.3", 0.3),
    "score_weights": ("--no-score-weights", False),
    "seed": ("--seed 9", 9),
}


@pytest.mark.parametrize("option", [f.name for f in dataclasses.fields(gp.Options) if f.init])
def test_every_option_of_the_library_is_one_of_the_command(option, frame, monkeypatch):
    """What is typed arrives in `Options`, alone; the rest are defaults."""
    seen = []
    spy = lambda **a: (seen.append((a["options"], a["threads"])), gp.estimate_poses(**a))[1]  # noqa: E731
    monkeypatch.setattr("groundpose.cli.frames.estimate_poses", spy)
    typed, value = TYPED[option]
    assert run("estimate", frame, *typed.split(), "--threads", 2).exit_code == 0
    assert seen == [(gp.Options(**{option: value}), 2)]
    # in 80 columns the longest names are cut
    wide = CliRunner().invoke(app, ["estimate", "--help"], env={"COLUMNS": "100"})
    assert f"--{option.replace('_', '-')}" in wide.stdout


def test_tilt_can_be_given_by_hand(frame, monkeypatch):
    views = []
    spy = lambda **a: (views.append(a["view"]), gp.estimate_poses(**a))[1]  # noqa: E731
    monkeypatch.setattr("groundpose.cli.frames.estimate_poses", spy)
    assert run("estimate", frame, "--pitch-deg", "-3").exit_code == 0
    assert run("estimate", frame, "--roll-deg", "2").exit_code == 0
    assert [v.pitch for v in views] == [pytest.approx(np.radians(-3)), pytest.approx(BATCH.view.pitch)]
    assert [v.roll for v in views] == [pytest.approx(BATCH.view.roll), pytest.approx(np.radians(2))]


def test_the_tilt_of_the_frame_is_estimated_and_said(frame):
    """Told a tilt that is 3 degrees off, it finds the one that the objects agree on."""
    wrong = np.degrees(BATCH.view.pitch) + 3.0
    arguments = ("estimate", frame, "--pitch-deg", wrong, "--frame-tilt-sigma-deg", 5)
    found = json.loads(run(*arguments).stdout)
    assert found["pitch_deg"] == pytest.approx(np.degrees(BATCH.view.pitch), abs=0.5)
    assert found["roll_deg"] == pytest.approx(np.degrees(BATCH.view.roll), abs=0.5)
    refused = run("estimate", frame, "--frame-tilt-sigma-deg", 0)
    assert "frame_tilt_sigma: expected a positive number" in one_line(refused)


def test_a_height_or_a_region_puts_the_vehicles_on_one_road(frame):
    alone = json.loads(run("estimate", frame).stdout)
    assert not {"camera_height", "pitch_sigma_deg"} & alone.keys()
    assert "size" not in alone["objects"][0]
    for arguments in (("--height", 1.5), ("--region", "europe"), ("--height", 1.5, "--region", "japan")):
        found = json.loads(run("estimate", frame, *arguments).stdout)
        assert found["camera_height"] == pytest.approx(1.5, rel=0.1)
        assert found["camera_height_sigma"] > 0.0
        assert found["pitch_deg"] == pytest.approx(np.degrees(BATCH.view.pitch), abs=1.0)
        assert isinstance(found["remarks"], list)
        for item in found["objects"]:
            if item["status"] == "ok":
                assert item["position"][1] == pytest.approx(1.5, abs=0.3)
                assert all(
                    0.0 < sigma < size for sigma, size in zip(item["size_sigma"], item["size"], strict=True)
                )
    assert "region: expected one of world" in one_line(run("estimate", frame, "--region", "moon"))
    assert "height: expected" in one_line(run("estimate", frame, "--height", -1))


def test_a_camera_is_learned_from_run_to_run(frame, tmp_path):
    path = tmp_path / "camera.json"
    arguments = ("estimate", frame, "--height", 1.5, "--learn-camera", path)
    first = run(*arguments)
    assert first.exit_code == 0
    assert "CameraState" in first.stderr
    state = gp.CameraState.load(path)
    assert state.height == pytest.approx(1.5, rel=0.05)
    assert state.class_scales
    assert run(*arguments).exit_code == 0
    name = next(iter(state.class_scales))
    assert gp.CameraState.load(path).class_scales[name][1] < state.class_scales[name][1]
    other = run("estimate", frame, "--height", 2.5, "--learn-camera", path)
    assert other.exit_code == 2
    assert "view: expected pitch, roll and height of the camera's state" in other.stderr


def test_former_spellings_of_options_still_work(frame):
    refused = run("estimate", frame, "--model", "mine.onnx")
    assert "--network: is for images" in one_line(refused)
    assert "--model" not in run("estimate", "--help").stdout
    for old, new in (("--least-score", "--min-score"), ("--frame-tilt-deg", "--frame-tilt-sigma-deg")):
        refused = run("evaluate", "kitti", "--root", "KITTI", "-o", "out.json", old, "x")
        assert f"'{new}'" in refused.stderr
        assert old not in run("evaluate", "kitti", "--help").stdout.split()


MISTAKES = {
    "no such file": (["nothing.json"], "nothing.json: No such file"),
    "a folder": (["."], ".: is an image or a folder; give the 2D boxes too, --boxes FILE"),
    "a picture": (["a.png"], "a.png: is an image or a folder; give the 2D boxes too"),
    "an option for images": (["frame.json", "--calib", "c.txt"], "--calib: is for images, which are given"),
    "another one": (["frame.json", "--min-score", "0.5"], "--min-score: is for images"),
    "a flag": (["frame.json", "--no-pictures"], "--no-pictures: is for images"),
    "unknown format": (
        ["frame.json", "--format", "xml"],
        "--format: expected jsonl, kitti, table, csv, parquet, got 'xml'",
    ),
    "bad option value": (["frame.json", "--confidence", "2"], "confidence: expected a probability"),
    "unknown solver": (["frame.json", "--solver", "p9p"], "solver: expected one of auto, p1p"),
    "output is a folder": (["frame.json", "-o", "."], "-o .: is a folder"),
    "output in no folder": (["frame.json", "-o", "no/where"], "no/where: No such file"),
    "output is the input": (["frame.json", "-o", "frame.json"], "is the input"),
    "broken JSON": (["broken.json"], "broken.json: expected JSON, got"),
    "empty file": (["empty.json"], "empty.json: expected a frame, got an empty file"),
    "only bad lines": (["bad.jsonl"], "bad.jsonl: camera: expected a value"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_one_line_and_status_2(case, frame, monkeypatch):
    monkeypatch.chdir(frame.parent)
    Path("broken.json").write_text('{\n "camera": 1,,}\n')
    Path("empty.json").write_text("")
    Path("bad.jsonl").write_text('{"objects": []}\n')
    arguments, text = MISTAKES[case]
    before = frame.read_text()
    result = run("estimate", *arguments)
    assert result.exit_code == 2
    assert text in one_line(result).replace("bad.jsonl:1", "bad.jsonl")
    assert result.stdout == ""
    assert frame.read_text() == before


def test_usage_errors_of_typer_have_status_2(frame):
    for arguments in (
        ["estimate"],
        ["estimate", frame, "--confidenz", "1"],
        ["estimate", frame, "--seed", "x"],
        ["fly"],
    ):
        result = run(*arguments)
        assert result.exit_code == 2
        assert "Traceback" not in result.output


@pytest.mark.parametrize("command", ["estimate", "demo", "bench"])
def test_help_has_examples(command):
    result = run(command, "--help")
    assert result.exit_code == 0
    assert "Examples" in result.stdout
    assert f"groundpose {command}" in result.stdout


def test_version_and_no_command():
    assert run("--version").stdout == f"groundpose {gp.__version__}\n"
    bare = run()
    assert all(command in bare.output for command in ("estimate", "demo", "bench"))


def command(*arguments: object, **more) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-m", "groundpose.cli", *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **more,
    )


def test_a_real_process_reads_a_pipe_and_writes_frame_by_frame():
    """The pose of the first line is out before the second line is in; Ctrl-C keeps what is done."""
    # a shell's background job ignores Ctrl-C and hands that down
    heed = (
        {}
        if sys.platform == "win32"
        else {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    )
    with command("estimate", "-", **heed) as process:
        line = (json.dumps(FRAME) + "\n").encode()
        process.stdin.write(line)
        process.stdin.flush()
        assert json.loads(process.stdout.readline())["id"] == "first"
        time.sleep(0.5)  # until it waits for the next line
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors.decode().strip() == "error: interrupted; frames finished and written: 1"


@pytest.mark.skipif(sys.platform == "win32", reason="pipes break otherwise there")
def test_a_reader_that_has_enough_is_no_error(tmp_path):
    path = tmp_path / "many.jsonl"
    path.write_text((json.dumps(FRAME) + "\n") * 200)
    with command("estimate", path) as process:
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(timeout=60) == 0
        assert process.stderr.read() == b""


def test_output_is_complete_up_to_a_kill(tmp_path):
    """A killed process leaves whole lines only."""
    path, out = tmp_path / "many.jsonl", tmp_path / "out.jsonl"
    path.write_text((json.dumps(FRAME) + "\n") * 3000)
    with command("estimate", path, "-o", out) as process:
        deadline = time.monotonic() + 60.0
        while not (out.exists() and out.stat().st_size > 20_000) and time.monotonic() < deadline:
            time.sleep(0.005)
        process.kill()
    lines = out.read_text().splitlines(keepends=True)
    assert len(lines) >= 2
    for line in lines:
        assert line.endswith("\n")
        json.loads(line)


def test_colours_and_progress_stay_out_of_files(frame, tmp_path):
    environment = {**os.environ, "FORCE_COLOR": ""}
    with command("estimate", frame, "--format", "table", env=environment) as process:
        out, errors = process.communicate(timeout=60)
    assert b"\x1b" not in out
    assert errors == b""


def test_a_frame_without_boxes_and_with_a_hidden_object(tmp_path):
    frame = frame_of(BATCH, image=None)
    for item in frame["objects"]:
        item["bbox"] = None
    frame["objects"][1]["keypoints_2d"] = as_json(np.full((24, 2), np.nan))
    path = tmp_path / "f.json"
    path.write_text(json.dumps(frame))
    result = run("estimate", path, "--draw", tmp_path / "p.png")
    assert result.exit_code == 0
    statuses = [o["status"] for o in json.loads(result.stdout)["objects"]]
    assert statuses[1] == "too_few_keypoints"
    table = run("estimate", path, "--format", "table").stdout
    assert "too_few_keypoints" in table
    assert CAMERA.image_size == (1280, 720)
