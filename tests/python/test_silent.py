"""Scenes with one mistake each, answers that are wrong and sure of it, probabilities for callers."""

from __future__ import annotations

import json
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.lab.contenders import own
from groundpose.lab.contenders.own import Own
from groundpose.lab.evaluate import misled, silent
from groundpose.lab.evaluate.honesty import callers
from groundpose.lab.evaluate.honesty.mixture import WITH_SCORES, WITHOUT_SCORES
from groundpose.lab.evaluate.misled import CASES, Case
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

ROOT = Path(__file__).parents[2]
IDS = {case.id: case for case in CASES}
TOLD_THE_TRUTH = [case for case in CASES if case.has_truth]


@pytest.mark.parametrize("case", TOLD_THE_TRUTH, ids=lambda case: case.id)
def test_keypoints_are_where_the_truth_puts_them(case: Case) -> None:
    """All inliers are within a few standard deviations of their noise."""
    for scenes in case.scenes(40, 0):
        pixels = scenes.camera.project(
            scenes.keypoints_3d @ np.swapaxes(scenes.R, 1, 2) + scenes.t[:, None, :]
        )
        longer = (scenes.bboxes[:, 2:] - scenes.bboxes[:, :2]).max(axis=1)
        error = np.linalg.norm(pixels - scenes.keypoints_2d, axis=2) / longer[:, None]
        assert scenes.inlier_truth is not None
        good = scenes.inlier_truth & ~np.isnan(scenes.keypoints_2d[..., 0])
        assert good.any()
        assert error[good].max() < 0.15
        assert np.median(error[good]) < 0.04
        assert (scenes.bboxes[:, 2:] > scenes.bboxes[:, :2]).all()


def test_the_same_seed_gives_the_same_scenes() -> None:
    for case in CASES:
        first, second, other = (case.scenes(6, seed)[0] for seed in (1, 1, 2))
        np.testing.assert_array_equal(first.keypoints_2d, second.keypoints_2d)
        assert not np.array_equal(first.t, other.t)


def test_each_mistake_is_as_large_as_it_says() -> None:
    up, down = IDS["pitch-20"].scenes(4, 0)
    assert np.degrees([up.view.pitch, down.view.pitch]) == pytest.approx([20.0, -20.0])
    (lean,), straight = IDS["lean-15"].scenes(30, 0), misled.vehicles(30, 0)
    angles = np.degrees(np.arccos((lean.R[:, :, 1] * straight.R[:, :, 1]).sum(axis=1)))
    np.testing.assert_allclose(angles, 15.0, atol=1e-9)
    (turned,) = IDS["upside-down"].scenes(30, 0)
    assert (turned.R[:, 1, 1] < -0.9).all()
    (four,) = IDS["four"].scenes(30, 0)
    assert ((~np.isnan(four.keypoints_2d[..., 0])).sum(axis=1) == 4).all()
    (truck,) = IDS["class"].scenes(10, 0)
    assert {model.name for model in truck.models} == {"car"}
    assert np.isfinite(truck.keypoints_3d[..., 0]).sum(axis=1).min() >= 16
    (small,) = IDS["shrunk"].scenes(10, 0)
    extent = np.nanmax(small.keypoints_2d, axis=1) - np.nanmin(small.keypoints_2d, axis=1)
    assert (extent < 0.05 * (small.bboxes[:, 2:] - small.bboxes[:, :2]).max(axis=1)[:, None]).all()


def test_rotation_vectors_up_to_half_a_turn() -> None:
    rng = np.random.default_rng(0)
    w = rng.normal(size=(200, 3))
    w *= (rng.uniform(0.0, np.pi, 200) / np.linalg.norm(w, axis=1))[:, None]
    w[:3] = [[0.0, 0.0, 0.0], [np.pi - 1e-9, 0.0, 0.0], [0.0, 1e-12, 0.0]]
    R = Rotation.random(200, random_state=0).as_matrix()
    found = silent.rotation_vectors(Rotation.from_rotvec(w).as_matrix() @ R, R)
    np.testing.assert_allclose(found, w, atol=1e-6)
    assert np.isnan(silent.rotation_vectors(R[:1], np.full((1, 3, 3), np.nan))).all()


@pytest.mark.parametrize(("id", "most"), ({**silent.LIMITS, "pitch-30": 1.0, "lean-30": 1.0}).items())
def test_few_answers_are_wrong_and_sure_of_it(id: str, most: float) -> None:
    """400 scenes: within two standard deviations of the limit."""
    found = silent.line(IDS[id], own.DEFAULT, 400, 7)
    assert found["silent, yaw, %"] <= most + 200.0 * np.sqrt(most / 100.0 / 400.0)


def test_the_ground_alone_is_misled() -> None:
    for id in ("pitch-20", "pitch-30", "lean-30", "upside-down"):
        free, held = (silent.line(IDS[id], method, 300, 8) for method in (own.DEFAULT, silent.HELD))
        assert free["silent, rotation, %"] < 0.5 * held["silent, rotation, %"]
        assert free["refused, %"] <= held["refused, %"]


def test_nothing_changes_where_nothing_is_wrong() -> None:
    scenes = misled.vehicles(500, seed=4)
    free, held = own.DEFAULT.poses(scenes), silent.HELD.poses(scenes)
    assert free.ok.all()
    assert np.all(free.R == held.R, axis=(1, 2)).mean() >= 0.995


