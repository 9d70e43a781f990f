"""The programs end to end with few trials: rows run, results are stored, the page says what is not met."""

import json
from pathlib import Path

import pytest
from groundpose.cli.main import app
from groundpose.lab.bench import targets as bench_targets
from groundpose.lab.evaluate import report, targets
from groundpose.lab.evaluate.rows import Context, Result, Row, to_json
from groundpose.lab.targets import AT_LEAST, TARGETS, Target
from typer.testing import CliRunner

QUICK_ROWS = [row for row in targets.ROWS if row.id not in ("memory", "real")]


@pytest.mark.parametrize("row", QUICK_ROWS, ids=lambda row: row.id)
def test_every_row_runs(row: Row) -> None:
    said: list[str] = []
    result = row.run(Context(trials=3, seed=0, advance=said.append))
    assert result.missing or result.checks
    assert said or result.missing
    json.dumps(to_json(row, result, "command"))


def test_accuracy_depends_on_trials_and_seed_only() -> None:
    row = next(row for row in targets.ROWS if row.id == "v1")
    first, second, other = (row.run(Context(trials=5, seed=seed)) for seed in (0, 0, 1))
    assert first.details[2] == second.details[2]
    assert first.details[2] != other.details[2]


def test_the_command_keeps_rows_it_was_not_asked_for(tmp_path: Path) -> None:
    out, command = tmp_path / "solver.json", ["evaluate", "targets"]
    for only in ("p1p", "e1-90"):
        CliRunner().invoke(app, [*command, "--trials", "2", "--only", only, "--out", str(out)])
    stored = json.loads(out.read_text(encoding="utf-8"))
    assert [row["id"] for row in stored["rows"]] == ["p1p", "e1-90"]
    assert stored["versions"]["numpy"]
    refused = CliRunner().invoke(app, [*command, "--only", "nonsense", "--out", str(out)])
    assert refused.exit_code == 2


@pytest.mark.parametrize(
    ("value", "comparison", "met"),
    [
        (1.0, "at most", True),
        (1.1, "at most", False),
        (1.1, "at least", True),
        (0.9, "at least", False),
        (float("nan"), "at most", False),
        (float("nan"), "at least", False),
    ],
)
def test_a_target_is_met_or_its_shortfall_is_told(value: float, comparison: str, met: bool) -> None:
    check = Target("a", "a", "a", 1.0, comparison).check(value)
    assert check.met is met
    assert bool(check.shortfall()) is not met


def test_the_page_tells_what_is_missed_and_what_was_not_measured(tmp_path: Path) -> None:
    fast = Target("a", "speed", "V1", 2.0, AT_LEAST, " x")

    def nothing(context: Context) -> Result:
        return Result([])

    rows = [
        to_json(Row("a", "speed", nothing), Result([fast.check(1.5)]), "run a"),
        to_json(Row("b", "memory", nothing), Result([], missing="no such thing here"), "run b"),
    ]
    content = {"command": "run", "versions": {"python": "3"}, "machine": "some", "rows": rows}
    report.write_json(tmp_path / report.SOLVER_JSON, content)
    page = report.write_page(tmp_path).read_text(encoding="utf-8")
    assert "| speed | V1 | 1.5 x | at least 2 x | **no** |" in page
    assert "missed by 0.5 (25.0 %)" in page
    assert "not measured: no such thing here" in page
    assert rows[1]["met"] is None


def test_stored_results_name_the_folder_of_the_data_by_its_variable(tmp_path, monkeypatch):
    """The folder is another one on every machine; the pages show the command as anyone can type it."""
    monkeypatch.setenv("GROUNDPOSE_DATA", "/mnt/sets")
    content = {"command": "groundpose evaluate kitti --root /mnt/sets/kitti", "rows": [0.123456789]}
    report.write_json(tmp_path / "any.json", content)
    kept = report.read_json(tmp_path / "any.json")
    assert kept == {"command": "groundpose evaluate kitti --root $GROUNDPOSE_DATA/kitti", "rows": [0.123457]}
    monkeypatch.delenv("GROUNDPOSE_DATA")
    report.write_json(tmp_path / "any.json", content)
    assert report.read_json(tmp_path / "any.json")["command"] == content["command"]


def test_every_number_has_one_target() -> None:
    """The targets of a run of `bench`, and of this program, are rows of one table; none is left over."""
    judged = set(bench_targets.VALUES)
    for row in QUICK_ROWS:
        judged |= {c.target.id for c in row.run(Context(trials=3, seed=0)).checks}
    assert judged | {"memory", "real above 15 deg", "real median e_r"} >= set(TARGETS)
    assert judged <= set(TARGETS)
