"""`groundpose bench`: races with a stand-in clock, runs that go on, the command."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from groundpose import InputError
from groundpose.cli.main import app
from groundpose.lab.bench import cases, races, run, scenes, sources, special
from groundpose.lab.bench.cases import Case
from groundpose.lab.bench.races import QUICK, Effort, Race, WrongAnswer
from groundpose.lab.contenders.contender import Answers
from groundpose.lab.contenders.registry import DEFAULT, TO_BEAT, others
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.timing import in_chunks, median_interval
from typer.testing import CliRunner

FEW = Effort(objects=40, rounds=10, fewest=7, seconds=1.0, chunk_seconds=0.5)


def quiet(text: str) -> None:
    pass


class StandIn:
    """A contender that needs the time that it is told to, with the right or wrong poses."""

    note = ""
    weighs_scores = False

    def __init__(
        self, name: str, us: float, right: bool = True, missing: str | None = None, slow: bool = False
    ) -> None:
        self.turns: list[int] = []
        self.log: list[str] = []
        self.name, self.us, self.right = name, us, right
        self.slow_with_outliers, self._missing = slow, missing

    def missing(self) -> str | None:
        return self._missing

    def solve(self, objects, clock) -> Answers:
        self.turns.append(len(objects))
        self.log.append(self.name)
        mood = 1.0 + 0.5 * (len(self.turns) % 3)  # the machine's, the same for all
        clock.seconds += 1e-6 * self.us * mood * len(objects)
        return Answers(objects.R if self.right else -objects.R, objects.t, np.zeros(len(objects)))


def race(ours: StandIn, *others: StandIn, **more) -> Race:
    def make(trials, seed):
        return generate("vehicle", trials, seed=seed)

    return Race("v", "g", 1, "label", make, ours, others, 10, **more)


def test_a_race_tells_the_ratio_of_turns_on_the_same_objects():
    ours, other = StandIn("ours", 10.0), StandIn("other", 30.0)
    found = race(ours, other).run(FEW, quiet)
    mine, theirs = found["lines"]
    assert theirs["times ours"] == pytest.approx(3.0)  # moods cancel
    assert theirs["times ours, 95 %"] == pytest.approx([3.0, 3.0])
    assert theirs["turns"] == FEW.rounds
    assert 10.0 <= mine["us"] <= 20.0
    assert mine["failures %"] == theirs["failures %"] == 0.0
    assert mine["objects"] == FEW.objects


def test_who_begins_changes_with_the_turn():
    log: list[str] = []
    ours, other = StandIn("a", 10.0), StandIn("b", 10.0)
    ours.log = other.log = log
    race(ours, other).run(FEW, quiet)
    turns = "".join(log[-2 * FEW.rounds :])
    assert turns == "abba" * (FEW.rounds // 2)


def test_our_wrong_poses_are_never_timed():
    with pytest.raises(WrongAnswer, match="ours fails on 100 %"):
        race(StandIn("ours", 10.0, right=False), StandIn("other", 1.0)).run(FEW, quiet)


def test_who_is_left_out_and_why():
    wrong, absent = StandIn("wrong", 1.0, right=False), StandIn("absent", 1.0, missing="it is not installed")
    slow = StandIn("slow", 1.0, slow=True)
    found = race(StandIn("ours", 10.0), wrong, absent, slow, outlier_ratio=0.8).run(FEW, quiet)
    assert [line["method"] for line in found["lines"]] == ["ours"]
    assert found["left out"]["wrong"] == "fails on 100 % of 40"
    assert found["left out"]["absent"] == "it is not installed"
    assert "with so many outliers" in found["left out"]["slow"]
    assert absent.turns == slow.turns == []


def test_slow_contenders_get_fewer_objects_a_turn(monkeypatch):
    monkeypatch.setattr(races, "clocked", lambda call: call() and 1e9)  # its own clock tells the pace
    ours, slow = StandIn("ours", 10.0), StandIn("slow", 2e5)
    found = race(ours, slow).run(FEW, quiet)
    assert found["lines"][1]["objects a turn"] < 10
    assert found["lines"][1]["turns"] == FEW.fewest
    assert found["lines"][0]["objects a turn"] == 10  # ours is told for whole turns
    whole = race(StandIn("ours", 10.0), StandIn("slow", 2e5), whole=True).run(FEW, quiet)
    assert whole["lines"][1]["objects a turn"] == 10


def test_the_interval_holds_the_median_as_often_as_it_says():
    rng = np.random.default_rng(0)
    for count in (7, 20, 61):
        draws = rng.exponential(size=(2000, count))  # nothing like a normal distribution
        inside = [low <= np.log(2) <= high for low, high in map(median_interval, draws)]
        assert 0.95 <= np.mean(inside) < 0.995, count
    assert median_interval(np.array([2.0, 1.0])) == [1.0, 2.0]


@pytest.mark.parametrize("one", cases.races(), ids=lambda one: one.id)
def test_every_race_has_objects_that_ours_gets_right(one):
    found = replace(one, others=()).run(replace(QUICK, largest_batch=20), quiet)
    assert found["lines"][0]["us"] > 0.0
    assert found["lines"][0]["failures %"] <= 50.0


def test_the_table_of_cases():
    every = cases.cases()
    assert len({case.id for case in every}) == len(every)
    assert {case.group for case in every} == {*cases.GROUPS, *cases.BUILT}
    assert {case.group for case in cases.chosen("")} == set(cases.GROUPS)
    assert [case.id for case in cases.chosen("outliers/50, vehicles")] == ["vehicles", "outliers/50"]
    assert cases.chosen("machine", native=True)[-1].id == "native"
    with pytest.raises(ValueError, match="got 'nonsense'"):
        cases.chosen("nonsense")
    assert others("bench")[0].name == TO_BEAT


def test_a_quick_run_of_everything_takes_less_than_a_minute_and_a_half():
    """As it says of itself before it begins; races and the speed of the core are in it, no builds."""
    seconds = races.quick_seconds(case.group for case in cases.chosen(""))
    assert 20.0 < seconds < 90.0
    assert races.quick_seconds(["machine", "vehicles"]) < races.quick_seconds(["native"])


def test_cars_have_the_shape_and_the_pose_they_say():
    objects = scenes.cars(5, 6, seed=3)
    assert len(objects.models) == 6
    for k in range(6):
        seen = objects.view.camera
        points = objects.keypoints_3d[k] @ objects.R[k].T + objects.t[k]
        pixels = points[:, :2] / points[:, 2:] * [seen.fx, seen.fy] + [seen.cx, seen.cy]
        errors = np.linalg.norm(pixels - objects.keypoints_2d[k], axis=1)
        assert np.median(errors[objects.inlier_truth[k]]) < objects.inlier_threshold[k]
        assert 0.2 - 0.02 <= np.mean(~objects.inlier_truth[k]) <= 0.5 + 0.02
        mean = objects.models[k].keypoints_3d
        modes = objects.models[k].basis.reshape(5, -1)
        residual = (objects.keypoints_3d[k] - mean).ravel()
        assert np.allclose(residual, modes.T @ (modes @ residual), atol=1e-9)  # within the model
    again = scenes.cars(5, 6, seed=3)
    assert np.array_equal(again.keypoints_2d, objects.keypoints_2d)
    assert objects[2:4].models[0] is objects.models[0]
    assert len(in_chunks(objects, 2)) == 3


def test_overhead_is_what_is_left_of_a_call_without_work():
    found = special.overhead(QUICK, quiet)
    assert found["us per object"]["median"] < found["us of whole calls"]["1"]
    assert 0 < found["us per call of an estimator"]["median"] < 1000
    assert found["bytes per object"]["in"] > 28 * 16
    assert found["bytes per object"]["out"] > 8 * (9 + 3 + 36)


def test_core_speed_is_plausible():
    found = special.core_speed(64, seconds=0.01)
    assert found["gflops"] > 0.1
    assert found["cache GB/s"] > 0.1


# ---- runs


def numbered(calls: list[str], interrupt: str = "") -> list[Case]:
    def make(name: str):
        def measure(effort, tell):
            if name == interrupt:
                raise KeyboardInterrupt
            calls.append(name)
            return {"group": "g", "label": name, "value": len(calls)}

        return measure

    return [Case(name, "g", make(name)) for name in ("a", "b", "c")]


def test_an_interrupted_run_goes_on(tmp_path):
    out, calls = tmp_path / "bench.json", []
    with pytest.raises(KeyboardInterrupt):
        run.run(out, numbered(calls, interrupt="b"), QUICK)
    stored = json.loads(out.read_text())
    assert list(stored["cases"]) == ["a"]
    assert stored["pending"] == ["b", "c"]
    run.run(out, numbered(calls), QUICK)
    assert calls == ["a", "b", "c"]
    content = run.run(out, numbered(calls), QUICK)  # a finished run is measured again
    assert calls == ["a", "b", "c"] * 2
    assert content["pending"] == []


def test_cases_that_are_not_asked_for_stay_unless_the_setup_is_another(tmp_path):
    out, calls = tmp_path / "bench.json", []
    run.run(out, numbered(calls), QUICK)
    content = run.run(out, numbered(calls)[1:2], QUICK)
    assert calls == ["a", "b", "c", "b"]
    assert content["cases"]["a"]["value"] == 1
    assert content["cases"]["b"]["value"] == 4
    other = replace(QUICK, seed=1)
    with pytest.raises(InputError, match="another seed"):
        run.run(out, numbered(calls)[1:2], other)
    assert set(run.run(out, numbered(calls), other)["cases"]) == {"a", "b", "c"}
    fresh = run.run(out, numbered(calls)[:1], QUICK, fresh=True)
    assert set(fresh["cases"]) == {"a"}


def test_what_is_not_there_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    content = run.run(tmp_path / "bench.json", cases.chosen("instructions,native"), QUICK)
    assert content["cases"]["instructions"]["missing"] == "valgrind is not installed"
    assert "cargo" in content["cases"]["native"]["missing"]


def test_a_package_without_sources_says_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sources.gp, "__file__", str(tmp_path / "a" / "b" / "c.py"))
    with pytest.raises(sources.Missing, match="needs the repository"):
        sources.repository()


def test_what_cargo_made_is_read_from_its_messages():
    def message(target: str, executable: str | None, *files: str) -> str:
        made = {"reason": "compiler-artifact", "target": {"name": target}}
        return json.dumps(made | {"executable": executable, "filenames": files})

    library = message("groundpose", None, "/t/libgroundpose.rlib", "/t/libgroundpose.so")
    told = "\n".join(
        [message("nalgebra", None, "/t/n.so"), library, message("instructions", "/t/instructions-1", "/t/i")]
    )
    assert sources.artifact(told, "") == Path("/t/instructions-1")
    assert sources.artifact(told, "groundpose.so") == Path("/t/libgroundpose.so")


def test_instructions_of_a_dump():
    assert sources.total("events: Ir\nfn=(1)\n0 5\n\ntotals: 12345\n") == 12345


# ---- the command


def bench(*arguments: object):
    return CliRunner().invoke(app, ["bench", *map(str, arguments)])


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> Path:
    """A quick run of two cases and its baseline."""
    folder = tmp_path_factory.mktemp("bench")
    out, kept = folder / "bench.json", folder / "baseline.json"
    done = bench("--quick", "--only", "batch/10,overhead", "-o", out, "--save-baseline", kept)
    assert done.exit_code == 0, done.output
    assert done.output.startswith("2 cases, a few turns of each: about 2 s\n")
    for told in (DEFAULT, "us per object", f"Numbers: {out}", f"Picture: {folder / 'bench.png'}"):
        assert told in done.output
    return folder


def test_the_command_writes_numbers_and_picture(measured):
    stored = json.loads((measured / "bench.json").read_text())
    assert set(stored["cases"]) == {"batch/10", "overhead"}
    assert stored["pending"] == []
    assert stored["versions"]["numpy"]
    assert (measured / "bench.png").stat().st_size > 10_000


def test_compare_fails_on_a_loss(measured, tmp_path):
    kept = json.loads((measured / "baseline.json").read_text())
    if not kept["times"]:
        pytest.skip(f"{TO_BEAT} is not installed")
    out = tmp_path / "bench.json"
    for factor, code, word in ((100.0, 0, "better"), (0.01, 1, "lost")):
        changed = tmp_path / "changed.json"
        times = {
            name: {**one, "relative time": factor * one["relative time"]}
            for name, one in kept["times"].items()
        }
        changed.write_text(json.dumps({**kept, "times": times}))
        done = bench("--quick", "--only", "batch/10", "-o", out, "--compare", changed)
        assert done.exit_code == code, done.output
        assert f"1 {word}" in done.output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--only", "nonsense"], "--only"),
        (["--compare", "nothing.json"], "nothing.json"),
        (["--figure", "a.doc"], "a.doc"),
    ],
)
def test_mistakes_are_told_before_anything_is_measured(arguments, said, tmp_path):
    done = bench("--quick", "-o", tmp_path / "x.json", *arguments)
    assert done.exit_code == 2
    assert said in done.output
    assert not (tmp_path / "x.json").exists()


def test_wrong_poses_of_ours_end_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(races, "MOST_FAILURES", -1.0)
    done = bench("--quick", "--only", "batch/1", "-o", tmp_path / "x.json")
    assert done.exit_code == 1
    assert "batch/1: ours, default fails on" in done.output
