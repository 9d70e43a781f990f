"""Any terminal, pipe and locale: what is said is said, and nobody's text gives orders to it."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import groundpose
import pytest
from conftest import frame_of, make_batch
from groundpose.cli.output import harmless
from test_cli import one_line, run

FRAME = frame_of(make_batch(2, seed=41))
EVIL = "a\x1b[31m\u202e\x07\x9b\n\u2028b"
SHOWN = r"a\x1b[31m\u202e\x07\x9b\n\u2028b"


def started(*arguments: object, **more):
    command = [sys.executable, "-m", "groundpose.cli", *map(str, arguments)]
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, **pipes | more)


@pytest.fixture
def frame(tmp_path, monkeypatch) -> str:
    monkeypatch.chdir(tmp_path)
    items = [{**item, "id": EVIL} for item in FRAME["objects"]]
    Path("frame.json").write_text(json.dumps({**FRAME, "id": EVIL, "objects": items}))
    return "frame.json"


def test_control_characters_become_text():
    assert harmless(EVIL) == SHOWN
    assert harmless("a\n\tb", keep="\n\t") == "a\n\tb"
    assert harmless("straße 東京 ±5°") == "straße 東京 ±5°"


def test_ids_and_names_of_others_are_harmless_in_every_output(frame):
    Path("bad\x1b[2J.json").write_text("{}")
    outputs = [
        run("estimate", frame, "--format", "table"),
        run("estimate", frame, "--draw", "p\x1bq.xyz"),
        run("estimate", "bad\x1b[2J.json"),
        run("estimate", "none\x1b[2J.json"),
        run("estimate", frame, "-o", "out\x1b[2J/poses.jsonl"),
        run("estimate", frame, "--solver", "p\x1b[2J"),
        run("estimate", frame, "--classes", "a\x1b[2J"),
        run("evaluate", "kitti", "--root", "a\x1b[2J", "-o", "o.json"),
        run("simulate", "--frames", 1, "-o", frame + "/\x1b[2J"),
        run("\x1b[2J"),
        run("bench", "--only", "\x1b[2J"),
    ]
    assert SHOWN in outputs[0].stdout
    for result in outputs:
        assert not set("\x1b\x07\x9b\u202e\u2028") & set(result.output)
        assert result.output
    assert "none\\x1b[2J.json: No such file" in one_line(outputs[3])


@pytest.mark.parametrize("form", ["table", "csv", "kitti", "jsonl"])
def test_results_on_a_terminal_are_harmless(form, frame):
    pty = pytest.importorskip("pty", reason="no terminals here")
    ours, theirs = pty.openpty()
    with started(
        "estimate", frame, "--format", form, stdout=theirs, env={**os.environ, "TERM": "dumb"}
    ) as process:
        os.close(theirs)
        shown = b""
        while True:
            try:
                part = os.read(ours, 65536)
            except OSError:  # Linux's way to say that the other end is closed
                break
            if not part:
                break
            shown += part
    os.close(ours)
    assert process.returncode == 0
    assert b"\x1b[31m" not in shown
    assert b"\x07" not in shown
    assert len(shown) > 50


def test_a_locale_of_ascii_is_enough(frame):
    plain = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    plain.pop("PYTHONIOENCODING", None)
    items = [{**item, "id": "straße"} for item in FRAME["objects"]]
    Path(frame).write_text(json.dumps({**FRAME, "objects": items}))
    with started("estimate", frame, "--format", "table", env=plain) as process:
        out, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (0, b"")
    assert b"yaw ( deg)" in out
    assert b"+- m" in out
    assert rb"stra\xdfe" in out
    with started("estimate", "straße.json", env=plain) as process:
        _, errors = process.communicate(timeout=60)
    assert b"No such file" in errors


@pytest.mark.skipif(sys.platform == "win32", reason="a shell closes streams")
@pytest.mark.parametrize(
    ("shell", "status", "said"),
    [
        ("estimate frame.json >&-", 2, "error: standard output is closed; give a file, -o FILE"),
        ("estimate frame.json -o a.jsonl >&-", 0, "1 frame, 2 vehicles, 2 poses, a.jsonl"),
        ("estimate - <&-", 2, "error: standard input is closed; give a file"),
        ("estimate nothing.json 2>&-", 2, ""),
        ("help >&-", 0, ""),
        ("--version >&-", 0, ""),
    ],
)
def test_closed_streams_are_no_accident(shell, status, said, frame):
    command = f"{sys.executable} -m groundpose.cli {shell}"
    ended = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=60)
    assert ended.returncode == status, ended.stderr
    assert "Traceback" not in ended.stderr
    assert said in ended.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="no such signal there")
def test_sigterm_ends_as_ctrl_c_does(tmp_path):
    line = (json.dumps({**FRAME, "id": "first"}) + "\n").encode()
    out = tmp_path / "poses.jsonl"
    with started("estimate", "-", "-o", out, stdin=subprocess.PIPE) as process:
        process.stdin.write(line)
        process.stdin.flush()
        record = tmp_path / ".poses.jsonl.run"  # its second line is the first frame
        while not (record.exists() and record.read_bytes().count(b"\n") == 2):
            assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"interrupted; frames finished and written: 1" in errors
    assert json.loads(out.read_text())["id"] == "first"


def test_version_and_help_in_every_spelling():
    for spelling in ("-V", "--version"):
        assert run(spelling).stdout == f"groundpose {groundpose.__version__}\n"
    assert run("help").stdout == run("--help").stdout
    for words in (["estimate"], ["evaluate", "kitti"]):
        assert run("help", *words).stdout.splitlines()[5:] == run(*words, "--help").stdout.splitlines()[5:]
    assert run("help", "nothing").exit_code == 2


def test_what_was_meant_is_said(frame):
    assert "'estimate'" in run("estimat", frame).stderr
    assert "--network" in run("estimate", frame, "--netwrk", "a").stderr
    Path("boxes.json").write_text("[]")
    images = ("estimate", "street.png", "--boxes", "boxes.json", "--fov-deg", 60)
    for name, meant in (("int-8", "int8"), ("Default", "default"), ("float16", "float32")):
        assert f"{name}: No such file or directory; did you mean {meant}?" in one_line(
            run(*images, "--network", name)
        )
    said = one_line(run(*images, "--network", "mine"))
    assert "mine: No such file or directory; networks of the package: default, int8, float32" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--pitch-deg", 95), "--pitch-deg: expected degrees between -90 and 90, got 95"),
        (("--roll-deg", -200), "--roll-deg: expected degrees between -180 and 180, got -200"),
        (("--tilt-sigma-deg", -3), "--tilt-sigma-deg: expected degrees from 0 on, got -3"),
        (("--pitch-deg", "nan"), "--pitch-deg: expected degrees between -90 and 90, got nan"),
    ],
)
def test_degrees_are_answered_in_degrees(arguments, said, frame):
    assert one_line(run("estimate", frame, *arguments)).endswith(said)
    Path(frame).write_text(json.dumps({**FRAME, "pitch_deg": 95}))
    assert f"{frame}:1: pitch_deg: expected degrees between -90 and 90, got 95" in one_line(
        run("estimate", frame)
    )
