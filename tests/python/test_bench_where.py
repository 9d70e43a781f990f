"""Where instructions go, from a callgrind file."""

from groundpose.lab.bench.where import PARTS, parts_of

PROFILE = """\
events: Ir
fn=(1) V3::imp'groundpose::refine::objective::Objective::linearise'groundpose::estimate::pipeline::answer
10 70
+2 30
cfn=(2) libm::math::log::log'groundpose::refine::objective::Objective::linearise
calls=3 5
* 12
fn=(2)
5 12
fn=(3) groundpose::estimate::pipeline::answer'groundpose::estimate::pipeline::estimate_ideal
1 5
fn=(4) instructions::common::Work::run
-1 1
totals: 118
"""


def test_every_instruction_counts_once_and_for_its_innermost_part() -> None:
    found = parts_of(PROFILE)
    assert found == {"normal equations": 112, "steps: elimination, new poses, decisions": 5, "other": 1}
    assert set(found) <= {part for part, _ in PARTS} | {"other"}
