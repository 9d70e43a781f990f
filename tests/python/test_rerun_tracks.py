"""Tracks for the Rerun viewer: what is logged where and when, and that the viewer's own tools read it."""

import importlib.util
import subprocess
import sys
import types

import numpy as np
import pytest
from groundpose.formats.rerun_tracks import TrackLog
from test_rerun_log import Stand
from test_traffic import GATE, VIEW, drive, straight

COLUMNS = ("Boxes3D", "LineStrips3D", "Scalars")


class ColumnStand(Stand):
    """Stands in for the package: keeps columns too."""

    def __init__(self):
        super().__init__()
        self.sent, self.cleared = [], []
        for name in COLUMNS:
            made = types.SimpleNamespace(columns=lambda **columns: columns)
            if name == "LineStrips3D":
                made = type("LineStrips3D", (), {"columns": staticmethod(lambda **c: c)})
                made.__init__ = lambda self, strips, labels: setattr(self, "strips", strips)
            setattr(self, name, made)
        self.TimeColumn = lambda name, **values: (name, next(iter(values.values())).tolist())
        self.Clear = lambda recursive: "clear"
        stream = self.RecordingStream("")
        stream.send_columns = lambda path, when, columns: self.sent.append((path, dict(when), columns))
        stream.set_time = lambda name, **value: setattr(self, name, next(iter(value.values())))

    def _log(self, path, value, static=False):
        if value == "clear":
            self.cleared.append((path, self.frame, self.time))
        super()._log(path, value, static)

    def of(self, path):
        return [(when, columns) for sent, when, columns in self.sent if sent == path]


@pytest.fixture
def stand(monkeypatch, tmp_path):
    made = ColumnStand()
    monkeypatch.setitem(sys.modules, "rerun", made)
    with TrackLog(tmp_path / "a.rrd", VIEW, (GATE,)) as log:
        log.add(straight(7, 2.0, 10.0, 10.0), 0)
        log.add(straight(7, 2.0, 50.0, 10.0, begin=4.0, frames=5), 45)
        log.add(drive(8, [0.0], [[1.0, 2.0]]), 45)
        log.close()
    assert (tmp_path / "a.rrd").exists()
    return made


def test_boxes_stand_on_the_road_and_face_where_the_vehicle_drives(stand):
    (when, boxes), (_, more) = stand.of("world/vehicles/7")
    assert when["frame"] == list(range(40))
    assert when["time"] == pytest.approx(0.1 * np.arange(40))
    assert boxes["centers"][10] == pytest.approx([2.0, -0.75, 20.0])
    assert boxes["half_sizes"][0] == pytest.approx([0.9, 0.75, 2.15])
    assert boxes["quaternions"][0] == pytest.approx([0.0, 0.0, 0.0, 1.0])
    assert boxes["labels"][0] == "7 car 36 km/h"
    assert len(more["centers"]) == 5
    to_right = drive(9, [0.0, 0.1], [[0.0, 0.0], [1.0, 0.0]])
    assert to_right.heading[0] == pytest.approx(np.pi / 2)


def test_trails_and_speeds_over_time(stand):
    (_, first), (_, second) = stand.of("world/trails/7")
    lengths = [len(strip) for strip in first["strips"]]
    assert lengths[:3] == [1, 2, 3]
    assert max(lengths) == 30
    assert [len(strip) for strip in second["strips"]] == [30] * 5, "goes on over pieces"
    assert first["strips"][10][-1] == pytest.approx([2.0, -0.02, 20.0])
    assert stand.of("speed/7")[0][1]["scalars"] == pytest.approx(np.full(40, 36.0))


def test_vehicles_disappear_after_their_last_row(stand):
    assert [(path, frame) for path, frame, _ in stand.cleared if path == "world/vehicles/7"] == [
        ("world/vehicles/7", 40),
        ("world/vehicles/7", 45),
    ]
    assert stand.cleared[0][2] == pytest.approx(4.0)
    assert len(stand.logged["world/road"]) == 1


def test_the_command_needs_the_package(tmp_path, monkeypatch):
    from test_track_lanes import command

    monkeypatch.setitem(sys.modules, "rerun", None)
    result = command(tmp_path, "--rerun", tmp_path / "t.rrd")
    assert result.exit_code == 2
    assert "pip install 'groundpose[rerun]'" in result.output
    assert not (tmp_path / "t.csv").exists()


def test_the_viewer_reads_the_timeline(tmp_path):
    if importlib.util.find_spec("rerun") is None:
        pytest.skip("rerun-sdk is not installed (extra rerun)")
    from test_track_lanes import command

    path = tmp_path / "t.rrd"
    result = command(tmp_path, "--lanes", tmp_path / "lanes.yaml", "--rerun", path)
    assert result.exit_code == 0, result.output
    tool = [sys.executable, "-m", "rerun", "rrd"]
    done = subprocess.run([*tool, "verify", path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    stats = subprocess.run([*tool, "stats", path], capture_output=True, text=True, check=True).stdout
    for entity in ("world/vehicles/1", "world/trails/1", "speed/1", "world/road", "world/camera"):
        assert f"/{entity}:" in stats
    printed = subprocess.run(
        [*tool, "print", "-vvv", path], capture_output=True, text=True, check=True
    ).stdout
    assert "km/h" in printed
