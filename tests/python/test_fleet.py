"""Fleets: tables in, tables out, whole or not at all, the same rows however the work is cut and killed."""

import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from fleet_frames import all_rows, keypoint_frame, same_rows, write_frames
from groundpose.cli.inputs import is_table
from groundpose.demo.street import IMAGE, example
from groundpose.fleet import EstimateFrames
from test_cli import one_line, run

pa = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
from groundpose.fleet import parts as fleet_parts  # noqa: E402
from groundpose.fleet.pool import in_processes, in_this_process  # noqa: E402
from groundpose.fleet.run import plan  # noqa: E402
from groundpose.fleet.run import run as run_fleet  # noqa: E402
from groundpose.formats.arrow_frames import frames_table  # noqa: E402
from groundpose.formats.arrow_schema import FRAMES, VERSION_KEY, schema_of  # noqa: E402
from groundpose.formats.arrow_values import camera_value  # noqa: E402
from pyarrow import parquet  # noqa: E402


def plain(table):
    return table.to_pylist()


def frames(count=3, objects=3):
    return frames_table([keypoint_frame(k, objects) for k in range(count)])


def edited(table, **columns):
    """Rows with other values: functions of the row's number and its value."""
    rows = table.to_pylist()
    for name, change in columns.items():
        for k, row in enumerate(rows):
            row[name] = change(k, row[name])
    return pa.Table.from_pylist(rows, schema=table.schema)


def test_rows_are_those_of_the_library():
    given = [keypoint_frame(k, 3) for k in range(3)]
    made = EstimateFrames()(frames_table(given))
    assert made.schema.equals(EstimateFrames.schema(), check_metadata=True)
    for k, frame in enumerate(given):
        poses = gp.estimate_poses(**frame.arguments, threads=1)
        again = gp.PoseBatch.from_arrow(made.slice(3 * k, 3))
        for name in (
            "R",
            "t",
            "covariance",
            "residuals",
            "shape_covariance",
            "status",
            "inlier_mask",
            "size",
        ):
            np.testing.assert_array_equal(getattr(again, name), getattr(poses, name), err_msg=name)
    assert made.column("frame").to_pylist() == [f"{k:06d}" for k in range(3) for _ in range(3)]
    assert made.column("object").to_pylist() == ["0", "1", "2"] * 3


def test_rows_do_not_depend_on_how_the_frames_are_cut():
    table, estimate = frames(5), pickle.loads(pickle.dumps(EstimateFrames()))
    whole = estimate(table)
    batches = [b for k in range(5) for b in table.slice(k, 1).to_batches()]
    assert same_rows(pa.Table.from_batches(list(estimate.batches(batches))), whole)
    nested = estimate.nested(table)
    assert len(nested) == 5
    assert repr(nested.flatten().to_pylist()) == repr(whole.drop_columns(["frame"]).to_pylist())


def test_an_empty_table_and_a_frame_without_objects():
    estimate = EstimateFrames()
    assert estimate(frames().slice(0, 0)).num_rows == 0
    made = estimate(edited(frames(2), objects=lambda k, value: value if k else []))
    assert made.column("status").to_pylist()[0] == "no_objects"
    assert made.column("object").to_pylist() == [None, "0", "1", "2"]
    assert len(gp.PoseBatch.from_arrow(made.slice(0, 1))) == 0


def broken(k, value):
    """One thing wrong with the objects of each row but the last."""
    first = value[0]
    changes = (
        {"keypoints_2d": first["keypoints_2d"][:5]},
        {"model": None},
        {"model": "bundled:lorry"},
        {"bbox": [1.0, 2.0]},
        {"keypoints_2d": None},
        {"keypoints_2d": [[1.0]] * len(first["keypoints_2d"])},
    )
    return [{**first, **changes[k]}, *value[1:]] if k < len(changes) else value


