"""Collected inputs of users end right, with a remark, or refused in a line that names the file."""

import cases
import pytest

INPUTS = dict(cases.inputs())


@pytest.mark.skipif(not INPUTS, reason=f"{cases.CASES} is not there")
@pytest.mark.parametrize("name", INPUTS)
def test_how_it_ends(name):
    ending, said = INPUTS[name]()
    assert ending in (cases.RIGHT, cases.REMARKED, cases.REFUSED)
    assert "\n" not in said
    assert len(said) < 600
