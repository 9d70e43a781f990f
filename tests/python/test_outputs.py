"""What `groundpose estimate` leaves behind: every format, whole files, unlike names, no input harmed."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from conftest import frame_of, make_batch
from groundpose._writing import only_writer
from groundpose.cli.destination import Names, file_stem
from groundpose.cli.journal import Journal
from groundpose.formats import columns
from test_cli import one_line, run

BATCH = make_batch(3, seed=41)
FRAME = frame_of(BATCH, "first")
POSES = gp.estimate_poses(BATCH.view, BATCH.keypoints_2d, BATCH.bboxes, BATCH.models)
SHORT = {name: value for name, value in FRAME.items() if name != "id"}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def frames(*ids: object, name: str = "frames.jsonl") -> str:
    Path(name).write_text("".join(json.dumps({"id": label, **SHORT}) + "\n" for label in ids))
    return name


def left() -> set[str]:
    return {path.relative_to(Path()).as_posix() for path in Path().rglob("*") if path.is_file()}


def table(path: str) -> list[dict]:
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_table_has_all_that_a_pose_is():
    frames("a", "b")
    result = run("estimate", "frames.jsonl", "-o", "poses.csv")
    assert result.exit_code == 0, result.output
    assert result.stderr.startswith("2 frames, 6 vehicles, 6 poses, poses.csv, ")
    rows = table("poses.csv")
    assert tuple(rows[0]) == columns.COLUMNS
    assert [(row["frame"], row["object"], row["class"], row["status"]) for row in rows[:3]] == [
        ("a", "0", "car", "ok"),
        ("a", "1", "car", "ok"),
        ("a", "2", "car", "ok"),
    ]
    for k, row in enumerate(rows[3:]):
        one = {name: float(value) for name, value in row.items() if name not in columns.COLUMNS[:5] and value}
        assert [one[f"ground_{axis}"] for axis in "xyz"] == pytest.approx(POSES.position[k])
        assert one["ground_heading"] == pytest.approx(POSES.heading[k])
        assert [one[name] for name in ("length", "height", "width")] == pytest.approx(POSES.size[k])
        assert [one[name] for name in ("left", "top", "right", "bottom")] == pytest.approx(BATCH.bboxes[k])
        assert one["probability"] == pytest.approx(POSES.probability[k])
        assert row["score"] == row["class_probability"] == ""
        bottom = np.array([[one[f"{name}_{axis}"] for axis in "xyz"] for name in columns.CORNERS[:4]])
        assert bottom.mean(axis=0) == pytest.approx([one["x"], one["y"], one["z"]])
        along = bottom[:2].mean(axis=0) - bottom[2:].mean(axis=0)
        assert along == pytest.approx(POSES.R[k, :, 2] * one["length"])
        assert one["heading"] == pytest.approx(np.arctan2(along[0], along[2]))


def test_standard_deviations_are_those_of_drawn_poses():
    found = columns.numbers(POSES)
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(np.zeros(6), POSES.covariance[0], 4000)
    ground = BATCH.view.R_camera_from_ground
    arm = columns.bottom_centres(POSES)[0] - POSES.t[0]
    places = (np.cross(drawn[:, :3], arm) + drawn[:, 3:]) @ ground
    spread = [found[f"ground_{axis}_sigma"][0] for axis in "xyz"]
    assert places.std(axis=0) == pytest.approx(spread, rel=0.05)
    assert (drawn[:, :3] @ ground[:, 1]).std() == pytest.approx(found["heading_sigma"][0], rel=0.05)


def test_parquet_is_the_same_table():
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    frames("a", 7)
    for name in ("poses.csv", "poses.parquet"):
        assert run("estimate", "frames.jsonl", "-o", name).exit_code == 0
    made = parquet.read_table("poses.parquet")
    assert tuple(made.column_names) == columns.COLUMNS
    for row, there in zip(made.to_pylist(), table("poses.csv"), strict=True):
        for name, value in row.items():
            assert there[name] == ("" if value is None else str(value))
    assert left() == {"frames.jsonl", "poses.csv", "poses.parquet"}
    assert "got a pipe" in one_line(run("estimate", "frames.jsonl", "--format", "parquet"))


def test_without_pyarrow_it_says_what_to_install(monkeypatch):
    frames("a")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    refused = run("estimate", "frames.jsonl", "-o", "poses.parquet")
    assert "pip install 'groundpose[parquet]'" in one_line(refused)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("-o", "poses.xls"), "-o poses.xls: expected a file that ends in .jsonl, .ndjson, .json, .csv,"),
        (("-o", "poses.csv", "--format", "jsonl"), "expected a file that ends in .jsonl for --format jsonl"),
        (("-o", "poses.txt"), "--format kitti: one file holds one frame"),
    ],
)
def test_an_ending_that_says_no_format_is_refused(arguments, text):
    frames("a", "b")
    before = left()
    refused = run("estimate", "frames.jsonl", *arguments)
    assert refused.exit_code == 2
    assert text in one_line(refused)
    assert left() == before


def test_unlike_ids_get_unlike_names():
    labels = ("a/b", "a b", "a_b", "a_b", "A_B", 1, "000001", "1", "", ".", "..", "é", "x" * 300, "x" * 301)
    given = Names()
    stems = [given.of(label) for label in labels]
    assert len({stem.casefold() for stem in stems}) == len(labels)
    assert all("/" not in stem and 0 < len(stem.encode()) < 200 and stem[0] != "." for stem in stems)
    assert (stems[2], stems[3], stems[5], stems[7]) == ("a_b", "a_b-2", "000001", "1")
    assert file_stem("a/b") == stems[0]  # the same in every run
    frames(*labels[:4], "a\x1bb")
    assert run("estimate", "frames.jsonl", "--format", "kitti", "-o", "out").exit_code == 0
    assert {path.stem for path in Path("out").iterdir()} == {*stems[:4], file_stem("a\x1bb")}


def test_results_never_go_onto_an_input():
    source = frames("a", "b")
    content = Path(source).read_bytes()
    os.link(source, "hard.jsonl")
    Path("soft.jsonl").symlink_to(source)
    for name in (source, f"./{source}", "hard.jsonl", "soft.jsonl"):
        refused = run("estimate", source, "-o", name)
        assert refused.exit_code == 2
        assert "is the input; give another name" in one_line(refused)
    assert Path(source).read_bytes() == content


def test_an_old_result_stays_until_there_is_a_new_one():
    frames("a")
    assert run("estimate", "frames.jsonl", "-o", "poses.jsonl").exit_code == 0
    old = Path("poses.jsonl").read_bytes()
    Path("bad.jsonl").write_text('{"objects": []}\n')
    assert run("estimate", "bad.jsonl", "-o", "poses.jsonl").exit_code == 2
    assert run("estimate", "none.jsonl", "-o", "poses.jsonl").exit_code == 2
    assert run("estimate", "frames.jsonl", "-o", "poses.jsonl", "--confidence", "2").exit_code == 2
    assert Path("poses.jsonl").read_bytes() == old
    assert left() == {"frames.jsonl", "bad.jsonl", "poses.jsonl"}


def test_no_text_is_written_for_a_frame_that_could_not_be_read():
    text = json.dumps(FRAME)
    empty = json.dumps({**FRAME, "id": "none", "objects": []})
    Path("frames.jsonl").write_text(f'{text}\n{{"id": "bad"}}\n{empty}\n')
    assert run("estimate", "frames.jsonl", "--format", "kitti", "-o", "out").exit_code == 1
    sizes = {path.name: path.stat().st_size for path in Path("out").iterdir()}
    assert set(sizes) == {"first.txt", "none.txt"}
    assert sizes["none.txt"] == 0


def test_a_second_run_into_one_place_is_refused():
    frames("a", "b")
    Path("out").mkdir()
    for held, arguments in (
        ("out", ("--format", "kitti", "-o", "out")),
        ("poses.csv", ("-o", "poses.csv")),
        ("out/poses.jsonl", ("-o", "out/poses.jsonl")),
    ):
        with only_writer(held):
            refused = run("estimate", "frames.jsonl", *arguments)
        assert refused.exit_code == 2
        assert f"{held}: expected no other run that writes there, got one, process" in one_line(refused)
        assert run("estimate", "frames.jsonl", *arguments).exit_code == 0


def test_exit_status_says_how_it_went():
    frames("a")
    arguments = ("estimate", "frames.jsonl", "-o", "poses.jsonl")
    assert run(*arguments, "--strict").exit_code == 0
    assert run(*arguments, "--min-keypoints", 25).exit_code == 1  # not one pose
    frame = {**SHORT, "id": "a", "objects": [dict(item) for item in SHORT["objects"]]}
    frame["objects"][1]["keypoints_2d"] = [None] * 24
    Path("frames.jsonl").write_text(json.dumps(frame) + "\n")
    result = run(*arguments)
    assert (result.exit_code, result.stderr.startswith("1 frame, 3 vehicles, 2 poses, ")) == (0, True)
    assert run(*arguments, "--strict").exit_code == 1
    Path("frames.jsonl").write_text(json.dumps({**SHORT, "objects": []}) + "\n")
    assert run(*arguments, "--strict").exit_code == 0


def stopped(monkeypatch, after: int, *arguments: object, by=SystemExit(9)):  # noqa: B008
    """A run that ends so after some frames; SystemExit stands for a kill, at which nothing is done."""
    calls = iter([gp.estimate_poses] * after)

    def stop(**given):
        solve = next(calls, None)
        if solve is None:
            raise by
        return solve(**given)

    with monkeypatch.context() as patched:
        patched.setattr("groundpose.cli.frames.estimate_poses", stop)
        return run(*arguments)


# format: where results go
GOING_ON = {
    "jsonl": ("poses.jsonl",),
    "csv": ("poses.csv",),
    "parquet": ("poses.parquet",),
    "kitti": ("out", "--format", "kitti"),
}


@pytest.mark.parametrize("how", ["interrupted", "killed"])
@pytest.mark.parametrize("form", GOING_ON)
def test_an_interrupted_run_is_gone_on_with(form, how, monkeypatch):
    if form == "parquet":
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    frames(*range(5), "a/b", "a b", 7)
    arguments = ("estimate", "frames.jsonl", "-o", *GOING_ON[form])
    assert run(*arguments).exit_code == 0
    whole = contents()
    for path in whole:
        Path(path).unlink()
    ended = stopped(
        monkeypatch, 3, *arguments, by=KeyboardInterrupt if how == "interrupted" else SystemExit(9)
    )
    if how == "interrupted":
        assert ended.exit_code == 130
        assert "interrupted; frames finished and written: 3; the same command goes on" in ended.stderr
        assert all(whole[name].startswith(text) or form == "parquet" for name, text in contents().items())
        assert contents()
    elif form != "kitti":
        assert not contents()  # the file has its name when it is complete
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    assert "going on: 3 frames are finished" in result.stderr
    assert "8 frames, 24 vehicles, 24 poses" in result.stderr
    assert contents() == whole
    assert not [name for name in left() if name.rpartition("/")[2].startswith(".")]


def contents() -> dict[str, bytes]:
    """All results; of Parquet, whose bytes may differ, the rows."""
    found = {name: Path(name).read_bytes() for name in left() if name != "frames.jsonl"}
    found = {name: data for name, data in found.items() if not name.rpartition("/")[2].startswith(".")}
    for name in found:
        if name.endswith(".parquet"):
            from pyarrow import parquet

            found[name] = repr(parquet.read_table(name).to_pylist()).encode()
    return found


def test_a_run_in_the_folder_of_its_input_goes_on_and_a_text_that_is_gone_is_made_again(monkeypatch):
    Path("in").mkdir()
    frames(1, 2, 3, name="in/frames.jsonl")
    monkeypatch.chdir("in")
    stopped(monkeypatch, 2, "estimate", "frames.jsonl", "-o", "poses.csv")
    assert "going on: 2 frames" in run("estimate", "frames.jsonl", "-o", "poses.csv").stderr
    arguments = ("estimate", "frames.jsonl", "--format", "kitti", "-o", "out")
    stopped(monkeypatch, 2, *arguments)
    Path("out/000001.txt").unlink()
    assert "going on: 1 frame is finished" in run(*arguments).stderr
    assert {path.name for path in Path("out").iterdir()} == {"000001.txt", "000002.txt", "000003.txt"}


def test_a_link_to_the_results_stays_a_link():
    frames("a")
    Path("elsewhere").mkdir()
    Path("poses.jsonl").symlink_to("elsewhere/real.jsonl")
    for _ in range(2):
        assert run("estimate", "frames.jsonl", "-o", "poses.jsonl").exit_code == 0
        assert Path("poses.jsonl").is_symlink()
        Path("elsewhere/real.jsonl").chmod(0o600)
    assert Path("elsewhere/real.jsonl").stat().st_mode & 0o777 == 0o600


def test_a_disk_that_gets_full_keeps_what_is_finished(monkeypatch):
    frames(1, 2, 3)
    calls, add = iter(range(3)), Journal.add

    def full(journal, text):
        if next(calls) == 2:
            add(journal, text[:100])
            raise OSError(28, "No space left on device", str(journal.target))
        add(journal, text)

    with monkeypatch.context() as patched:
        patched.setattr(Journal, "add", full)
        ended = run("estimate", "frames.jsonl", "-o", "poses.jsonl")
    assert ended.exit_code == 2
    assert one_line(ended).endswith("poses.jsonl: No space left on device; the same command goes on")
    assert [json.loads(line)["id"] for line in Path("poses.jsonl").read_text().splitlines()] == [1, 2]
    assert "going on: 2 frames are finished" in run("estimate", "frames.jsonl", "-o", "poses.jsonl").stderr
    assert [json.loads(line)["id"] for line in Path("poses.jsonl").read_text().splitlines()] == [1, 2, 3]


def test_only_the_same_command_on_the_same_files_goes_on(monkeypatch):
    def interrupted():
        stopped(monkeypatch, 2, "estimate", "frames.jsonl", "-o", "poses.jsonl")

    frames(1, 2, 3)
    interrupted()
    result = run("estimate", "frames.jsonl", "-o", "poses.jsonl", "--seed", 3)
    assert "begun anew: what is unfinished there is of another command" in result.stderr
    assert len(Path("poses.jsonl").read_text().splitlines()) == 3
    interrupted()
    frames(1, 2, 3, 4)
    result = run("estimate", "frames.jsonl", "-o", "poses.jsonl")
    assert "begun anew" in result.stderr
    assert len(Path("poses.jsonl").read_text().splitlines()) == 4
    interrupted()
    assert "going on: 2 frames" in run("estimate", "frames.jsonl", "-o", "poses.jsonl", "--threads", 1).stderr
    stream = Path("frames.jsonl").read_text()
    for _ in range(2):  # nobody knows whether a pipe brings the same again
        result = run("estimate", "-", "-o", "poses.jsonl", stdin=stream)
        assert "going on" not in result.stderr


def test_a_journal_cut_off_anywhere_is_gone_on_with(monkeypatch):
    """Whatever a kill leaves of the last lines, the result is the same."""
    frames(1, 2, 3)
    arguments = ("estimate", "frames.jsonl", "-o", "poses.jsonl")
    assert run(*arguments).exit_code == 0
    whole = Path("poses.jsonl").read_bytes()
    stopped(monkeypatch, 2, *arguments)
    part, record = Path(".poses.jsonl.part").read_bytes(), Path(".poses.jsonl.run").read_bytes()
    last = record.rstrip(b"\n").rindex(b"\n") + 1
    for text, lines in (
        (part[:-10], record),
        (part + whole[len(part) :][:1000], record),
        (part, record[:-1]),
        (part, record[: last + 5]),
        (part, record[:last]),
        (part[: len(part) // 2 + 10], record),
        (b"", record),
        (part, record[:20]),
        (part, b""),
    ):
        Path("poses.jsonl").write_bytes(b"old")
        Path(".poses.jsonl.part").write_bytes(text)
        Path(".poses.jsonl.run").write_bytes(lines)
        assert run(*arguments).exit_code == 0
        assert Path("poses.jsonl").read_bytes() == whole
        assert left() == {"frames.jsonl", "poses.jsonl"}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_line():
    frames("a")
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "groundpose.cli", "estimate", "frames.jsonl"]
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=60)
    assert ended.returncode == 2
    assert ended.stderr.decode().splitlines() == ["error: standard output: No space left on device"]
    refused = run("estimate", "frames.jsonl", "-o", "/dev/full")
    assert "/dev/full: No space left on device" in one_line(refused)