def test_bad_frames_are_rows_that_say_why():
    good = EstimateFrames()(frames(7))
    made = EstimateFrames()(edited(frames(7), objects=broken))
    assert made.column("status").to_pylist()[:6] == ["bad_frame"] * 6
    said = made.column("message").to_pylist()[:6]
    wanted = (
        "keypoints as in the model",
        "got null",
        "lorry",
        "4 numbers",
        "all objects or of none",
        "(P, 2)",
    )
    assert all(word in line for word, line in zip(wanted, said, strict=True)), said
    assert same_rows(made.slice(6), good.slice(18))
    with pytest.raises(gp.InputError, match="expected a frame that was estimated, got a bad one"):
        gp.PoseBatch.from_arrow(made.slice(0, 1))


def test_nulls_where_there_must_be_a_value():
    made = EstimateFrames()(edited(frames(2), camera=lambda k, value: value if k else None))
    assert made.column("message").to_pylist()[0] == "camera: expected a camera, got null"
    made = EstimateFrames()(edited(frames(2), objects=lambda k, value: value if k else None))
    assert made.column("message").to_pylist()[0] == "objects: expected boxes, or a detector, got null"
    seen = edited(
        frames(1), objects=lambda k, v: [{**o, "keypoints_2d": [*o["keypoints_2d"][:-1], None]} for o in v]
    )
    assert EstimateFrames()(seen).column("status").to_pylist() == ["ok"] * 3


def test_tables_that_are_none_of_ours():
    table = frames()
    for given, expected in (
        (table.replace_schema_metadata({**table.schema.metadata, VERSION_KEY: b"7"}), "version 7"),
        (table.drop_columns(["camera"]), "expected the columns camera"),
        (table.set_column(5, "pitch", pa.array([["a"]] * 3)), "column pitch: expected double"),
        (EstimateFrames()(table), "expected a table of frames, got one of poses"),
    ):
        with pytest.raises(gp.InputError, match=expected):
            EstimateFrames()(given)
    assert EstimateFrames()(table.replace_schema_metadata(None)).num_rows == 9


def pictures(bytes_of):
    """Frames of the bundled street; `bytes_of` gives each picture."""
    street = example()
    objects = [
        {"object": str(k), "class": "car", "score": 0.9, "bbox": box}
        for k, box in enumerate(street.bboxes[:2].tolist())
    ]
    rows = [
        {"frame": str(k), "image": image, "image_bytes": data, "objects": objects}
        | {"camera": camera_value(street.view.camera), "pitch": street.view.pitch, "roll": street.view.roll}
        for k, (image, data) in enumerate(bytes_of)
    ]
    return pa.Table.from_pylist(rows, schema=schema_of(FRAMES))


def test_pictures_as_bytes_as_files_and_none():
    data = IMAGE.read_bytes()
    table = pictures([(None, data), (IMAGE.name, None), ("none.jpg", None), (None, b"GIF"), (None, None)])
    made = EstimateFrames(network="int8", folder=str(IMAGE.parent))(table)
    assert made.column("status").to_pylist()[4:] == ["bad_frame"] * 3
    said = made.column("message").to_pylist()[4:]
    assert said[0] == "none.jpg: No such file or directory"
    assert "expected a picture" in said[1]
    assert "its bytes, got null" in said[2]
    street = example()
    poses = gp.Pipeline("int8", threads=1)(street.image, street.bboxes[:2], street.view)
    for rows in (made.slice(0, 2), made.slice(2, 2)):
        again = gp.VehiclePoses.from_arrow(rows)
        np.testing.assert_array_equal(again.R, poses.R)
        np.testing.assert_array_equal(again.keypoint_scores, poses.keypoint_scores)


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet") / "frames"
    write_frames(folder, files=2, groups=2, frames=3, objects=2)
    return folder


@pytest.fixture(scope="module")
def alone(source):
    """The output of one process."""
    out = source.parent / "alone"
    report = run_fleet(EstimateFrames(), source, out, in_this_process, 1)
    assert (report.parts, report.before, report.failed) == (4, 0, [])
    assert report.counts == {"frames": 12, "objects": 24, "poses": 24, "bad": 0}
    return all_rows(out)


