"""Ways to get poses behind one interface, and the table that says who takes part where."""

from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab import contenders as room
from groundpose.lab.bench import cases
from groundpose.lab.contenders import registry, styles
from groundpose.lab.contenders.contender import Contender, as_poses, errors
from groundpose.lab.contenders.libraries import POSELIB_TUNED, Library
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.contenders.own import DEFAULT, Own
from groundpose.lab.contenders.polish import Polished, solve_all
from groundpose.lab.contenders.registry import EVERYWHERE, ROWS, Row
from groundpose.lab.contenders.use import at_threshold, batched, with_cut, with_scores, without_scores
from groundpose.lab.evaluate.experiments import entry, figures
from groundpose.lab.evaluate.kitti.frame import Task
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.evaluate.simulated import run as simulated
from groundpose.lab.timing import Clock

EVERYONE = [row.contender for row in ROWS]
LIBRARIES = [one for one in EVERYONE if isinstance(one, Library)]
LAB = Path(room.__file__).parents[1]


def exact() -> Objects:
    return generate("cube", 2, n_points=200, outlier_ratio=0.1, noise_sigma=0.0)


@pytest.mark.parametrize("contender", EVERYONE, ids=lambda one: one.name)
def test_exact_data_give_the_exact_pose(contender: Contender) -> None:
    if reason := contender.missing():
        pytest.skip(reason)
    given, clock = exact(), Clock()
    answers = contender.solve(given, clock)
    found = errors(given, answers)
    rough = "unrefined" in contender.name or contender.name in ("RNSC-P1P", "RNSC-P3P")
    assert found.answered == 1.0
    assert found.mean_e_r_deg < (2.0 if rough else 0.02)
    assert found.mean_e_t_percent < (2.0 if rough else 0.02)
    if not contender.name.startswith("oracle"):
        assert np.sum(answers.seconds) == pytest.approx(clock.seconds)
        assert clock.seconds > 0.0


@pytest.mark.parametrize("library", LIBRARIES, ids=lambda one: one.name)
def test_data_without_a_pose_is_no_answer_and_no_exception(library: Library) -> None:
    if reason := library.missing():
        pytest.skip(reason)
    given = exact()
    for seen in (2, 4):
        few = given.keypoints_2d.copy()
        few[:, seen:] = np.nan
        nonsense = Objects(
            view=given.view,
            keypoints_2d=np.where(np.isnan(few), np.nan, few[:, :1]),  # all at one place
            bboxes=given.bboxes,
            models=given.models,
            inlier_threshold=given.inlier_threshold,
            R=given.R,
            t=given.t,
        )
        answers = library.solve(nonsense, Clock())
        assert np.isnan(answers.R).all() == np.isnan(answers.t).all()
        if seen == 2:
            assert np.isnan(answers.R).all()


def test_an_absent_library_is_reported() -> None:
    absent = Library("nobody", "", "a_module_that_is_not_there", lambda *_: None)
    assert absent.missing() == "a_module_that_is_not_there is not installed"


def test_the_tuned_options_are_the_fair_ones() -> None:
    assert "min_iterations 0" in POSELIB_TUNED.note
    assert all(library.note for library in LIBRARIES)
    assert registry.others("bench")[0] is POSELIB_TUNED


def test_names_and_options_are_not_shared() -> None:
    assert len({row.contender.name for row in ROWS}) == len({row.key for row in ROWS}) == len(ROWS)
    assert all(len(registry.rows(where)) > 1 for where in EVERYWHERE)


def test_a_new_row_takes_part_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    new = Own("somebody new", "a way to get poses")
    monkeypatch.setattr(registry, "ROWS", (*ROWS, Row(new)))
    assert all(
        new in race.others for race in cases.races() if race.group in ("vehicles", "keypoints", "outliers")
    )
    for experiment in ("E1", "E4", "HRE", "quick"):
        assert entry.contenders_of(experiment)[new.name] is new
    assert new.name in figures.drawn("fig4_today")
    for experiment in simulated.EXPERIMENTS:
        names = [one.name for one in simulated.everybody(experiment)]
        assert {new.name, "somebody new, scores as weights"} <= set(names)
    assert Task(methods=("somebody-new",)).methods == ("somebody-new",)
    assert new in registry.contenders("V1")
    assert new in registry.contenders("real")


