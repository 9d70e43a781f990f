"""What the workflows of .github promise: actions pinned, targets that exist, versions that are supported."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WORKFLOWS = {
    path.name: path.read_text(encoding="utf-8") for path in (ROOT / ".github/workflows").glob("*.yml")
}
ALL = "\n".join(WORKFLOWS.values())


def stated(file: str, pattern: str) -> str:
    """What a file says where the pattern's group is."""
    found = re.search(pattern, (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
    assert found, f"{file}: {pattern}"
    return found[1]


def listed(name: str) -> list[str]:
    """The values of a list `name: [a, "b"]` of ci.yml."""
    found = re.search(rf"^ +{name}: \[(.*)\]", WORKFLOWS["ci.yml"], re.MULTILINE)
    assert found, name
    return [value.strip(' "') for value in found[1].split(",")]


def minor(version: str) -> int:
    return int(version.split(".")[1])


@pytest.mark.parametrize("line", re.findall(r"uses: (.*)", ALL))
def test_an_action_is_pinned_by_the_hash_of_its_commit_and_says_its_version(line):
    if line.startswith("./"):  # a workflow of this repository
        assert (ROOT / line).is_file()
    else:
        assert re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", line)


def test_an_action_has_one_version_in_all_workflows():
    pins = set(re.findall(r"uses: ([\w-]+/[\w-]+)@(\S+)", ALL))
    assert len({action for action, _ in pins}) == len(pins)


def test_every_make_target_exists():
    called = set(re.findall(r"\bmake ([\w-]+)", ALL))
    targets = set(
        re.findall(r"^([\w-]+):(?!=)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    )
    assert {"lint", "docs"} <= called
    assert called <= targets


def test_every_python_from_the_oldest_supported_is_tested():
    versions = listed("python")
    oldest = stated("pyproject.toml", r'^requires-python = ">=(.*)"')
    assert versions[0] == oldest
    assert [minor(version) for version in versions] == list(range(minor(oldest), minor(versions[-1]) + 1))
    assert minor(versions[-1]) >= 14
    # the wheel is tried with the same two ends
    tried = re.findall(r'python-version: "(3\.\d+)"', WORKFLOWS["wheels.yml"])
    assert {versions[0], versions[-1]} == set(tried)


def test_the_systems_and_the_oldest_rust():
    runner, rust = listed("runner"), listed("rust")
    assert {name.split("-")[0] for name in runner} == {"ubuntu", "macos", "windows"}
    assert rust == ["stable", stated("Cargo.toml", r'^rust-version = "(.*)"')]


def test_nothing_may_write_but_the_jobs_that_publish():
    for name, text in WORKFLOWS.items():
        assert "\npermissions:\n  contents: read\n" in text, name
        written = re.findall(r"^ +([\w-]+): write$", text, re.MULTILINE)
        assert written == (["id-token"] * 2 if name == "release.yml" else []), name
    assert WORKFLOWS["release.yml"].count("needs: [ci, wheels, version]") == 2