def test_parts_are_named_by_their_inputs(alone):
    assert list(alone) == [f"day={d}/00{d}.0000{k}.parquet" for d in (0, 1) for k in (0, 1)]


def assert_whole(out, alone):
    made = all_rows(out)
    assert list(made) == list(alone)
    assert all(same_rows(made[name], alone[name]) for name in alone)


def test_two_processes_give_the_same_rows_and_go_on_with_what_is_missing(source, alone, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(source.parent / "alone", out)
    kept = out / "day=0/000.00000.parquet"
    before = kept.stat().st_mtime_ns
    gone = [out / "day=0/000.00001.parquet", out / "day=1/001.00000.parquet"]
    gone[0].unlink()
    gone[1].write_bytes(b"half")
    (out / "day=1" / ".groundpose-0-1-2.part").write_bytes(b"half")
    report = run_fleet(EstimateFrames(), source, out, in_processes, 2)
    assert (report.before, report.new_frames) == (2, 6)
    assert kept.stat().st_mtime_ns == before
    assert_whole(out, alone)
    assert not list(out.rglob("*.part"))


def test_a_killed_run_goes_on(source, alone, tmp_path):
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-m",
        "groundpose.cli",
        "fleet",
        "estimate",
        str(source),
        str(out),
        "--workers",
        "1",
    ]
    running = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 60
    while not list(out.rglob("*.parquet")) and time.monotonic() < end:
        time.sleep(0.01)
    os.kill(running.pid, signal.SIGKILL)
    running.wait()
    found = run("fleet", "estimate", source, out, "--workers", 1)
    assert found.exit_code == 0
    assert "12 frames, 24 objects, 24 poses" in found.stderr
    assert_whole(out, alone)


def test_a_worker_that_ends_costs_nothing(source, alone, tmp_path, monkeypatch):
    marks = tmp_path / "marks"
    marks.mkdir()
    report = run_fleet(Ending(folder=str(marks)), source, tmp_path / "out", in_processes, 2)
    assert report.failed == []
    assert len(list(marks.iterdir())) == 1
    assert_whole(tmp_path / "out", alone)


class Ending(EstimateFrames):
    """The first worker that is asked ends as one does for which there is no memory."""

    def __call__(self, frames):
        mark = Path(self.folder) / "ended"
        try:
            mark.touch(exist_ok=False)
        except FileExistsError:
            return super().__call__(frames)
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_part_with_which_workers_end_each_time_is_given_up(source, tmp_path):
    report = run_fleet(AlwaysEnding(), source, tmp_path / "out", in_processes, 1)
    assert report.counts["frames"] == 9
    assert len(report.failed) == 1
    assert "3 times a worker was ended by the system" in report.failed[0]


class AlwaysEnding(EstimateFrames):
    def __call__(self, frames):
        if frames.column("frame")[0].as_py() == "000003":
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__call__(frames)


def test_the_command_refuses_what_cannot_be(source, tmp_path):
    out = tmp_path / "out"
    assert run("fleet", "estimate", source, out, "--workers", 1, "--seed", 1).exit_code == 0
    refused = run("fleet", "estimate", source, out, "--workers", 1)
    assert refused.exit_code == 2
    assert "those of another run" in one_line(refused)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "a.txt").touch()
    assert "one with other files" in one_line(run("fleet", "estimate", source, tmp_path / "other"))
    assert "one in it or around it" in one_line(run("fleet", "estimate", source, source / "out"))
    assert "none in it" in one_line(run("fleet", "estimate", tmp_path / "other", out))
    assert run("fleet", "estimate", tmp_path / "none.parquet", out).exit_code == 2
    (tmp_path / "bad.parquet").write_bytes(b"PAR1")
    assert "a Parquet file" in one_line(run("fleet", "estimate", tmp_path / "bad.parquet", out))


