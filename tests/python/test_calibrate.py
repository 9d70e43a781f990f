"""Cameras calibrated by traffic: the plane and how sure it is, the focal length, the profile, the command."""

import json
import math

import groundpose as gp
import numpy as np
import pytest
from groundpose.camera_profile import CameraProfile, is_profile
from groundpose.cli.main import app
from groundpose.formats.calibrations import read_calibration
from groundpose.self_calibration.calibrate import calibrate_contacts
from groundpose.self_calibration.contacts import Contacts
from groundpose.self_calibration.figure import draw_calibration
from groundpose.self_calibration.linking import linked
from groundpose.self_calibration.plane import ROUGHNESS, SLOPE, Known, fit_plane, normal
from groundpose.vehicles import shape_model
from typer.testing import CliRunner

CAMERA = gp.Camera(1300.0, 1300.0, 960.0, 540.0, image_size=(1920, 1080))
PITCH, ROLL, HEIGHT = math.radians(-22.0), math.radians(2.0), 7.3
OWN, CLASS, DISTANCE = 0.05, 0.08, 0.04
NAMES = ("car", "van_bus")


def contacts(seed=0, vehicles=60, sightings=4, noise=1.0, near=12.0, far=60.0):
    """Contacts on a plane, as poses would have them, and the true log sizes of the classes."""
    rng = np.random.default_rng(seed)
    vehicle = np.repeat(np.arange(vehicles), sightings)
    kind = rng.integers(0, len(NAMES), vehicles)
    scales = noise * CLASS * rng.standard_normal(len(NAMES))
    size = scales[kind] + noise * OWN * rng.standard_normal(vehicles)
    shared, fresh = rng.standard_normal(vehicles), rng.standard_normal(len(vehicle))
    error = noise * DISTANCE * math.sqrt(0.5) * (shared[vehicle] + fresh)
    z = rng.uniform(near, far, len(vehicle))
    road = noise * np.hypot(ROUGHNESS, SLOPE * z) * rng.standard_normal(len(vehicle))
    ground = np.stack([rng.uniform(-8, 8, len(vehicle)), HEIGHT + road, z], axis=1)
    true = ground @ gp.View(CAMERA, PITCH, ROLL).R_camera_from_ground.T
    points = true * np.exp(error - size[vehicle])[:, None]
    away = points / np.linalg.norm(points, axis=1, keepdims=True)
    reach = np.linalg.norm(points, axis=1)[:, None, None]
    covariance = (DISTANCE * reach) ** 2 * away[:, :, None] * away[:, None, :] + 1e-6 * np.eye(3)
    return Contacts(
        points, covariance, kind[vehicle], vehicle, NAMES, np.full(2, CLASS), np.full(2, OWN)
    ), scales


def test_exact_contacts_give_the_plane():
    plane = fit_plane(contacts(noise=0.0)[0], (PITCH + 0.3, 0.0), Known())
    np.testing.assert_allclose(plane.mean[:2], (PITCH, ROLL), atol=2e-5)
    assert math.exp(plane.mean[2]) == pytest.approx(HEIGHT, rel=2e-3)


def test_stated_deviations_are_true():
    z = []
    for seed in range(60):
        plane = fit_plane(contacts(seed, vehicles=40)[0], (PITCH, ROLL), Known())
        z.append((plane.mean[:3] - (PITCH, ROLL, math.log(HEIGHT))) / plane.sigmas[:3])
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert (rms > 0.75).all()
    assert (rms < 1.15).all()


def test_sizes_of_classes_are_in_the_deviation_of_the_height_however_many_vehicles():
    plane = fit_plane(contacts(3, vehicles=800)[0], (PITCH, ROLL), Known())
    assert plane.sigmas[2] > 0.6 * CLASS
    assert plane.sigmas[0] < math.radians(0.15)


