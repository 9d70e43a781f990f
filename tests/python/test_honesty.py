"""How sure answers are: statistics on data whose truth is known, the fit, and what is stored in a file."""

import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is not installed (extra [train])")
pytest.importorskip("moderngl", reason="moderngl is not installed (extra [simulate])")
pytest.importorskip("onnx", reason="onnx is not installed (extra [train])")
import groundpose as gp
import stand_in
from groundpose.keypoints.certainty import Certainty
from groundpose.keypoints.network import Network
from groundpose.lab.evaluate.honesty import (
    fit,
    label_errors,
    numbers,
    page,
    probability,
    seen,
    sources,
    synthetic,
)
from groundpose.lab.evaluate.honesty.answers import Answers, solve
from groundpose.lab.evaluate.honesty.coverage import Stated, covered, inside, rotation_vectors, sharpness
from groundpose.lab.evaluate.honesty.measure import fit_file, measure
from groundpose.lab.evaluate.honesty.store import store
from groundpose.lab.evaluate.report import read_json
from groundpose.lab.training.crops import NOTHING

N = 4000
AHEAD = (0.0, 1.0, 20.0)
OF_SHIFT, OF_TURN = np.diag([0.0, 0.0, 0.0, 400.0, 400.0, 0.0]), np.diag([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
QUANTITIES = ("pose", "R", "t", "yaw", "distance", "lateral")


def covariances(rng, count):
    """(count, 6, 6), all different, of angles of a degree and places of decimetres."""
    root = rng.normal(size=(count, 6, 6)) * np.array([0.02] * 3 + [0.2] * 3)[:, None]
    return root @ np.swapaxes(root, 1, 2)


def drawn(rng, covariance, dof=math.inf):
    """Errors (N, 6) of Student's t with these covariances."""
    errors = np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), rng.normal(size=covariance.shape[:2]))
    if math.isinf(dof):
        return errors
    return errors * np.sqrt((dof - 2.0) / rng.chisquare(dof, len(errors)))[:, None]


