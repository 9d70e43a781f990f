"""A short version of `python -m groundpose.lab.evaluate.kills`, its eye for halves, two runs in one place."""

import json
import random
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from groundpose._writing import LOCK, only_writer
from groundpose.lab.evaluate import kill_inputs, kills
from groundpose.lab.evaluate.whole import halves
from groundpose.lab.training.crops import write_crops
from groundpose.lab.training.toy import toy_samples
from PIL import Image
from test_cli import one_line, run

needs_proc = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc")


@needs_proc
def test_an_interrupted_command_leaves_whole_files_and_no_process(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = lambda: kill_inputs.drawn_frames(Path("frames.jsonl"), 150)  # noqa: E731
    case = replace(kills.CASES["estimate, JSON lines"], make=made)
    found = kills.run(case, 3, random.Random(1))
    assert found["half_files"] == []
    assert found["left_processes"] == 0
    assert found["left_notes"] == []
    assert found["same_result"]


@needs_proc
def test_processes_that_are_left_are_seen():
    case = kills.Case(lambda: None, "", "")
    code = "import subprocess, time; subprocess.Popen(['sleep', '60']); time.sleep(60)"
    command = [sys.executable, "-c", code]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(kills, "_command", lambda case: command)
        patched.setattr(kills, "_GRACE", 0.2)
        assert kills._interrupted(case, kills.SIGNALS[2], 1.0) == (False, 1)


def test_half_files_are_seen(tmp_path):
    whole = tmp_path / "whole"
    whole.mkdir()
    kill_inputs.drawn_frames(whole / "a.jsonl", 2)
    (whole / "b.json").write_text(json.dumps({"a": [1, 2]}))
    (whole / "c.csv").write_text("a,b\n1,2\n")
    (whole / "d.txt").write_text("Car -1 -1 0.1 1 2 3 4 1.5 1.6 4.0 1 2 3 0.5 0.9\n")
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64, 3), dtype=np.uint8)).save(
        whole / "e.png"
    )
    np.save(whole / "f.npy", np.zeros(100))
    np.savez(whole / "g.npz", a=np.zeros(100))
    (whole / "h.txt").write_text("")
    (whole / ".i.json").write_text("{")
    assert halves(whole) == []
    for name in ("a.jsonl", "b.json", "c.csv", "d.txt", "e.png", "f.npy", "g.npz"):
        broken = tmp_path / "broken"
        shutil.copytree(whole, broken)
        data = (whole / name).read_bytes()
        (broken / name).write_bytes(data[: len(data) - 3])
        assert [line.partition(":")[0] for line in halves(broken)] == [name]
        shutil.rmtree(broken)


def test_every_command_refuses_a_folder_in_which_another_run_writes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("out").mkdir()
    kill_inputs.labels(Path("kitti"), 2)
    commands = {
        "out": (
            ("simulate", "--frames", 1, "--no-images", "-o", "out"),
            ("experiment", "E1", "--trials", 1, "-m", "RNSC-P1P", "-o", "out", "--jobs", 1),
            ("crops", "out", "--source", "toy", "--frames", 10),
        ),
        "out/kitti.json": (
            ("evaluate", "kitti", "--root", "kitti", "--keypoints", "simulated", "-o", "out/kitti.json"),
        ),
        "out/bench.json": (("bench", "--quick", "--only", "outliers/50", "-o", "out/bench.json"),),
    }
    for place, each in commands.items():
        for command in each:
            with only_writer(place):
                before = {path.name for path in Path("out").iterdir()}
                refused = run(*command)
                assert {path.name for path in Path("out").iterdir()} == before
            assert refused.exit_code == 2, command
            assert f"{place}: expected no other run that writes there, got one" in one_line(refused)


def test_a_folder_that_a_killed_run_left_is_taken_over(tmp_path):
    (tmp_path / LOCK).write_text("1\n")
    assert write_crops(tmp_path, toy_samples, "train", 2) == 1
    assert LOCK not in {path.name for path in tmp_path.iterdir()}