def test_wrong_poses_weigh_less():
    given = contacts(5, vehicles=80)[0]
    rng = np.random.default_rng(6)
    wrong = rng.random(80) < 0.15
    points = np.where(wrong[given.vehicles][:, None], rng.uniform(1.6, 2.5) * given.points, given.points)
    fooled = Contacts(points, *(getattr(given, n) for n in list(given.__dataclass_fields__)[1:]))
    plane = fit_plane(fooled, (PITCH, ROLL), Known())
    assert abs(plane.mean[0] - PITCH) < 3.0 * plane.sigmas[0]
    assert abs(plane.mean[2] - math.log(HEIGHT)) < 3.0 * plane.sigmas[2]
    assert plane.weights[wrong[given.vehicles]].mean() < 0.5


def test_a_known_height_gives_the_sizes():
    given, scales = contacts(8, vehicles=150)
    plane = fit_plane(given, (PITCH, ROLL), Known(height=(HEIGHT, 0.01)))
    assert (plane.sigmas[3:] < 0.025).all()
    np.testing.assert_array_less(np.abs(plane.mean[3:] - scales), 3.0 * plane.sigmas[3:])


def test_more_traffic_says_more():
    found = calibrate_contacts(CAMERA, contacts(9, vehicles=200)[0], (PITCH, ROLL))
    settled = found.settling
    assert (np.diff(settled.vehicles) > 0).all()
    assert settled.sigma[-1, 0] < 0.5 * settled.sigma[0, 0]
    assert found.profile.remarks == ()


def test_one_distance_is_said():
    given = contacts(10, vehicles=30, near=20.0, far=21.0)[0]
    found = calibrate_contacts(CAMERA, given, (PITCH, ROLL))
    assert any("told apart" in said for said in found.profile.remarks)
    assert found.profile.pitch_sigma > math.radians(1.0)


def test_too_few_vehicles_are_refused():
    with pytest.raises(gp.InputError, match="at least 8"):
        calibrate_contacts(CAMERA, contacts(vehicles=5)[0], (PITCH, ROLL))


def traffic(seed=0, vehicles=60, noise=0.006):
    """Sightings of vehicles whose keypoints are off by a fraction of the box."""
    rng = np.random.default_rng(seed)
    view = gp.View(CAMERA, PITCH, ROLL, HEIGHT)
    rows = {name: [] for name in ("keypoints", "scores", "boxes", "models", "vehicles")}
    while len(set(rows["vehicles"])) < vehicles:
        model = shape_model(("car", "van_bus", "pickup")[int(rng.integers(3))])
        size, x, yaw = math.exp(0.03 * rng.standard_normal()), rng.uniform(-7, 7), rng.uniform(-0.6, 0.6)
        vehicle, z0 = len(set(rows["vehicles"])), rng.uniform(12, 40)
        R = view.R_camera_from_ground @ rotation(yaw + math.pi * rng.integers(2))
        for z in (z0, z0 + rng.uniform(3, 15)):
            t = view.R_camera_from_ground @ [x, HEIGHT, z]
            pixels = CAMERA.project(size * model.keypoints_3d @ R.T + t)
            box = CAMERA.project(size * box_corners(model) @ R.T + t)
            box = np.concatenate([box.min(axis=0), box.max(axis=0)])
            if (pixels < 0).any() or (pixels > [1919, 1079]).any():
                continue
            longer = max(box[2] - box[0], box[3] - box[1])
            rows["keypoints"].append(pixels + noise * longer * rng.standard_normal(pixels.shape))
            rows["scores"].append(np.ones(len(pixels)))
            rows["boxes"].append(box)
            rows["models"].append(model)
            rows["vehicles"].append(vehicle)
    return gp.Sightings(
        CAMERA, tuple(rows["keypoints"]), tuple(rows["scores"]), np.array(rows["boxes"]),
        tuple(rows["models"]), np.array(rows["vehicles"]), np.arange(len(rows["boxes"]), dtype=float),
    )  # fmt: skip


