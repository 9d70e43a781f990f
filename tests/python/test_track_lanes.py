"""`groundpose track --lanes`: tables against the truth of a drive, intervals, pictures, mistakes."""

import csv
import json
import math

import groundpose as gp
import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.formats.site import read_site
from groundpose.formats.tracks import COLUMNS
from groundpose.formats.traffic import CROSSING_COLUMNS, FLOW_COLUMNS
from groundpose.lab.drive.workers import Settings
from groundpose.lab.drive.write import write_drive
from PIL import Image
from test_tracks import line
from typer.testing import CliRunner

FRAMES = 100
LANES = """
lines:
  - {name: gate, ground: [[-14, 43], [10, 39]], directions: [nearer, away]}
  - {name: side street, ground: [[11, 17], [13, 27]], directions: [out, in]}
lanes:
  - {name: far lane, ground: [[-3.4, 68], [-10.2, 32]], width: 3.2}
  - {name: near lane, ground: [[-0.2, 68], [-5.5, 36]], width: 3.2}
  - {name: outbound, ground: [[2.9, 36], [7.6, 66]], width: 3.4}
"""


def run(*arguments):
    return CliRunner().invoke(app, [*map(str, arguments)])


def table(path):
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Poses of a drive's exact keypoints, the camera, the lanes, and what the labels say."""
    folder = tmp_path_factory.mktemp("mast")
    one = {"height": (8.0, 8.0), "pitch_deg": (-20.0, -20.0), "image_size": (1280, 720)}
    write_drive(
        folder / "drive",
        FRAMES,
        Settings(5, "test", images=None, rig="mast", fps=10.0, frames=FRAMES, **one),
        jobs=1,
    )
    labels = folder / "drive" / "labels.jsonl"
    frames = [json.loads(text) for text in labels.read_text().splitlines()]
    tilt = {name: frames[0]["_tilt"][name] for name in ("pitch_deg", "roll_deg", "camera_height")}
    (folder / "camera.json").write_text(json.dumps({**frames[0]["camera"], **tilt}))
    (folder / "lanes.yaml").write_text(LANES)
    said = ("--pitch-deg", tilt["pitch_deg"], "--roll-deg", tilt["roll_deg"], "--height", 8)
    result = run("estimate", labels, "-o", folder / "poses.jsonl", *said)
    assert result.exit_code == 0, result.output
    return folder, frames


def true_crossings(folder, frames):
    """(line, time, km/h) of labelled motions that come a metre past a line on both sides: no line of the
    counter."""
    from groundpose.formats.calibrations import read_calibration

    G = read_calibration(folder / "camera.json").R_camera_from_ground
    site, paths, found = read_site(folder / "lanes.yaml"), {}, []
    for frame in frames:
        for item in frame["objects"]:
            x, _, z = G.T @ item["truth"]["t"]
            paths.setdefault(item["id"], []).append((frame["_time"], x, z, 3.6 * item["_speed"]))
    for ruler in (*site.lines, *(lane.section for lane in site.lanes)):
        (ax, az), (bx, bz) = ruler.start, ruler.end
        length = math.hypot(bx - ax, bz - az)
        for path in map(np.array, paths.values()):
            beside = ((bx - ax) * (path[:, 2] - az) - (bz - az) * (path[:, 1] - ax)) / length
            for k in range(len(path) - 1):
                if (beside[k] > 0) == (beside[k + 1] > 0):
                    continue
                at = path[k] + beside[k] / (beside[k] - beside[k + 1]) * (path[k + 1] - path[k])
                along = ((bx - ax) * (at[1] - ax) + (bz - az) * (at[2] - az)) / length
                both = np.abs(beside[: k + 1]).max() > 1.0 and np.abs(beside[k + 1 :]).max() > 1.0
                if 0.0 <= along <= length and both:
                    found.append((ruler.name, at[0], at[3]))
    return sorted(found)


