"""`groundpose track` of a camera or a stream: the newest frame, its own times, what was dropped."""

import csv
import http.server
import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
import stand_in
from groundpose._live import is_live, name_of
from groundpose.cli.main import app
from groundpose.keypoints.live import LiveFrames
from test_cli_images import BOX, CALIBRATION, SIZE, car_places
from typer.testing import CliRunner

av = pytest.importorskip("av")
FRAMES, FPS = 20, 10
NO_PIPES = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")


def packets():
    """An MPEG transport stream of grey pictures, in pieces of one frame each."""
    made, ends = io.BytesIO(), []
    with av.open(made, "w", format="mpegts") as container:
        stream = container.add_stream("mpeg2video", rate=FPS)
        stream.width, stream.height, stream.pix_fmt, stream.gop_size = *SIZE, "yuv420p", 1
        stream.max_b_frames = 0
        for k in range(FRAMES):
            grey = np.full((SIZE[1], SIZE[0], 3), 60 + 4 * k, np.uint8)
            frame = av.VideoFrame.from_ndarray(grey, format="rgb24")
            container.mux(stream.encode(frame))
            ends.append(made.tell())
        container.mux(stream.encode())
    content = made.getvalue()
    ends[-1] = len(content)
    return [content[a:b] for a, b in zip([0, *ends], ends, strict=False)]


def feed(write, pause, endless=False):
    """Give the pieces one after the other."""
    try:
        pieces = packets()
        for piece in pieces:
            write(piece)
            time.sleep(pause)
        while endless:
            time.sleep(pause)
    except OSError:
        pass  # nobody listens any more


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "camera.fifo"
    os.mkfifo(path)
    return path


def writer(path, pause, endless=False):
    def work():
        with path.open("wb", buffering=0) as stream:
            feed(stream.write, pause, endless)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def test_cameras_and_addresses_are_told_from_files(tmp_path):
    for name in ("rtsp://10.0.0.7/road", "http://camera/video.ts", "udp://0.0.0.0:5000", "camera:0"):
        assert is_live(Path(name)), name
        assert name_of(Path(name)) == name
    (tmp_path / "film.mp4").write_bytes(b"")
    for name in (tmp_path / "film.mp4", tmp_path / "nothing.mp4", tmp_path, Path("poses.jsonl")):
        assert not is_live(name), name


@NO_PIPES
def test_frames_come_as_they_are_shown_and_old_ones_are_dropped(pipe):
    writer(pipe, 0.02)
    live, times, numbers = LiveFrames(pipe), [], []
    for frame in live:
        assert frame.image.shape == (SIZE[1], SIZE[0], 3)
        times.append(frame.time)
        numbers.append(frame.number)
        time.sleep(0.1)
    assert live.read == FRAMES
    assert live.dropped == FRAMES - len(numbers) > 0
    assert numbers[-1] == FRAMES - 1, "the newest frame is never dropped"
    np.testing.assert_allclose(times, (np.array(numbers) - numbers[0]) / FPS, atol=1e-3)


@NO_PIPES
def test_what_is_no_stream_is_an_error(pipe):
    threading.Thread(target=lambda: pipe.write_bytes(b"no pictures" * 500), daemon=True).start()
    (found,) = LiveFrames(pipe)
    assert isinstance(found, gp.InputError)
    assert "frames of a camera or a stream" in str(found)


@pytest.fixture
def street(tmp_path):
    network = stand_in.write(tmp_path / "car.onnx", 0, car_places())
    (tmp_path / "boxes").mkdir()
    for k in range(FRAMES):
        (tmp_path / "boxes" / f"{k:06d}.json").write_text(json.dumps([BOX.tolist()]))
    (tmp_path / "camera.json").write_text(json.dumps({**CALIBRATION, "camera_height": 1.6}))
    return [
        *("--boxes", tmp_path / "boxes", "--camera", tmp_path / "camera.json"),
        *("--network", network, "-o", tmp_path / "tracks.csv"),
    ]


def rows_of(path):
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_stream_from_the_network_is_followed(tmp_path, street):
    class Camera(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "video/mp2t")
            self.send_header("Content-Length", str(sum(map(len, packets()))))
            self.end_headers()
            feed(self.wfile.write, 0.2)

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Camera) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/road.ts"
        result = CliRunner().invoke(app, ["track", address, *map(str, street), "--live"])
        server.shutdown()
    assert result.exit_code == 0, result.output
    rows = rows_of(tmp_path / "tracks.csv")
    times = [float(row["time"]) for row in rows]
    assert len(rows) >= 3
    assert times == sorted(times)
    np.testing.assert_allclose(np.array(times) * FPS, np.round(np.array(times) * FPS), atol=1e-2)


def test_numbers_of_frames_say_nothing_of_a_stream(street):
    result = CliRunner().invoke(app, ["track", "http://127.0.0.1:9/x.ts", *map(str, street), "--fps", "10"])
    assert result.exit_code == 2
    assert "--fps" in result.output


def test_an_address_needs_boxes(tmp_path, street):
    result = CliRunner().invoke(app, ["track", "rtsp://10.0.0.7/road", *map(str, street[2:4])])
    assert result.exit_code == 2
    assert "--detector" in result.output


@NO_PIPES
def test_ctrl_c_ends_it_and_leaves_whole_files(tmp_path, pipe, street):
    command = [sys.executable, "-m", "groundpose.cli", "track", pipe, *street, "--live"]
    running = subprocess.Popen([*map(str, command)], stderr=subprocess.PIPE, text=True)
    feeder = writer(pipe, 0.2, endless=True)
    time.sleep(8.0)
    assert feeder.is_alive()
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130, said
    assert "interrupted" in said
    assert len(rows_of(tmp_path / "tracks.csv")) >= 1
    assert not list(tmp_path.glob("tracks.csv.*"))
