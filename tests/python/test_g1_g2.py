"""G1 and G2 on a small scale: vehicles, errors, contenders, runner, page, command line."""

import json
from pathlib import Path

import groundpose as gp
import groundpose.cli.main as cli
import numpy as np
import pytest
from conftest import CAMERA, project
from groundpose.lab.contenders.contender import Answers
from groundpose.lab.contenders.objects import HRE_VEHICLE
from groundpose.lab.contenders.use import CUT, LOWEST_SCORE
from groundpose.lab.data import rotation_about_y
from groundpose.lab.evaluate.experiments import compare
from groundpose.lab.evaluate.experiments.store import Store
from groundpose.lab.evaluate.simulated import errors, objects, page, run
from groundpose.lab.evaluate.simulated import keypoint_noise as kn
from groundpose.lab.metrics import RELATIVE_THRESHOLD
from groundpose.lab.timing import Clock
from typer.testing import CliRunner

OURS = ["ours, default", "ours, never refusing", "ours, UP2P, never refusing"]
FAST = [*OURS, "ours, default, scores as weights", "RNSC-P1P+HRE", "RNSC-P3P+HRE"]
RNG = np.random.default_rng(0)
HALF = RNG.uniform([0.5, -1.6, -2.2], [0.9, 0.0, 2.2], (7, 3))
BODY = np.concatenate([HALF, HALF * [-1.0, 1.0, 1.0]])
MODES = 3
BASIS = np.linalg.qr(RNG.normal(size=(BODY.size, MODES)))[0].T.reshape(MODES, *BODY.shape)
DEVIATION = np.array([0.4, 0.2, 0.1])


def model(class_name: str) -> gp.ShapeModel:
    stretch = 1.0 if class_name == "car" else 1.3
    box = stretch * np.array([[-0.9, -1.6, -2.2], [0.9, 0.0, 2.2]])
    return gp.ShapeModel(stretch * BODY, box, BASIS, DEVIATION**2, name=class_name)


def vehicles(count: int, seed: int) -> objects.Vehicles:
    """Cars and vans on flat ground in front of a camera with a tilt that nobody tells."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(count):
        class_name = ("car", "van_bus")[k % 3 == 2]
        shape = model(class_name).keypoints(rng.normal(size=MODES) * DEVIATION)
        view = gp.View(CAMERA, pitch=rng.normal(0.0, 0.02), roll=rng.normal(0.0, 0.01))
        depth = rng.uniform(8.0, 40.0)
        R = view.R_camera_from_ground @ rotation_about_y(rng.uniform(-np.pi, np.pi))
        t = view.R_camera_from_ground @ [depth * rng.uniform(-0.3, 0.3), 1.5, depth]
        pixels = project(view, R, t, shape)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        states = rng.integers(1, 3, len(shape)).astype(np.uint8)
        box_3d = np.stack([shape.min(axis=0), shape.max(axis=0)])
        bbox, cut = np.concatenate([low, high]), 0.1 * (k % 5 == 4)
        rows.append(objects.Row(pixels, states, shape, bbox, class_name, box_3d, R, t, k % 3, cut))
    return objects.from_rows(CAMERA, rows)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small run of both experiments."""
    path = tmp_path_factory.mktemp("simulated")
    for name in run.EXPERIMENTS:
        run.run(name, 24, 0, path, FAST, source=vehicles, model=model)
    return path


def perfect(truth: objects.Vehicles, scale: float = 1.0) -> errors.Errors:
    """Errors of the truth, all lengths of it scaled."""
    answers = Answers(truth.R, scale * truth.t, np.ones(len(truth)))
    return errors.Errors.of(truth, answers, scale * truth.seen.keypoints_3d)


def test_rows_are_padded_to_one_width() -> None:
    some = vehicles(5, 0)
    assert some.seen.keypoints_2d.shape == (5, objects.WIDTH, 2)
    own = np.isfinite(some.seen.keypoints_3d[..., 0])
    assert own.sum(axis=1).tolist() == [len(BODY)] * 5
    assert (some.seen.state[~own] == kn.OUTSIDE).all()
    assert [len(m.keypoints_3d) for m in some.known_models] == [len(BODY)] * 5
    assert some.view.pitch == 0.0
    assert some.tilt_error_deg.max() > 0.5


