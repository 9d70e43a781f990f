"""What is made of stored numbers: baseline, targets, stages, figure, page."""

import copy
import json
from pathlib import Path

import pytest
from groundpose import InputError
from groundpose.lab.bench import baseline, figure, page, stages, targets, tell
from groundpose.lab.bench.baseline import BETTER, GONE, LOST, SAME, UNSURE
from groundpose.lab.bench.cases import BATCHES, KEYPOINTS, PERCENTS, TWO_THREADS
from groundpose.lab.contenders.registry import DEFAULT, TO_BEAT
from groundpose.lab.evaluate import image_path, report

ROOT = Path(__file__).parents[2]


def line(method: str, us: float, ratio: float | None = None, spread: float = 0.02) -> dict:
    errors = {
        "objects": 100,
        "mean e_r deg": 2.0,
        "median e_r deg": 1.5,
        "mean e_t %": 3.0,
        "failures %": 1.0,
    }
    found = {"method": method, "objects a turn": 50, "us": us, "us quartiles": [0.9 * us, 1.1 * us], **errors}
    if ratio is not None:
        interval = [ratio * (1 - spread), ratio * (1 + spread)]
        found |= {
            "times ours": ratio,
            "times ours, quartiles": interval,
            "times ours, 95 %": interval,
            "turns": 60,
        }
    return found


def case(group: str, x: float, us: float, ratio: float = 5.0, **more) -> dict:
    lines = [line(DEFAULT, us), line(TO_BEAT, us * ratio, ratio)]
    return {
        "group": group,
        "x": x,
        "label": f"{group} {x}",
        "lines": lines,
        "left out": {"nobody": "why"},
    } | more


WORKS = {
    # work: (draws, hypotheses, steps, instructions) of one object with 28 keypoints
    "p1p of every keypoint": (0, 0, 0, 28 * 500),
    "one draw": (1, 5, 0, 1000 + 500 + 5 * 200),
    "search": (7, 33, 0, 1000 + 7 * 500 + 33 * 200),
    "search + gn": (7, 33, 3, 13_100),
    "search + re": (7, 33, 9, 21_100),
    "search + hre": (7, 33, 16, 31_100),
    "search + default": (7, 33, 6, 26_100),
    "search + default + covariance": (7, 33, 6, 27_100),
}
ROWS = [
    {
        "setting": "vehicle",
        "work": work,
        "objects": 10,
        "keypoints": 280,
        "draws": 10 * draws,
        "hypotheses": 10 * hypotheses,
        "steps": 10 * steps,
        "allocations": 0,
        "us per object": count / 2000,
        "instructions": 10 * count,
    }
    for work, (draws, hypotheses, steps, count) in WORKS.items()
]


@pytest.fixture
def content() -> dict:
    """A made-up run that has everything."""
    found = {"vehicles": case("vehicles", 0, 20.0, 9.0)}
    found |= {f"keypoints/{n}": case("keypoints", n, 0.5 * n) for n in KEYPOINTS}
    found |= {f"outliers/{p}": case("outliers", p, 100.0 + p, 250.0) for p in PERCENTS}
    found |= {f"shape/{m}": case("shape", m, 10.0 + m) for m in (0, 5, 10)}
    found["hre/5"] = case("shape", 5, 19.0, 2.0)
    for size in BATCHES:
        one = case("batch", size, 20.0 + 10.0 / size)
        one["lines"].append(line(TWO_THREADS, 11.0, 1 / 1.95))
        found[f"batch/{size}"] = one
    found |= {f"stages/{m}": case("stages", m, 20.0) for m in (0, 5)}
    found["machine"] = {
        "group": "machine",
        "gflops": 40.0,
        "memory GB/s": 10.0,
        "cache GB/s": 100.0,
    }
    found["overhead"] = {
        "group": "overhead",
        "us per call": {"median": 12.0},
        "us per call of an estimator": {"median": 7.0},
        "us per object": {"median": 0.2},
        "bytes per object": {"in": 1000.0, "out": 1000.0},
    }
    found["instructions"] = {"group": "instructions", "toolchain": "rustc 1", "rows": copy.deepcopy(ROWS)}
    found["native"] = {"group": "native", "settings": {"V1": {"ratio": 1.05}, "E1": {"ratio": 0.99}}}
    setup = {
        "seed": 0,
        "quick": False,
        "machine": "some",
        "versions": {"python": "3"},
        "libraries": {"PoseLib": "x"},
    }
    return {**setup, "cases": found, "pending": []}