def test_a_contender_has_its_own_look() -> None:
    for figure in figures.FIGURES:
        looks = [styles.style_of(name) for name in figures.drawn(figure)]
        assert len(set(looks)) == len(looks)
    kitti = [styles.style_of(one.name) for one in registry.contenders("kitti")]
    assert len(set(kitti)) == len(kitti)
    bench = [styles.style_of(one.name) for one in registry.contenders("bench")]
    assert len(set(bench)) == len(bench)


def test_scores_and_thresholds() -> None:
    assert with_scores(DEFAULT).name == "ours, default, scores as weights"
    assert with_scores(POSELIB_TUNED).name == "PoseLib tuned, score >= 0.1"
    assert with_scores(with_cut(DEFAULT)).name == "ours, default, score >= 0.1"
    assert at_threshold(with_cut(POSELIB_TUNED), 4.0).name == "PoseLib tuned, score >= 0.1, threshold x 4"
    assert without_scores(DEFAULT).name == DEFAULT.name
    given = exact()
    scores = np.full(given.keypoints_2d.shape[:2], 0.05)
    scores[:, ::2] = 1.0
    scored = Objects(**{**vars_of(given), "keypoint_scores": scores})
    cut = with_cut(DEFAULT).solve(scored, Clock()).poses
    assert cut is not None
    assert np.isnan(cut.keypoints_2d[:, 1::2]).all()
    ignored = without_scores(DEFAULT).solve(scored, Clock())
    np.testing.assert_array_equal(ignored.t, DEFAULT.solve(given, Clock()).t)


def vars_of(objects: Objects) -> dict[str, object]:
    return {name: getattr(objects, name) for name in Objects.__dataclass_fields__}


def test_batches_have_a_time_each() -> None:
    given = generate("vehicle", 7)
    whole, parts = DEFAULT.solve(given, Clock()), batched(with_scores(DEFAULT), 3).solve(given, Clock())
    np.testing.assert_array_equal(whole.R[:3], parts.R[:3])  # samples depend on the place in a call
    np.testing.assert_allclose(whole.R, parts.R, atol=1e-2)
    assert len(set(whole.seconds)) == 1
    assert len(set(parts.seconds)) == 3
    assert whole.poses is not None
    assert parts.poses is None


def test_a_shared_search_runs_once() -> None:
    calls: list[str] = []

    class Counted(Own):
        def solve(self, objects: Objects, clock: Clock):
            calls.append(self.name)
            return super().solve(objects, clock)

    search = Counted("search", "", {"refinement": "none"})
    both = [Polished(search, polish) for polish in registry.PNPS[1:3]]
    given = exact()
    found = solve_all([search, *both], given, Clock())
    assert calls == ["search"]
    alone = both[0].solve(given, Clock())
    np.testing.assert_array_equal(found[both[0].name].t, alone.t)
    assert np.all(found[both[0].name].seconds > found["search"].seconds)


def test_answers_of_a_library_as_a_batch() -> None:
    if reason := POSELIB_TUNED.missing():
        pytest.skip(reason)
    given = exact()
    poses = as_poses(given, POSELIB_TUNED.solve(given, Clock()))
    assert isinstance(poses, gp.PoseBatch)
    assert poses.ok.all()


def test_an_object_alone_has_only_its_seen_keypoints() -> None:
    scenes = generate("vehicle", 4)
    for k, single in enumerate(scenes.singles):
        assert np.isfinite(single.keypoints_2d).all()
        assert np.isfinite(single.keypoints_3d).all()
        assert len(single.keypoints_2d) == np.isfinite(scenes.keypoints_2d[k, :, 0]).sum()
        assert 20 <= len(single.keypoints_2d) <= 30


def test_one_module_reads_the_clock() -> None:
    for name in ("contenders", "evaluate", "bench"):
        for path in (LAB / name).rglob("*.py"):
            text = path.read_text("utf-8")
            assert "perf_counter" not in text, path
            assert "thread_time" not in text, path