def test_the_truth_has_no_error_and_a_scaled_truth_no_error_of_shape() -> None:
    some = vehicles(40, 1)
    for scale in (1.0, 1.5):
        e = perfect(some, scale)
        assert e.e_v_cm.max() < 1e-9
        assert e.posed_e_v_cm.max() < 1e-9
        assert e.e_r_deg.max() < 1e-5
        np.testing.assert_allclose(e.e_t_percent, 100.0 * (scale - 1.0) / scale, atol=1e-9)


def test_e_v_is_the_mean_distance_in_cm_after_scaling() -> None:
    X = np.array([[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [np.nan] * 3]])
    t = np.array([[0.0, 0.0, 10.0]])
    moved = X + np.array([0.0, 0.0, 0.3])
    np.testing.assert_allclose(errors.vertex_error_cm(X, moved, t, t), 30.0)
    np.testing.assert_allclose(errors.vertex_error_cm(X, 2.0 * moved, t, 2.0 * t), 30.0)
    np.testing.assert_allclose(errors.vertex_error_cm(X, moved, t, np.full((1, 3), np.nan)), 150.0)


def test_silence_is_not_rewarded() -> None:
    some = vehicles(30, 1)
    R, t, shapes = (np.full(shape, np.nan) for shape in ((30, 3, 3), (30, 3), (30, objects.WIDTH, 3)))
    nothing = errors.Errors.of(some, Answers(R, t, np.ones(30)), shapes)
    numbers = errors.summary(some, nothing, shapes=True)
    assert numbers["answered"] == 0.0
    assert numbers["failures"] == 1.0
    assert (numbers["mean_e_r_deg"], numbers["mean_e_t_percent"]) == (180.0, 100.0)
    assert numbers["mean_e_v_cm"] > 100.0
    assert numbers["median_posed_e_v_cm"] is None


def test_groups_are_parts_of_the_whole() -> None:
    some = vehicles(200, 2)
    members: dict[str, int] = {}
    for by, _, kept in errors.groups(some):
        members[by] = members.get(by, 0) + int(kept.sum())
        assert kept.sum() >= errors.FEWEST
    assert set(members) == {"distance", "class", "truncation", "occlusion", "tilt error"}
    assert members["class"] == members["truncation"] == members["occlusion"] == 200


def test_every_method_of_table_2_takes_part_and_answers() -> None:
    pytest.importorskip("poselib")
    some = vehicles(20, 3)
    for experiment, simple in page.SIMPLE.items():
        given = run.Setting(kn.Detector("good", 0.1), run.BOXES[0]).given(experiment, some, 0, model)
        everybody = {c.name: c for c in run.everybody(experiment)}
        for scores in (False, True):
            assert set(page.methods(experiment, scores).values()) <= set(everybody)
        assert {f"RNSC-{s}+{r}" for s in ("P1P", "P3P") for r in (simple.upper(), "HRE")} <= set(everybody)
        for name, contender in everybody.items():
            answers = contender.solve(given, Clock())
            e = errors.Errors.of(some, answers, given.shapes(answers.shape_coefficients))
            assert np.median(np.nan_to_num(e.e_r_deg, nan=180.0)) < 6.0, (experiment, name)
            assert np.median(e.e_v_cm) < 60.0, (experiment, name)


def test_thresholds_are_fractions_of_the_box_given() -> None:
    given = run.Setting(kn.Detector("", 1.0), run.BOXES[1]).given("G2", vehicles(9, 0), 0, model)
    longer = (given.bboxes[:, 2:] - given.bboxes[:, :2]).max(axis=1)
    assert not np.allclose(longer, vehicles(9, 0).seen.longer)
    np.testing.assert_allclose(given.inlier_threshold, 0.0375 * longer)
    tau = RELATIVE_THRESHOLD * np.array(HRE_VEHICLE)
    np.testing.assert_allclose(tau, [0.0375, 0.05, 0.15])


def test_low_scores_are_left_out_where_scores_are_used_so() -> None:
    given = run.SETTINGS[0].given("G1", vehicles(9, 0), 0, model)
    assert given.keypoint_scores is not None
    kept = np.isfinite(given.cut(LOWEST_SCORE).keypoints_2d[..., 0])
    np.testing.assert_array_equal(kept, given.keypoint_scores >= LOWEST_SCORE)
    assert f"RNSC-P1P+HRE, {CUT}" in {c.name for c in run.everybody("G1")}
    np.testing.assert_array_equal(given.without_scores().keypoints_2d, given.keypoints_2d)


