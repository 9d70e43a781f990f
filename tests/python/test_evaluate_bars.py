"""The programs end to end with few trials: rows run, results are stored, the page says what is not met."""

import json
from pathlib import Path

import pytest
from groundpose.lab.evaluate import bars, report
from groundpose.lab.evaluate.rows import Check, Context, Result, to_json
from typer import Typer
from typer.testing import CliRunner

QUICK_ROWS = [row for row in bars.ROWS if row.id not in ("memory", "real")]


@pytest.mark.parametrize("row", QUICK_ROWS, ids=lambda row: row.id)
def test_every_row_runs(row: bars.Row) -> None:
    said: list[str] = []
    result = row.run(Context(trials=3, seed=0, advance=said.append))
    assert result.missing or result.checks
    assert said or result.missing
    json.dumps(to_json(row.id, row.measure, result, "command"))


def test_accuracy_depends_on_trials_and_seed_only() -> None:
    row = next(row for row in bars.ROWS if row.id == "v1")
    first, second, other = (row.run(Context(trials=5, seed=seed)) for seed in (0, 0, 1))
    assert first.details[2] == second.details[2]
    assert first.details[2] != other.details[2]


def test_the_command_keeps_rows_it_was_not_asked_for(tmp_path: Path) -> None:
    app, out = Typer(), tmp_path / "solver.json"
    app.command()(bars.main)
    for only in ("p1p", "e1-90"):
        CliRunner().invoke(app, ["--trials", "2", "--only", only, "--out", str(out)])
    stored = json.loads(out.read_text(encoding="utf-8"))
    assert [row["id"] for row in stored["rows"]] == ["p1p", "e1-90"]
    assert stored["versions"]["numpy"]
    refused = CliRunner().invoke(app, ["--only", "nonsense", "--out", str(out)])
    assert refused.exit_code == 2


@pytest.mark.parametrize(
    ("check", "met"),
    [
        (Check("a", 1.0, 1.0), True),
        (Check("a", 1.1, 1.0), False),
        (Check("a", 1.1, 1.0, "at least"), True),
        (Check("a", 0.9, 1.0, "at least"), False),
        (Check("a", float("nan"), 1.0), False),
        (Check("a", float("nan"), 1.0, "at least"), False),
    ],
)
def test_a_bar_is_met_or_its_shortfall_is_told(check: Check, met: bool) -> None:
    assert check.met is met
    assert bool(check.shortfall()) is not met


def test_the_page_tells_what_is_missed_and_what_was_not_measured(tmp_path: Path) -> None:
    rows = [
        to_json("a", "speed", Result([Check("V1", 1.5, 2.0, "at least", " x")]), "run a"),
        to_json("b", "memory", Result([], missing="no such thing here"), "run b"),
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