def test_crossings_are_those_of_the_drive(drive, tmp_path):
    folder, frames = drive
    counts, flows = tmp_path / "counts.csv", tmp_path / "flows.csv"
    result = run(
        *("track", folder / "poses.jsonl", "--camera", folder / "camera.json", "--fps", 10),
        *("-o", tmp_path / "tracks.csv", "--lanes", folder / "lanes.yaml", "--counts", counts),
        *("--summary", flows, "--every", 4),
    )
    assert result.exit_code == 0, result.output
    found, truth = table(counts), true_crossings(folder, frames)
    assert list(found[0]) == list(CROSSING_COLUMNS)
    assert list(table(tmp_path / "tracks.csv")[0]) == list(COLUMNS), "not touched by lanes"
    assert len(truth) > 10
    assert {name for name, _, _ in truth} == {"gate", "far lane", "near lane", "outbound", "side street"}
    times, speeds = [], []
    for name in {name for name, _, _ in truth}:
        mine = [row for row in found if row["line"] == name]
        theirs = [row for row in truth if row[0] == name]
        assert len(mine) == len(theirs), name
        for row, (_, time, speed) in zip(mine, theirs, strict=True):
            assert abs(float(row["time"]) - time) < max(0.2, 3.0 * float(row["time_sigma"]))
            times.append((float(row["time"]) - time) / float(row["time_sigma"]))
            speeds.append((float(row["speed_kmh"]) - speed) / float(row["speed_sigma_kmh"]))
    assert np.mean(np.abs(times) < 2.0) > 0.85, "sigmas are true"
    assert np.mean(np.abs(speeds) < 2.0) > 0.85
    assert [float(row["time"]) for row in found] == sorted(float(row["time"]) for row in found)

    rows = table(flows)
    assert list(rows[0]) == list(FLOW_COLUMNS)
    assert sorted({(float(row["begin"]), float(row["end"])) for row in rows}) == [
        (0.0, 4.0),
        (4.0, 8.0),
        (8.0, 9.9),
    ]
    for row in rows:
        same = [
            other
            for other in found
            if all(other[key] == row[key] for key in ("line", "lane", "direction"))
            and float(row["begin"]) <= float(other["time"]) < float(row["end"])
        ]
        assert int(row["count"]) == len(same)
        assert sum(int(row[name]) for name in ("car", "van_bus", "pickup", "box_truck")) == len(same)
        passed = float(row["end"]) - float(row["begin"])
        assert float(row["flow_per_hour"]) == pytest.approx(3600.0 * len(same) / passed, abs=1e-3)
        if same:
            mean = np.mean([float(other["speed_kmh"]) for other in same])
            assert float(row["mean_speed_kmh"]) == pytest.approx(mean, abs=1e-4)
    assert sum(int(row["count"]) for row in rows) == len(found)


def test_live_counts_and_pictures(drive, tmp_path):
    folder, _ = drive
    counts, drawn = tmp_path / "counts.csv", tmp_path / "pictures" / "{id}.png"
    lines = (folder / "poses.jsonl").read_text().splitlines()[:40]
    (tmp_path / "poses.jsonl").write_text("\n".join(lines))
    result = run(
        *("track", tmp_path / "poses.jsonl", "--camera", folder / "camera.json", "--fps", 10, "--live"),
        *("-o", tmp_path / "tracks.jsonl", "--lanes", folder / "lanes.yaml", "--counts", counts),
        *("--draw", drawn, "--birds-eye", tmp_path / "map.png"),
    )
    assert result.exit_code == 0, result.output
    assert {row["line"] for row in table(counts)} >= {"gate", "outbound"}
    with Image.open(tmp_path / "pictures" / "000039.png") as picture:
        colours = {colour for _, colour in picture.convert("RGB").getcolors(1 << 24)}
    assert (0xF0, 0xE4, 0x42) in colours, "the line"
    assert (tmp_path / "map.png").stat().st_size > 20_000


def command(tmp_path, *more, lanes="lines: [{name: a, ground: [[-5, 22], [5, 22]]}]"):
    camera, poses, file = (tmp_path / name for name in ("camera.json", "poses.jsonl", "lanes.yaml"))
    camera.write_text(json.dumps({"fx": 1000, "fy": 1000, "cx": 640, "cy": 360, "image_size": [1280, 720]}))
    poses.write_text("\n".join(line(k, [[0.0, 20.0 + k]], [0.0], time=0.1 * k) for k in range(8)))
    file.write_text(lanes)
    return run("track", poses, "--camera", camera, "-o", tmp_path / "t.csv", *more)


def test_world_adds_the_place_to_crossings(tmp_path):
    text = "map: {east: 100, north: 200, heading_deg: 90}\nlines: [{name: a, map: [[122, 205], [122, 195]]}]"
    counts = tmp_path / "counts.csv"
    result = command(tmp_path, "--world", tmp_path / "lanes.yaml", "--counts", counts, lanes=text)
    assert result.exit_code == 0, result.output
    (row,) = table(counts)
    assert list(row)[-2:] == ["map_x", "map_y"]
    assert float(row["map_x"]) == pytest.approx(122.0, abs=1e-5)
    assert float(row["time"]) == pytest.approx(0.2, abs=0.05)
    assert float(row["speed_kmh"]) == pytest.approx(36.0, abs=3.0)
    assert row["headway"] == ""


