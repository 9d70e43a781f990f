"""Damaged files are read, or refused with an error that names them: a few of each kind, always the same.

`python tests/python/mutations.py` tries 300,000; results/mutations.json has what it found.
"""

import json
from pathlib import Path

import mutations
import pytest

KINDS = mutations.kinds()
RESULTS = Path(__file__).parents[2] / "results" / "mutations.json"


@pytest.mark.parametrize("name", KINDS)
def test_damaged_files_are_read_or_refused(name):
    kind = KINDS[name]
    with mutations.scratch() as folder:
        found = mutations.attempt(kind, 6 + int(24 * kind.share), name, folder)
    assert not found.untyped, found.examples
    assert not found.unnamed, found.examples
    assert found.refused


def test_whole_files_are_read(tmp_path):
    for kind in KINDS.values():
        path = tmp_path / kind.name
        for content in kind.seeds:
            path.write_bytes(content)
            found = mutations.Found()
            mutations._read(kind, path, content, found)
            assert found.read, content[:200]


def test_the_long_run_found_nothing():
    found = json.loads(RESULTS.read_text(encoding="utf-8"))
    assert set(found["kinds"]) == set(KINDS)
    assert found["total"]["tried"] >= 300_000
    assert found["total"]["untyped"] == found["total"]["unnamed"] == 0
