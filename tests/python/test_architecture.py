"""ARCHITECTURE.md: its rooms are those of the tree, its paths exist, its counts are right."""

import re
from pathlib import Path

import pytest
from test_layering import ROOMS

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "python" / "groundpose"
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
ROUNDED_TO = 500  # lines


def rooms(folder: str) -> list[str]:
    """The paths below a folder in the first column of the tables."""
    rows = re.findall(r"^\| (`.*?`) \|", PAGE, re.MULTILINE)
    return [path for row in rows for path in re.findall(rf"`({folder}/[^`]*)`", row)]


def lines_of_python(folder: Path, without: str = " ") -> int:
    files = [path for path in folder.rglob("*.py") if without not in path.relative_to(folder).parts]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def test_the_rooms_of_the_core_are_those_of_the_layering_test_in_its_order():
    table = (ROOT / "tests" / "layering.rs").read_text(encoding="utf-8").split("const ROOMS", 1)[1]
    tested = re.findall(r'\(\s*"(\w+)",\s*&\[', table.split("];", 1)[0])
    assert [Path(room).stem for room in rooms("src")] == tested


def test_the_rooms_of_the_package_are_those_of_the_layering_test_in_its_order():
    listed = [
        re.sub(r"\.pyi?$", "", room).removeprefix("python/groundpose/") for room in rooms("python/groundpose")
    ]
    assert [room.replace("/", ".") for room in listed] == [room for room in ROOMS if room not in ("", "lab")]


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