def rotation(yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def box_corners(model):
    low, high = model.bbox_3d
    return np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
                     for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # fmt: skip


@pytest.fixture(scope="module")
def sightings():
    return traffic()


def test_keypoints_alone_give_tilt_and_height(sightings):
    profile = gp.calibrate(sightings).profile
    assert abs(profile.view.pitch - PITCH) < 3.0 * profile.pitch_sigma
    assert abs(profile.view.roll - ROLL) < 3.0 * profile.roll_sigma
    assert profile.view.height == pytest.approx(HEIGHT, abs=3.0 * profile.height_sigma)
    assert profile.pitch_sigma < math.radians(0.6)
    assert profile.vehicles == 60


def test_threads_change_nothing(sightings):
    one, more = (gp.calibrate(sightings, threads=n).profile for n in (1, 3))
    assert one.view == more.view
    assert (one.covariance == more.covariance).all()


def test_a_guessed_focal_length_is_found(sightings):
    guess = gp.Camera(1.15 * 1300.0, 1.15 * 1300.0, 960.0, 540.0, image_size=(1920, 1080))
    found = gp.calibrate(sightings.seen_by(guess), focal=True)
    profile = found.profile
    assert profile.view.camera.fx == pytest.approx(1300.0, rel=0.03)
    assert abs(math.log(profile.view.camera.fx / 1300.0)) < 3.0 * profile.focal_sigma
    assert abs(profile.view.pitch - PITCH) < 3.0 * profile.pitch_sigma


def test_few_vehicles_do_not_tell_the_focal_length(sightings):
    profile = gp.calibrate(sightings[sightings.vehicles < 15], focal=True).profile
    assert profile.focal_sigma == 0.0
    assert any("focal length" in said for said in profile.remarks)


def test_profiles_are_files_of_cameras(sightings, tmp_path):
    profile = gp.calibrate(sightings, source="here").profile
    profile.save(tmp_path / "camera.json")
    assert is_profile(tmp_path / "camera.json")
    again = CameraProfile.load(tmp_path / "camera.json")
    np.testing.assert_allclose(again.covariance, profile.covariance)
    assert (again.class_scales, again.vehicles, again.source) == (profile.class_scales, 60, "here")
    plain = read_calibration(tmp_path / "camera.json")
    assert plain.pitch == pytest.approx(profile.view.pitch)
    assert plain.height == pytest.approx(profile.view.height)
    priors = again.priors()
    assert priors.pitch_sigma == pytest.approx(profile.pitch_sigma)
    state = gp.CameraState(again.view, priors)
    assert state.height == pytest.approx(profile.view.height)


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content.pop("_profile"),
        lambda content: content["_profile"].update(version=9),
        lambda content: content["_profile"].update(covariance=[[1]]),
        lambda content: content["_profile"].update(class_scales={"car": 3}),
        lambda content: content.pop("camera_height"),
        lambda content: content["camera"].update(fx=-1),
    ],
)
def test_damaged_profiles_are_refused(damage, sightings, tmp_path):
    gp.calibrate(sightings).profile.save(tmp_path / "camera.json")
    content = json.loads((tmp_path / "camera.json").read_text())
    damage(content)
    (tmp_path / "camera.json").write_text(json.dumps(content))
    with pytest.raises(gp.InputError):
        CameraProfile.load(tmp_path / "camera.json")


def test_wrong_arguments():
    with pytest.raises(TypeError):
        gp.calibrate([])
    with pytest.raises(gp.InputError, match="height"):
        CameraProfile(gp.View(CAMERA), np.eye(3))
    with pytest.raises(gp.InputError, match="covariance"):
        CameraProfile(gp.View(CAMERA, height=3.0), -np.eye(3))


def test_ids_or_overlapping_boxes_link_sightings():
    boxes = np.array(
        [[0, 0, 10, 10], [50, 0, 60, 10], [1, 0, 11, 10], [90, 0, 95, 10], [52, 0, 62, 10]], float
    )
    assert linked([0, 0, 1, 1, 1], ["a", "b", "a", "c", "b"], boxes).tolist() == [0, 1, 0, 2, 1]
    assert linked([0, 0, 1, 1, 1], [0, 1, 0, 1, 2], boxes).tolist() == [0, 1, 0, 2, 1]
    assert linked([0, 0, 1, 1, 1], [0, 1, 0, 1, 2], boxes, numbered=True).tolist() == [0, 1, 0, 1, 2]
    assert linked([0, 2], [0, 0], boxes[[0, 2]]).tolist() == [0, 1]


