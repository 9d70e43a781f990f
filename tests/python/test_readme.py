"""Every Python block of the README runs, in order and in one namespace, as a reader would run it."""

import re
from pathlib import Path

import pytest
from groundpose.keypoints.network import bundled

README = Path(__file__).parents[2] / "README.md"


def blocks() -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", README.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


@pytest.mark.skipif(not bundled().exists(), reason="the bundled network is not there")
def test_readme_code_runs(tmp_path, monkeypatch):
    found = blocks()
    assert found, "the README has no Python code"
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {"__name__": "readme"}
    for number, block in enumerate(found, 1):
        try:
            exec(compile(block, f"README.md, block {number}", "exec"), namespace)
        except Exception as error:
            pytest.fail(f"block {number}: {type(error).__name__}: {error}\n\n{block}")


def test_readme_table_is_what_was_measured():
    from groundpose.lab.evaluate import report

    solver = report.read_json(README.parent / report.SOLVER_JSON)
    text = README.read_text(encoding="utf-8")
    assert report.with_headline(text, solver) == text, "run: groundpose evaluate pages"


def test_package_docstring_runs():
    import doctest

    import groundpose

    assert doctest.testmod(groundpose).failed == 0
    assert doctest.testmod(groundpose).attempted > 0