def about(axis, angle):
    """Rotations (N, 3, 3) about unit vectors (3,) by angles (N,)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sine * cross + (1.0 - cosine) * cross @ cross


@pytest.mark.parametrize("dof", [math.inf, 5.0])
def test_regions_of_true_covariances_hold_the_truth_as_often_as_they_say(dof):
    rng = np.random.default_rng(1)
    covariance = covariances(rng, N)
    t = rng.normal(AHEAD, 1.0, (N, 3))
    stated = Stated(drawn(rng, covariance, dof), covariance, t, np.array([0.0, 1.0, 0.0]))
    found = inside(stated, dof)
    assert set(found) == set(QUANTITIES)
    for by in found.values():
        for level, value in by.items():
            p = float(level)
            assert abs(value - p) < 4.0 * math.sqrt(p * (100.0 - p) / N), (level, value)


def test_sharpness_is_one_for_true_sigmas_and_two_for_doubled_ones():
    rng = np.random.default_rng(10)
    covariance = np.broadcast_to(covariances(rng, 1), (N, 6, 6))
    t = np.broadcast_to([1.0, 1.0, 20.0], (N, 3))
    errors = drawn(rng, covariance)
    for factor in (1.0, 2.0):
        found = sharpness(Stated(errors, factor**2 * covariance, t, np.array([0.0, 1.0, 0.0])))
        assert set(found) == {"yaw", "distance", "lateral"}
        assert list(found.values()) == pytest.approx([factor] * 3, rel=0.06)


def test_what_the_quantities_look_at():
    t, up = np.array([[0.0, 0.0, 10.0]]), np.array([0.0, 1.0, 0.0])
    for name, error in {
        "yaw": [0.0, 0.1, 0.0, 0.0, 0.0, 0.0],
        "distance": [0.0, 0.0, 0.0, 0.0, 0.0, 0.1],
        "lateral": [0.0, 0.0, 0.0, 0.1, 0.0, 0.0],
    }.items():
        found = Stated(np.array([error]), np.eye(6)[None], t, up).squared_distances()
        for other in ("yaw", "distance", "lateral"):
            assert found[other][1][0] == pytest.approx(0.01 if other == name else 0.0)
        assert found["pose"][1][0] == pytest.approx(0.01)


def test_rotation_vectors():
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    angles = np.array([0.0, 1e-9, 0.3, 2.0, 3.1])
    np.testing.assert_allclose(rotation_vectors(about(axis, angles)), angles[:, None] * axis, atol=1e-12)


def made_up(rng, count, factor=9.0, dof=6.0):
    """Right answers whose errors have this factor, wrong ones, and as many places with nothing."""
    given = np.zeros(2 * count, dtype=seen.SEEN)
    given["class"][count:] = NOTHING
    given["kind"] = np.where(np.arange(2 * count) < count, "car", "thing")
    given["box"] = [0.0, 0.0, 100.0, 50.0]
    priors, keypoints = covariances(rng, 2 * count) * 1e-4, covariances(rng, 2 * count) * 1e-3
    t = rng.normal(AHEAD, 1.0, (2 * count, 3))
    errors = drawn(rng, priors + factor * keypoints, dof)
    given["t"], given["R"] = t + errors[:, 3:], np.eye(3)
    turned = -np.linalg.norm(errors[:, :3], axis=1)
    R = np.stack([about(-e[:3] / a, np.array([a]))[0] for e, a in zip(errors, -turned, strict=True)])
    evidence = rng.normal(size=(2 * count, 6))
    chance = 1.0 / (1.0 + np.exp(-(2.0 + evidence @ [1.0, -0.5, 0.0, 0.0, 0.5, 0.0])))
    wrong = rng.random(2 * count) > chance
    t = np.where(wrong[:, None], 2.0 * t, t)
    for name in ("R", "t"):
        given[name][count:] = np.nan
    evidence[count:] -= 6.0 * np.array([1.0, 0, 0, 0, 1.0, 0])
    return Answers(
        seen=given,
        ok=np.ones(2 * count, dtype=bool),
        R=R,
        t=t,
        up=np.tile([0.0, 1.0, 0.0], (2 * count, 1)),
        covariance=priors + keypoints,
        of_factor=keypoints,
        of_shift=np.tile(OF_SHIFT, (2 * count, 1, 1)),
        of_turn=np.tile(OF_TURN, (2 * count, 1, 1)),
        evidence=evidence,
        ambiguity=np.full(2 * count, 0.01),
        other_R=np.full((2 * count, 3, 3), np.nan),
    )


def test_a_fit_finds_the_factor_and_its_regions_hold():
    answers = made_up(np.random.default_rng(2), 1500)
    found = fit.fit(answers, np.ones(len(answers), dtype=bool))
    assert 7.0 < found.error_factor < 13.0
    right = answers.only(answers.right)
    shared = (found.error_factor, found.error_shift, found.error_turn)
    for by in inside(right.stated(*shared), found.error_dof).values():
        assert 45.0 < by["50"] < 65.0
        assert 87.0 < by["90"] < 95.0
        assert 93.0 < by["95"] < 98.5
    assert covered(right.stated(1.0), math.inf)["inside"]["pose"]["95"] < 60.0


def test_a_fit_finds_the_probability_and_keeps_right_answers():
    answers = made_up(np.random.default_rng(3), 2000)
    found = fit.fit(answers, np.ones(len(answers), dtype=bool))
    assert found.probability_coefficients is not None
    assert found.min_probability is not None
    p = probability.probability(found, answers)
    judged = probability.reliability(p[answers.vehicles], answers.right[answers.vehicles])
    assert judged["calibration_error"] < 0.03
    assert np.mean(p[~answers.vehicles] >= found.min_probability) <= 1.5 * probability.MOST_BACKGROUND
    assert np.mean(p[answers.right] >= found.min_probability) >= probability.LEAST_KEPT - 1e-3


def test_a_threshold_never_loses_more_right_answers_than_it_may():
    answers = made_up(np.random.default_rng(4), 500)
    same = np.random.default_rng(5).random(len(answers))  # background looks like vehicles
    least = probability.least(same, answers)
    assert np.mean(same[answers.right] >= least) == pytest.approx(probability.LEAST_KEPT, abs=0.01)


def test_a_fit_needs_enough():
    answers = made_up(np.random.default_rng(6), 50)
    with pytest.raises(gp.InputError, match="100 right answers or more"):
        fit.fit(answers, np.ones(len(answers), dtype=bool))


def test_auc_counts_pairs():
    scores, good = np.array([0.1, 0.4, 0.4, 0.8]), np.array([False, False, True, True])
    pairs = [1.0, 1.0, 0.5, 1.0]  # (0.4, 0.1), (0.8, 0.1), (0.4, 0.4), (0.8, 0.4)
    assert probability.auc(scores, good) == pytest.approx(np.mean(pairs))
    assert probability.auc(scores, np.ones(4, dtype=bool)) is None


def test_reliability_of_true_and_of_doubled_probabilities():
    rng = np.random.default_rng(7)
    p = rng.random(20000)
    true = rng.random(20000) < p
    assert probability.reliability(p, true)["calibration_error"] < 0.02
    half = probability.reliability(p, rng.random(20000) < 0.5 * p)
    assert half["calibration_error"] == pytest.approx(0.25, abs=0.02)
    assert half["worst_factor"] == pytest.approx(2.0, abs=0.4)


@pytest.fixture
def network(tmp_path):
    return Network(stand_in.write(tmp_path / "net.onnx", version="2"), 1)


def street(codec):
    """Two boxes in which the stand-in sees a vehicle, with a truth."""
    view = gp.View(gp.Camera.from_fov(1280, 720, 1.0), pitch=0.01)
    made = seen.given(2, "car", view, np.array([[400.0, 300.0, 560.0, 400.0], [700.0, 300.0, 900.0, 420.0]]))
    made["class"], made["R"], made["t"] = 0, np.eye(3), [0.0, 1.5, 20.0]
    yield np.full((2, codec.height, codec.width, 3), 200, np.uint8), made


def seen_cars(network):
    """What the stand-in says of the street, with keypoints of cars that stand there."""
    records, own, model = (
        seen.see(network, street),
        gp.vehicles.keypoint_indices("car"),
        gp.vehicles.shape_model("car"),
    )
    rng, view = np.random.default_rng(11), seen.view_of(records["view"][0])
    for record in records:
        record["R"] = view.R_camera_from_ground @ about(np.array([0.0, 1.0, 0.0]), np.array([0.6]))[0]
        points = view.camera.project(model.keypoints_3d @ record["R"].T + record["t"])
        record["keypoints"][own] = points + rng.normal(size=points.shape)
        record["box"] = [*points.min(axis=0), *points.max(axis=0)]
    return records


def test_covariances_of_any_factor_and_probabilities_are_those_of_the_solver(network):
    answers = solve(seen_cars(network))
    assert answers.right.all()
    certainty = Certainty(7.0, 6.0, (0.3, 0.5, -0.2, -1.0, -0.1, 0.2, -0.1), 0.0)
    view = seen.view_of(answers.seen["view"][0])
    own = gp.vehicles.keypoint_indices("car")
    poses = gp.estimate_poses(
        view,
        answers.seen["keypoints"][:, own],
        answers.seen["box"],
        gp.vehicles.shape_model("car"),
        answers.seen["scores"][:, own],
        certainty.applied(gp.Options()),
        threads=1,
        vehicle_probability=answers.seen["vehicle"],
        viewing_angle_probabilities=answers.seen["viewing_angle"],
    )
    ok = answers.ok
    np.testing.assert_allclose(answers.stated(7.0).covariance[ok], poses.covariance[ok], rtol=1e-9)
    np.testing.assert_allclose(
        probability.probability(certainty, answers)[ok], poses.probability[ok], rtol=1e-12
    )


def test_certainty_is_stored_in_the_file_and_changes_nothing_else(network):
    crops = np.full((1, network.codec.height, network.codec.width, 3), 90, np.uint8)
    before, said = seen.fingerprint(network), network.detect(crops)
    store(network.path, Certainty(8.0, 5.0, (0.0,) * 7, 0.4))
    after = Network(network.path, 1)
    assert after.certainty == Certainty(8.0, 5.0, (0.0,) * 7, 0.4)
    assert {k: v for k, v in after.metadata.items() if k != "certainty"} == network.metadata
    assert seen.fingerprint(after) == before
    np.testing.assert_array_equal(after.detect(crops).keypoints, said.keypoints)
    assert list(network.path.parent.iterdir()) == [network.path]


def test_what_a_network_says_is_kept(tmp_path, network):
    told: list[str] = []
    first = seen.kept(tmp_path / "kept", "a street", network, street, told.append)
    again = seen.kept(tmp_path / "kept", "a street", network, lambda codec: pytest.fail("again"), told.append)
    assert told == ["a street: running the network"]
    np.testing.assert_array_equal(again["keypoints"], first["keypoints"])


def test_errors_of_labels_are_allowed_for_and_their_shift_is_taken_out():
    rng = np.random.default_rng(8)
    answers = made_up(rng, 200)
    answers = answers.only(answers.vehicles)
    mirrored = np.arange(len(answers)) % 2 == 1
    answers.seen["kind"] = np.where(mirrored, sources.MIRRORED, "car")
    shifted = answers.seen["t"].copy()
    answers.seen["t"][:, 0] += np.where(mirrored, -0.3, 0.3)
    allowed = label_errors.allowed(answers)
    np.testing.assert_allclose(allowed.seen["t"], shifted, atol=0.06)
    added = np.diagonal(allowed.covariance - answers.covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(np.degrees(np.sqrt(added[0, :3])), [0.8, 1.0, 0.8])


def test_synthetic_scenes_hold_the_truth(tmp_path):
    found = synthetic.settings(300, tmp_path)  # a data folder without anything
    assert len(found) == 3
    for stated in found.values():
        assert 88.0 < covered(stated, math.inf)["inside"]["pose"]["95"] < 99.0


def found_numbers():
    rng = np.random.default_rng(9)
    answers = made_up(rng, 400)
    is_vehicle = np.ones(len(answers), dtype=bool)
    certainty = fit.fit(answers, is_vehicle)
    vehicles = numbers.vehicles(answers, certainty, is_vehicle, True)
    assert vehicles["coverage"][numbers.CLEAR]["inside"]["pose"]["95"] > 90.0
    assert vehicles["kept"] >= 96.0
    names = (*sources.RENDERS, sources.ALL_RENDERS, sources.MANY_LOOKS)
    return {
        "command": "made up",
        "callers_probability": {"synthetic": vehicles["probability"] | {"objects": 400, "right": 90.0}},
        "callers": {"synthetic": covered(answers.only(answers.right).stated(9.0), 6.0)},
        "trained": {
            "default": {
                "certainty": certainty.numbers(),
                "vehicles": dict.fromkeys(names, vehicles),
                "background": {
                    "things": numbers.background(answers.only(~answers.vehicles), certainty, is_vehicle[400:])
                },
            }
        },
    }


def test_page_and_sentence(tmp_path):
    found = found_numbers()
    begin, end = page.MARKS
    (tmp_path / "docs").mkdir()
    (tmp_path / page.PAGE).write_text(f"before\n{begin}\n{end}\nafter\n")
    (tmp_path / page.README).write_text("x " + "".join(page.SENTENCE) + " y")
    written = page.write_page(tmp_path, found)
    text = written.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "### Regions" in text
    assert "| things |" in text
    readme = (tmp_path / page.README).read_text()
    assert "% of synthetic scenes with independent noise" in readme
    assert "27 real cars" in readme
    assert page.with_sentence(readme, found) == readme
    for figure in ("honesty_coverage.png", "honesty_reliability.png"):
        assert (tmp_path / "docs" / figure).stat().st_size > 5000


def test_the_sentence_of_the_readme_is_what_was_measured():
    root = Path(__file__).parents[2]
    found = read_json(root / page.RESULTS)
    text = (root / page.README).read_text("utf-8")
    assert page.with_sentence(text, found) == text, "run: groundpose evaluate pages"


def test_a_network_without_certainty_is_named(tmp_path, network):
    with pytest.raises(gp.InputError, match=r"net\.onnx: expected a network with certainty"):
        measure(tmp_path, [f"default={network.path}"], tmp_path, None, lambda text: None)
    with pytest.raises(gp.InputError, match="a folder of crops"):
        fit_file(network.path, tmp_path, lambda text: None)