def test_parts_that_cannot_be_read_are_named_and_the_others_done(tmp_path):
    source = tmp_path / "in"
    write_frames(source, files=1, groups=1, frames=2, objects=1)
    parquet.write_table(frames(1).drop_columns(["camera"]), source / "z.parquet")
    bad = edited(frames(1), objects=lambda k, value: None)
    parquet.write_table(bad, source / "y.parquet")
    found = run("fleet", "estimate", source, tmp_path / "out", "--workers", 1)
    assert found.exit_code == 1
    assert "z.parquet: frames: expected the columns camera of frames" in found.stderr
    assert "1 frame could not be estimated" in found.stderr
    assert "2 of 3 parts, 3 frames, 2 objects, 2 poses" in found.stderr


def test_a_network_that_is_none_is_no_frames_fault(tmp_path):
    table = pictures([(None, IMAGE.read_bytes())])
    (tmp_path / "none.onnx").write_bytes(b"none")
    for network, kind in (("none.onnx", gp.InputError), ("missing.onnx", FileNotFoundError)):
        with pytest.raises(kind):
            EstimateFrames(network=str(tmp_path / network))(table)
    parquet.write_table(table, tmp_path / "in.parquet")
    asked = ("--network", tmp_path / "none.onnx")
    refused = run("fleet", "estimate", tmp_path / "in.parquet", tmp_path / "out", *asked)
    assert refused.exit_code == 2
    assert not (tmp_path / "out").exists()
    found = run("estimate", tmp_path / "in.parquet", "-o", tmp_path / "out.jsonl", *asked)
    assert found.exit_code == 2, found.output


def test_estimate_of_pictures_in_tables(tmp_path):
    table = pictures([(None, IMAGE.read_bytes()), (None, b"GIF")])
    parquet.write_table(table, tmp_path / "in.parquet")
    found = run("estimate", tmp_path / "in.parquet", "-o", tmp_path / "out.csv", "--network", "int8")
    assert found.exit_code == 1
    assert "frame 1: image: expected a picture" in found.stderr
    assert "1 frame, 2 vehicles, 2 poses" in found.stderr


def test_a_folder_of_pictures_is_theirs_though_results_lie_in_it(tmp_path):
    shutil.copy(IMAGE, tmp_path / "a.jpg")
    (tmp_path / "poses.parquet").write_bytes(b"PAR1")
    assert not is_table(tmp_path)
    assert is_table(tmp_path / "poses.parquet")


def test_ray_is_asked_for_in_words(source, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    refused = run("fleet", "estimate", source, tmp_path / "out", "--ray", "local")
    assert refused.exit_code == 2
    assert "pip install 'groundpose[fleet]'" in one_line(refused)


def test_a_dry_run_says_what_there_is_to_do(source, tmp_path):
    said = run("fleet", "estimate", source, tmp_path / "out", "--dry-run", "--workers", 2)
    assert said.exit_code == 0
    assert "4 parts, of which 0 are done" in said.output
    assert "12 frames to estimate" in said.output
    assert not (tmp_path / "out").exists()
    assert (
        plan(EstimateFrames(), source, source.parent / "alone").frames == 0
        or not (source.parent / "alone").exists()
    )


def test_an_input_that_has_changed_is_done_again(tmp_path):
    source, out = tmp_path / "in", tmp_path / "out"
    write_frames(source, files=1, groups=1, frames=2, objects=1)
    run_fleet(EstimateFrames(), source, out, in_this_process, 1)
    (part,) = fleet_parts.parts_of(source, out)
    assert part.is_done()
    os.utime(part.source, ns=(1, 1))
    (part,) = fleet_parts.parts_of(source, out)
    assert not part.is_done()


def test_estimate_reads_parquet(source, alone, tmp_path):
    out = tmp_path / "poses.parquet"
    found = run("estimate", source, "-o", out, "--threads", 1)
    assert found.exit_code == 0, found.output
    made = parquet.read_table(out)
    rows = [row for table in alone.values() for row in table.to_pylist()]
    assert made.column("frame").to_pylist() == [row["frame"] for row in rows]
    for name, k in (("ground_x", 0), ("ground_y", 1), ("ground_z", 2)):
        assert made.column(name).to_pylist() == [row["position"][k] for row in rows]
    assert "--boxes: is for images in files" in one_line(run("estimate", source, "--boxes", source))
