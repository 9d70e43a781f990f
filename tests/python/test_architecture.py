"""ARCHITECTURE.md: its rooms are those of the tree, its paths exist, its counts are right."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "python" / "groundpose"
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
ROUNDED_TO = 500  # lines


def rooms(folder: str) -> list[str]:
    """The paths in the first column of the tables, those below a folder."""
    rows = re.findall(r"^\| (`.*?`) \|", PAGE, re.MULTILINE)
    return [path for row in rows for path in re.findall(rf"`({folder}/[^`]*)`", row)]


def lines_of_python(folder: Path, without: str = " ") -> int:
    files = [path for path in folder.rglob("*.py") if without not in path.relative_to(folder).parts]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def test_the_rooms_of_the_core_are_those_of_the_layering_test_in_its_order():
    table = (ROOT / "tests" / "layering.rs").read_text(encoding="utf-8").split("const ROOMS", 1)[1]
    tested = re.findall(r'\(\s*"(\w+)",\s*&\[', table.split("];", 1)[0])
    assert [Path(room).stem for room in rooms("src")] == tested


def test_every_room_of_the_package_has_a_row():
    def own(path: Path) -> bool:
        return path.suffix in (".py", ".pyi") or any(path.glob("*.py"))

    found = {path for folder in (PACKAGE, PACKAGE / "lab") for path in folder.iterdir() if own(path)}
    found = {path for path in found if path.name not in ("__init__.py", "__main__.py", "lab")}
    assert {ROOT / room for room in rooms("python/groundpose")} == found


@pytest.mark.parametrize("name", ["ARCHITECTURE.md", "CONTRIBUTING.md"])
def test_the_paths_exist(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    named = re.findall(r"`((?:src|python|tests|docs|results|benches|examples)/[\w./]*)`", text)
    assert [path for path in named if not (ROOT / path).exists()] == []


@pytest.mark.parametrize(
    ("part", "count"),
    [
        ("runtime", lines_of_python(PACKAGE, without="lab")),
        ("laboratory", lines_of_python(PACKAGE / "lab")),
    ],
)
def test_the_lines_of_python(part, count):
    stated = int(re.search(rf"^\| {part} \| (\d+) \|$", PAGE, re.MULTILINE)[1])
    assert abs(stated - count) <= ROUNDED_TO, f"{part}: {ROUNDED_TO * round(count / ROUNDED_TO)}"
