"""The documentation: its notebooks and code run, its commands exist, its hooks do what they say."""

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from groundpose.keypoints.network import bundled

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))
# what a notebook imports beyond the package's own requirements
EXTRAS = {"solver_with_your_own_models": ("cv2", "poselib")}
WITHOUT = "not installed; pip install '.[docs]'"


def cells(path: Path) -> list[dict]:
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def hook(name: str) -> ModuleType:
    pytest.importorskip("mkdocs", reason=f"mkdocs is {WITHOUT}")
    pytest.importorskip("griffe", reason=f"griffe is {WITHOUT}")
    spec = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / "hooks" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_there_are_two_notebooks_without_outputs():
    assert len(NOTEBOOKS) == 2
    for path in NOTEBOOKS:
        code = [cell for cell in cells(path) if cell["cell_type"] == "code"]
        assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code), path.name


@pytest.mark.skipif(not bundled().exists(), reason="the bundled network is not there")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path, monkeypatch):
    for module in EXTRAS.get(path.stem, ()):
        pytest.importorskip(module, reason=f"{module} is {WITHOUT}")
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {"__name__": "notebook"}
    try:
        for number, cell in enumerate(cells(path)):
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), namespace)
    finally:
        plt.close("all")


def test_the_guide_to_evaluation_computes_errors(batch, poses):
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "guides/evaluate.md").read_text("utf-8"), re.DOTALL)
    namespace = {"poses": poses, "true_t": batch.t, "true_R": batch.R}
    for block in blocks:
        exec(block, namespace)
    assert np.nanmedian(namespace["distance_error"]) < 1.0
    assert np.degrees(np.nanmedian(namespace["rotation_error"])) < 5.0


def test_commands_of_the_guides_exist():
    sections = dict(
        re.findall(r"^#+ `(groundpose[^`]*)`\n(.*?)(?=^#|\Z)", hook("command_line").page(), re.M | re.S)
    )
    assert len(sections) > 10
    pages = [*DOCS.glob("guides/*.md"), DOCS / "estimate.md", DOCS / "simulation.md", DOCS / "model.md"]
    lines = [line for page in pages for line in page.read_text("utf-8").splitlines()]
    count = 0
    for line in filter(re.compile("groundpose [a-z]").match, lines):
        command = line.split(" #")[0]
        known = max((name for name in sections if f"{command} ".startswith(f"{name} ")), key=len)
        assert known != "groundpose", line
        for option in re.findall(r" (--?[a-z][a-z0-9-]*)", command):
            assert f"`{option}`" in sections[known], line
        count += 1
    assert count > 15


def test_files_that_the_method_names_exist():
    names = re.findall(r"`(\w+/\w+\.rs)`", (DOCS / "method.md").read_text("utf-8"))
    assert len(names) > 8
    assert [
        name for name in names if not any((folder / name).exists() for folder in (ROOT, ROOT / "src"))
    ] == []


@pytest.mark.parametrize(
    ("page", "text", "shown"),
    [
        ("index.md", "[a](docs/results.md#v1)", "[a](results.md#v1)"),
        ("index.md", '<img src="docs/demo.png">', '<img src="demo.png">'),
        ("guides/evaluate.md", "![a](../demo.png)", "![a](../demo.png)"),
        ("embedded.md", "[examples/embedded](../examples/embedded)", "`examples/embedded`"),
        ("embedded.md", "[the start](../README.md)", "[the start](index.md)"),
        ("embedded.md", "[a](../no_such_file.md)", "[a](../no_such_file.md)"),
        ("embedded.md", "[a](https://example.org/b)", "[a](https://example.org/b)"),
        ("index.md", "```\n[a](docs/results.md)\n```", "```\n[a](docs/results.md)\n```"),
    ],
)
def test_links_between_pages_and_repository(page, text, shown):
    class Page:
        class file:
            src_uri = page

    assert hook("repository").on_page_markdown(text, Page) == shown


def test_docstrings_become_entries_and_blocks():
    text = (
        "One.\n\n>>> f(1)\n2\n\nArgs:\n    a, b: two\n        lines. c: third.\n\n"
        "Raises:\n    OSError: x. TypeError: y."
    )
    assert hook("docstrings").readable(text).splitlines() == [
        *("One.", "", "```pycon", ">>> f(1)", "2", "```", "", "Args:"),
        *("    a: two", "        lines.", "    b: two", "        lines.", "    c: third.", "", "Raises:"),
        *("    OSError: x.", "    TypeError: y."),
    ]