def test_no_vehicle_gives_whole_tables(tmp_path):
    counts, flows = tmp_path / "counts.csv", tmp_path / "flows.csv"
    empty = tmp_path / "empty.jsonl"
    empty.write_text("\n".join(line(k, [], [], time=0.1 * k) for k in range(3)))
    command(tmp_path)
    given = ("--lanes", tmp_path / "lanes.yaml", "--counts", counts, "--summary", flows)
    result = run("track", empty, "--camera", tmp_path / "camera.json", "-o", tmp_path / "t.csv", *given)
    assert result.exit_code == 0, result.output
    assert table(counts) == []
    assert [(row["count"], row["flow_per_hour"], row["end"]) for row in table(flows)] == [
        ("0", "0.0", "0.2")
    ] * 2


MISTAKES = {
    ("--counts", "c.csv"): "--counts: expected lines or lanes, of --lanes or --world, got none",
    ("--summary", "c.csv"): "--summary: expected lines or lanes",
    ("--every", "5"): "--every: expected --summary",
    ("--lanes", "lanes.yaml", "--every", "0", "--summary", "c.csv"): "--every: expected seconds above 0",
    ("--world", "lanes.yaml"): "expected map or geographic, got none of them",
    (
        "--lanes",
        "lanes.yaml",
        "--counts",
        "c.csv",
        "--camera-motion",
        "unknown",
    ): "--lanes: expected a camera",
    ("--lanes", "lanes.yaml", "--counts", "t.csv"): "t.csv: is given for two outputs",
    ("--lanes", "lanes.yaml", "--counts", "lanes.yaml"): "lanes.yaml: is an input",
    ("--lanes", "missing.yaml", "--counts", "c.csv"): "missing.yaml: No such file",
}


@pytest.mark.parametrize("more", MISTAKES)
def test_mistakes_of_the_command(more, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = command(tmp_path, *more)
    assert result.exit_code == 2, result.output
    assert MISTAKES[more] in " ".join(result.output.split())
    assert not (tmp_path / "t.csv").exists()
    assert "lines:" in (tmp_path / "lanes.yaml").read_text()


def test_pixels_need_a_height_and_a_camera_that_stands(tmp_path):
    text = "lines: [{name: a, pixels: [[300, 500], [900, 500]]}]"
    more = ("--lanes", tmp_path / "lanes.yaml", "--counts", tmp_path / "c.csv")
    result = command(tmp_path, *more, lanes=text)
    assert result.exit_code == 2
    assert "pixels: expected a camera that stands, whose height is known" in " ".join(result.output.split())
    assert command(tmp_path, *more, "--height", 1.5, lanes=text).exit_code == 0


def test_memory_stays_flat(tmp_path):
    """A parked vehicle and one that comes by every five seconds: what is remembered is bounded."""
    from groundpose.cli.track_input import Followed
    from groundpose.cli.track_job import TrackJob
    from groundpose.cli.track_output import OpenFrames, TrackRows
    from groundpose.cli.track_traffic import TrafficTables
    from groundpose.traffic import CrossingCounter, Line
    from test_tracks import VIEW, seen

    frames, counter = OpenFrames(), CrossingCounter([Line("gate", [-5.0, 25.0], [5.0, 25.0])])
    most = [0, 0, 0]

    class Watch:
        def add(self, tracks, complete):
            now = len(frames.names), len(counter._followed), len(counter._waiting)
            most[:] = map(max, most, now)

        def close(self):
            pass

    def given():
        for k in range(3000):
            places = [[6.0, 30.0], [0.0, 20.0 + 0.6 * (k % 50)]]
            cars = seen(places if k % 50 < 30 else places[:1], [0.0] * (2 if k % 50 < 30 else 1))
            yield Followed(f"frame {k}", k, 0.1 * k, cars)

    with (tmp_path / "rows").open("w") as rows, (tmp_path / "counts").open("w") as counts:
        tables = TrafficTables(counter, frames, None, counts, None, None)
        text = TrackRows(rows, "csv", frames, VIEW, None)
        assert TrackJob(gp.Tracker(VIEW), [text, tables, Watch()], frames).run(given(), rows) == 0
    assert most[0] <= 400 + 256
    assert most[1] <= 14, "those of the frames that are open"
    assert most[2] <= 14
    assert len(table(tmp_path / "counts")) == 60
    named = [int(row["frame"]) for row in table(tmp_path / "rows") if row["id"] == "1"]
    assert named == list(range(3000))