def test_normals_point_down():
    np.testing.assert_allclose(normal(0.0, 0.0), [0.0, 1.0, 0.0])


def test_the_picture(tmp_path):
    draw_calibration(calibrate_contacts(CAMERA, contacts()[0], (PITCH, ROLL)), tmp_path / "settled.png")
    assert (tmp_path / "settled.png").stat().st_size > 10_000


def lines(sightings, folder):
    """A file of frames, one sighting each, and a line that is none."""
    path = folder / "frames.jsonl"
    camera = {"fx": 1300, "fy": 1300, "cx": 960, "cy": 540, "image_size": [1920, 1080]}
    names = ("car", "van_bus", "pickup")
    with path.open("w") as file:
        for i in range(len(sightings)):
            item = {
                "id": int(sightings.vehicles[i]), "model": sightings.models[i].name,
                "keypoints_2d": sightings.keypoints_2d[i].tolist(), "bbox": sightings.bboxes[i].tolist(),
            }  # fmt: skip
            frame = {"camera": camera, "models": {n: f"bundled:{n}" for n in names}, "objects": [item]}
            file.write(json.dumps(frame) + "\n")
        file.write("{nonsense}\n")
    return path


def run(*arguments):
    return CliRunner().invoke(app, list(map(str, arguments)))


def test_the_command_and_what_reads_its_profile(sightings, tmp_path):
    path, out = lines(sightings, tmp_path), tmp_path / "camera.json"
    result = run("calibrate", path, "-o", out, "--draw", tmp_path / "settled.png")
    assert result.exit_code == 0, result.output
    assert "60 vehicles" in result.output
    assert "frames.jsonl" in result.stderr
    assert (tmp_path / "settled.png").exists()
    profile = CameraProfile.load(out)
    assert abs(profile.view.pitch - PITCH) < 3.0 * profile.pitch_sigma
    poses = tmp_path / "poses.jsonl"
    result = run("estimate", path, "--profile", out, "-o", poses)
    assert result.exit_code == 1  # one line is none
    first = json.loads(poses.read_text().splitlines()[0])
    assert first["camera_height"] == pytest.approx(profile.view.height, rel=0.2)
    result = run("calibrate", poses, "--calib", out, "-o", tmp_path / "again.json")
    assert result.exit_code == 0, result.output
    again = CameraProfile.load(tmp_path / "again.json")
    assert again.view.pitch == pytest.approx(profile.view.pitch, abs=3.0 * profile.pitch_sigma)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["-o", "frames.jsonl"], "is the input"),
        (["--height", "0"], "--height"),
        (["--region", "mars"], "region"),
        (["--fov-deg", "200"], "--fov-deg"),
    ],
)
def test_mistakes_are_one_line(arguments, says, sightings, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = lines(sightings[:3], tmp_path)
    result = run("calibrate", path, *arguments)
    assert result.exit_code == 2
    assert says in result.stderr
    assert "Traceback" not in result.output


def test_a_profile_of_another_camera_is_refused(sightings, tmp_path):
    path, out = lines(sightings, tmp_path), tmp_path / "camera.json"
    profile = gp.calibrate(sightings).profile
    other = gp.Camera(1300.0, 1300.0, 960.0, 540.0, image_size=(1280, 720))
    CameraProfile(gp.View(other, PITCH, ROLL, HEIGHT), profile.covariance).save(out)
    result = run("estimate", path, "--profile", out, "-o", tmp_path / "poses.jsonl")
    assert result.exit_code == 2
    assert "--profile" in result.stderr
    result = run("estimate", path, "--profile", out, "--height", "3")
    assert result.exit_code == 2
    assert "leave out" in result.stderr