# ---- baseline


def verdicts(content: dict, before: dict, asked: set[str] | None = None) -> dict[tuple[str, str], str]:
    found = baseline.compare(content, before, asked or set(content["cases"]))
    return {(d.case, d.what): d.verdict for d in found}


def test_the_same_run_has_lost_nothing(content, tmp_path):
    path = tmp_path / "baseline.json"
    baseline.save(content, path)
    found = verdicts(content, baseline.read(path))
    assert set(found.values()) == {SAME}
    assert ("instructions per object" in {what for _, what in found}) is True


@pytest.mark.parametrize(
    ("slower", "spread", "verdict"),
    [
        (1.05, 0.01, SAME),  # within the limit
        (1.20, 0.02, LOST),
        (1.12, 0.05, UNSURE),  # the interval reaches below the limit
        (1.20, 0.15, UNSURE),
        (0.80, 0.02, BETTER),
        (0.80, 0.30, SAME),
    ],
)
def test_relative_time_is_lost_when_its_whole_interval_is(content, slower, spread, verdict):
    before = baseline.of(content)
    content["cases"]["vehicles"]["lines"][1] = line(TO_BEAT, 100.0, 9.0 / slower, spread)
    found = verdicts(content, before)
    assert found.pop(("vehicles", f"time relative to {TO_BEAT}")) == verdict
    assert set(found.values()) == {SAME}


@pytest.mark.parametrize(
    ("key", "value", "verdict"),
    [
        ("failures %", 1.1, LOST),
        ("failures %", 0.9, BETTER),
        ("mean e_r deg", 2.003, SAME),
        ("mean e_r deg", 2.02, LOST),
        ("mean e_t %", 3.05, LOST),
    ],
)
def test_any_loss_of_accuracy_is_one(content, key, value, verdict):
    before = baseline.of(content)
    content["cases"]["outliers/90"]["lines"][0][key] = value
    assert verdicts(content, before)["outliers/90", key] == verdict


def test_more_instructions_are_a_loss(content):
    before = baseline.of(content)
    content["cases"]["instructions"]["rows"][5]["instructions"] *= 2
    found = verdicts(content, before, {"instructions"})
    assert found["vehicle: search + hre", "instructions per object"] == LOST
    assert list(found.values()).count(SAME) == len(WORKS) - 1


def test_what_was_not_measured_is_told_and_other_objects_do_not_compare(content):
    before = baseline.of(content)
    del content["cases"]["vehicles"]
    content["cases"]["hre/5"]["lines"][0]["objects"] = 7
    found = verdicts(content, before, {"vehicles", "hre/5"})
    assert found["vehicles", f"time relative to {TO_BEAT}"] == GONE
    assert found["hre/5", "accuracy (other objects)"] == GONE
    with pytest.raises(InputError, match="none in common"):
        verdicts(content, before, {"vehicles"})
    with pytest.raises(InputError, match="quick"):
        verdicts({**content, "quick": True}, before)


def test_files_that_are_no_baselines(content, tmp_path):
    other = tmp_path / "other.json"
    other.write_text("{}")
    with pytest.raises(InputError, match="--save-baseline"):
        baseline.read(other)
    with pytest.raises(FileNotFoundError):
        baseline.read(tmp_path / "none.json")
    with pytest.raises(InputError, match="none in it"):
        baseline.save({**content, "cases": {}}, other)


def test_the_table_tells_what_changed(content):
    before = baseline.of(content)
    assert tell.differences(baseline.compare(content, before, {"vehicles"})) is None
    content["cases"]["vehicles"]["lines"][0]["failures %"] = 5.0
    table = tell.differences(baseline.compare(content, before, {"vehicles"}))
    assert table is not None
    assert table.row_count == 1


# ---- targets


def test_targets_are_met_or_not_or_not_measured(content):
    found = {(each["measure"], each["what"]): each for each in targets.table(content["cases"])}
    values = {what: each["value"] for (_, what), each in found.items()}
    assert values[f"{TO_BEAT} / ours"] == "9 x"
    assert values["one thread / two, 10,000 objects"] == "1.95 x"
    assert values["exponent of keypoints, 66 to 1000"] == "1"
    assert all(each["met"] for (_, what), each in found.items() if what != "failures")
    content["cases"]["vehicles"]["lines"][1]["times ours"] = 7.9
    del content["cases"]["native"]
    lines = targets.table(content["cases"])
    assert lines[0]["met"] is False
    native = next(each for each in lines if each["measure"].startswith("wheel"))
    assert (native["value"], native["met"]) == ("not measured", None)
    assert targets.table({})[0]["value"] == "not measured"