def test_answers_without_the_ground_say_so() -> None:
    (scenes,) = misled.upside_down(60, 3)
    poses = own.DEFAULT.poses(scenes)
    assert (poses.solver[poses.ok] == "p3p").mean() > 0.9


def test_collapsed_keypoints_and_small_poses_are_refused() -> None:
    statuses = {}
    for id in ("collapsed", "shrunk", "tiny"):
        (scenes,) = IDS[id].scenes(50, 0)
        statuses[id] = set(own.DEFAULT.poses(scenes).status)
        assert "ok" not in statuses[id]
    assert statuses["shrunk"] == statuses["tiny"] == {"degenerate"}
    (third,) = misled.shrunk(0.3)(50, 0)
    refused = own.DEFAULT.poses(third)
    assert not refused.ok.any()
    assert "improbable" in refused.status
    assert Own("", options={"min_probability": 0.0}).poses(third).ok.any()


def test_the_command_writes_numbers_and_the_table_has_every_case(tmp_path: Path) -> None:
    out = tmp_path / "silent.json"
    done = CliRunner().invoke(app, ["evaluate", "silent", "--trials", "6", "--out", str(out)])
    assert done.exit_code == 0, done.output
    found = json.loads(out.read_text(encoding="utf-8"))
    lines = silent.rows(found, {})
    assert [line["case"] for line in lines] == [case.what for case in CASES]
    assert silent.write_stored(tmp_path) is None
    (tmp_path / "results").mkdir()
    (tmp_path / "docs").mkdir()
    (tmp_path / silent.JSON).write_text(out.read_text(encoding="utf-8"), encoding="utf-8")
    page = silent.write_stored(tmp_path)
    assert page is not None
    assert "image upside down" in page.read_text(encoding="utf-8")


def test_the_page_is_that_of_the_stored_numbers(tmp_path: Path) -> None:
    for stored in (silent.JSON, silent.BEFORE):
        (tmp_path / stored).parent.mkdir(exist_ok=True)
        (tmp_path / stored).write_bytes((ROOT / stored).read_bytes())
    (tmp_path / "docs").mkdir()
    page = silent.write_stored(tmp_path)
    assert page is not None
    assert page.read_bytes() == (ROOT / silent.PAGE).read_bytes()


def test_the_solver_states_the_fitted_probabilities() -> None:
    fits = json.loads((ROOT / callers.RESULTS).read_text(encoding="utf-8"))["fits"]
    scenes = misled.vehicles(30, seed=5)
    rng = np.random.default_rng(0)
    scored = gp.estimate_poses(
        scenes.view,
        scenes.keypoints_2d,
        scenes.bboxes,
        scenes.models,
        np.where(
            np.isnan(scenes.keypoints_2d[..., 0]),
            np.nan,
            rng.uniform(0.3, 1.0, scenes.keypoints_2d.shape[:2]),
        ),
    )
    for name, poses in (("without scores", callers.NEVER_REFUSES.poses(scenes)), ("with scores", scored)):
        bias, *coefficients = fits[name]["coefficients"]
        expected = 1.0 / (1.0 + np.exp(-bias - poses.evidence @ np.array(coefficients)))
        np.testing.assert_allclose(poses.probability[poses.ok], expected[poses.ok], atol=1e-12)


def test_the_least_probability_keeps_right_answers() -> None:
    stored = json.loads((ROOT / callers.RESULTS).read_text(encoding="utf-8"))
    for fit in stored["fits"].values():
        whole = fit["parts"]["all"]
        assert whole["right kept, %"] >= 0.99 * whole["right, %"]
        assert fit["calibration_error"] < 0.03
    for id in ("v1", *(name for name in stored["fits"]["without scores"]["parts"] if name.startswith("E1"))):
        part = stored["fits"]["without scores"]["parts"][id]
        assert part["right kept, %"] == part["right, %"]
    scenes = misled.vehicles(20, seed=6)
    least = stored["least probability"]
    stated = callers.NEVER_REFUSES.poses(scenes).probability
    assert ((stated >= least) == own.DEFAULT.poses(scenes).ok).all()


def test_a_fit_tells_right_answers_from_wrong_ones() -> None:
    some = tuple(case for case in WITHOUT_SCORES if case.id in ("v1", "class", "outliers", "four", "no box"))
    parts = callers.answers(some, 150, 300)
    coefficients = callers.fit(parts)
    assert len(coefficients) == 7
    assert coefficients[5] == 0.0
    whole = callers._joined(parts)
    auc = callers.auc(callers.stated(whole, coefficients)[whole.ok], whole.right[whole.ok])
    assert auc is not None
    assert auc > 0.85


def test_parts_of_the_mixture_have_names_of_their_own() -> None:
    for mixture in (WITHOUT_SCORES, WITH_SCORES):
        assert len({case.id for case in mixture}) == len(mixture)
    nothing = next(case for case in WITH_SCORES if case.id == "nothing there, V1")
    (scenes,) = nothing.scenes(10, 0)
    poses = own.DEFAULT.poses(scenes)
    assert not poses.ok.any()
    assert set(poses.status) <= {"improbable", "no_consensus"}


@pytest.mark.parametrize(
    "id", ["no box", "sides not known", "detected box", "half hidden", "E1, 50% outliers"]
)
def test_mixture_without_a_drive(id: str) -> None:
    case = next(case for case in WITHOUT_SCORES if case.id == id)
    judged = callers.Judged.of(case.scenes(40, 1))
    assert judged.right.mean() > 0.9
    assert (judged.probability[judged.right] > 0.1).mean() > 0.9