def test_both_experiments_see_the_same_keypoints_and_boxes() -> None:
    some = vehicles(9, 0)
    one, two = (run.SETTINGS[1].given(e, some, 4, model) for e in run.EXPERIMENTS)
    np.testing.assert_array_equal(one.keypoints_2d, two.keypoints_2d)
    np.testing.assert_array_equal(one.bboxes, two.bboxes)
    assert [m.modes for m in one.models] == [0] * 9
    assert [m.modes for m in two.models] == [MODES] * 9


def test_results_are_deterministic_and_resumed(folder: Path, tmp_path: Path) -> None:
    for methods in (FAST[2:], FAST):  # in two parts and another order
        run.run("G2", 24, 0, tmp_path, methods, source=vehicles, model=model)
    one, two = (json.loads((f / "G2.json").read_text()) for f in (folder, tmp_path))
    assert one.pop("times") != two.pop("times")
    assert one == two

    def nobody(count: int, seed: int) -> objects.Vehicles:
        raise AssertionError("nothing was left to do")

    run.run("G2", 24, 0, tmp_path, FAST, source=nobody, model=model)
    with pytest.raises(ValueError, match="expected results of 25 trials"):
        run.run("G2", 25, 0, tmp_path, FAST, source=nobody, model=model)
    with pytest.raises(ValueError, match="got RNSC-P2P"):
        run.run("G2", 24, 0, tmp_path, ["RNSC-P2P"], source=nobody, model=model)


def test_numbers_of_g1_have_no_shape_and_those_of_g2_have(folder: Path) -> None:
    for name, shapes in (("G1", False), ("G2", True)):
        store = Store.read(folder / f"{name}.json")
        assert list(store.results) == [s.key for s in run.SETTINGS]
        for cell in store.results.values():
            assert list(cell) == [c.name for c in run.everybody(name) if c.name in FAST]
            assert all(("mean_e_v_cm" in numbers) == shapes for numbers in cell.values())
            assert all(numbers["trials"] == 24 for numbers in cell.values())


def test_stored_results_compare_with_themselves(folder: Path) -> None:
    assert compare.compare_folders(folder, folder) == []


def test_the_page_has_table_2_and_says_what_is_met(folder: Path, tmp_path: Path) -> None:
    text = page.write(folder, tmp_path / "page.md", tmp_path / "none.json").read_text()
    for heading in ("Known models (G1)", "Shape models (G2)", "Groups", "Every method"):
        assert f"## {heading}" in text
    assert "RNSC-P3P+GN" in text
    assert "3.78 | 1.56" in text
    store = Store.read(folder / "G1.json")
    reached = page.reached(store, run.SETTINGS[0], scores=False)
    assert [(line["mean"], line["of"]) for line in reached] == [
        ("e_r deg", "RNSC-P3P+HRE"),
        ("e_t %", "RNSC-P3P+HRE"),
    ]
    ours, limit = (store.results[run.SETTINGS[0].key][name] for name in ("ours, default", "RNSC-P3P+HRE"))
    assert [line["ours, default"] for line in reached] == [ours["mean_e_r_deg"], ours["mean_e_t_percent"]]
    assert reached[0]["ours, default, met"] == (ours["mean_e_r_deg"] <= limit["mean_e_r_deg"])
    with pytest.raises(FileNotFoundError):
        page.write(tmp_path / "empty", tmp_path / "page.md")


def test_vehicles_of_the_drive() -> None:
    pytest.importorskip("groundpose.lab.drive.labels")
    some, more = objects.collect(2, 0), objects.collect(3, 0)
    np.testing.assert_array_equal(some.t, more.t[:2])
    at = some.seen.keypoints_3d @ np.swapaxes(some.R, 1, 2) + some.t[:, None]
    seen = np.isfinite(at[..., 0])
    pixels = some.view.project(at[seen])
    np.testing.assert_allclose(pixels, some.seen.keypoints_2d[seen], atol=1e-6)
    assert (some.occlusion <= objects.MOST_OCCLUSION).all()
    assert (some.truncation <= objects.MOST_TRUNCATION).all()


def test_the_command_runs_an_experiment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run.run, "__defaults__", (*run.run.__defaults__[:-2], vehicles, model))
    command = ["experiment", "G1", "--trials", "4", "-o", str(tmp_path), "-m", "ours, default"]
    result = CliRunner().invoke(cli.app, command)
    assert result.exit_code == 0, result.output
    assert (tmp_path / "experiments_simulated.md").exists()
    assert Store.read(tmp_path / "G1.json").trials == 4
    refused = CliRunner().invoke(cli.app, [*command[:-1], "nobody"])
    assert refused.exit_code == 2
    assert "methods" in refused.output