def test_growth_is_told_by_its_exponent():
    cases = {f"k/{n}": case("k", n, 0.01 * n**2) for n in (10, 100)}
    assert targets.growth(cases, "k", (10, 100)) == pytest.approx(2.0)


# ---- stages


def test_stages_are_the_differences_the_rows_were_made_of():
    found = {stage["stage"]: stage for stage in stages.of(ROWS, "vehicle")}
    counts = {name: stage["instructions"] for name, stage in found.items()}
    assert counts["P1P of the draws"] == pytest.approx(7 * 500)
    assert counts["scores"] == pytest.approx(33 * 200)
    assert counts["set-up, test against chance, statistics"] == pytest.approx(1000)
    assert counts["refinement HRE"] == pytest.approx(20_000)
    assert counts["covariance"] == pytest.approx(1000)
    assert found["scores"]["operations"] == 33 * 28 * stages.RESIDUAL_FLOPS
    assert found["scores"]["us"] == pytest.approx(3.3)
    assert stages.of(ROWS[:-1], "vehicle") == []


def test_operations_grow_with_modes():
    assert stages.step_flops(0) == stages.SIMPLE_STEP_FLOPS < stages.step_flops(5) < stages.step_flops(10)
    assert stages.solve_flops(5) == pytest.approx(11**3 / 3 + 2 * 11**2)


def test_the_arm_estimate_is_a_range_around_its_middle():
    low, high, middle = stages.arm_us(120_000)
    assert (low, high) == pytest.approx((20.0, 80.0))
    assert middle == pytest.approx(40.0)


# ---- figure, tables and page


def test_the_figure_has_every_contender_and_says_what_is_missing(content, tmp_path):
    drawn = figure.draw(content["cases"])
    above, _ = drawn.subfigs
    assert [text.get_text() for text in above.legends[0].get_texts()] == [DEFAULT, TWO_THREADS, TO_BEAT]
    keypoints = above.axes[0]
    assert (keypoints.get_xscale(), keypoints.get_yscale()) == ("log", "log")
    assert len(keypoints.lines) == 2
    figure.write({}, tmp_path / "empty.png")
    empty = figure.draw({}).subfigs[0].axes[0]
    assert empty.texts[0].get_text() == "not measured"


def test_every_case_has_a_table(content):
    for name, one in content["cases"].items():
        assert tell.result(name, one).row_count > 0
    assert tell.target_table(content["cases"]).row_count == len(targets.VALUES)


def marks(body: str = "old") -> str:
    return "text\n" + "".join(
        f"<!-- measured {name}: begin -->\n{body}\n<!-- measured {name}: end -->\nmore\n"
        for name in page.BLOCKS
    )


def test_the_page_keeps_its_text_and_gets_its_tables(content):
    made = page.filled(marks(), content)
    assert "old" not in made
    assert made.count("more") == len(page.BLOCKS)
    for word in ("9 x", "Stages: vehicle", "Cortex-A78AE", "nobody: why", "40"):
        assert word in made
    assert page.filled(made, content) == made
    content["cases"] = {}
    assert "Not measured" in page.filled(made, content)
    with pytest.raises(InputError, match="measured on"):
        page.filled("no marks", content)


@pytest.mark.parametrize(
    ("results", "blocks"), [(page.RESULTS, page.BLOCKS), (image_path.OUT, page.IMAGE_BLOCKS)]
)
def test_the_committed_page_is_made_from_the_committed_numbers(results, blocks):
    stored = ROOT / results
    if not stored.exists():
        pytest.skip(f"no {results}")
    text = (ROOT / page.PAGE).read_text("utf-8")
    assert page.filled(text, report.read_json(stored), blocks) == text, "groundpose evaluate pages"


def test_the_committed_baseline_is_one():
    kept = ROOT / "results" / "bench_baseline.json"
    if not kept.exists():
        pytest.skip("no baseline")
    found = baseline.read(kept)
    assert found["reference"] == TO_BEAT
    assert found["times"]
    assert json.dumps(found["quick"]) == "false"
