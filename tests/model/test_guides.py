"""Guided joints: a law for each coordinate, and loops that guides leave no freedom."""

from __future__ import annotations

import pytest

from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import variable
from cutjoint.model.read import read_model_text

from .pendulum import PENDULUM, check, problems, read

HINGE = "hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}"
TUBE = "hinge: {kind: cylindrical, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}"
DRAG = 'drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}'
ON_ANGLE = DRAG.replace("joint: hinge", "joint: hinge, coordinate: angle")


@pytest.mark.parametrize(("kind", "count"), [("cylindrical", 2), ("universal", 2), ("planar", 3)])
def test_several_coordinates_have_a_law_each(kind: str, count: int) -> None:
    extra = ", axis_2: [1, 0, 0]" if kind == "universal" else ""
    laws = ["2*t", "{polynomial: [1, 2], of: t}", "swing"][:count]
    guided = HINGE.replace("revolute", kind).replace("axis:", f"guide: [{', '.join(laws)}]{extra}, axis:")
    joint = read(f"{HINGE}\nforces:\n  {DRAG}\n", f"{guided}\n").joints[0]
    assert joint.guide is not None
    assert [evaluate(law, {variable("t"): 3.0}) for law in joint.guide[:2]] == [6.0, 7.0]


PROBLEMS = [
    ("guide: §t", "@: joint 'hinge': guide needs a list of laws, one for each coordinate"),
    ("guide: §[t]",
     "@: joint 'hinge': guide has 1 law, a cylindrical joint 2 coordinates; give one for each of displacement, angle"),
    ("guide: [0, §1 m]", "@: joint 'hinge': guide needs an angle or a plain number, got m"),
    ("guide: [§5 deg*s, 0]", "@: joint 'hinge': guide needs m, got s"),
    ("cut: true, guide: §[0, 0]", "@: joint 'hinge': a cut joint has no coordinate to guide; remove cut or guide"),
]  # fmt: skip


@pytest.mark.parametrize(("fields", "expected"), PROBLEMS)
def test_problems(fields: str, expected: str | list[str]) -> None:
    check("cylindrical, ", f"cylindrical, {fields}, ", expected, PENDULUM.replace(HINGE, TUBE).replace(DRAG, ON_ANGLE))


LOOP = """\
cutjoint: 1
name: loop
gravity: [0, 0, -9.81]
bodies:
  one: {mass: 1, centre_of_mass: [1, 0, 0]}
  two: {mass: 1, centre_of_mass: [1, 0, 1]}
joints:
  first: {kind: revolute, bodies: [ground, one], at: [0, 0, 0], axis: [0, 1, 0]}
  second: {kind: revolute, bodies: [one, two], at: [1, 0, 0], axis: [0, 1, 0]}
  third: {kind: revolute, bodies: [two, ground], at: [2, 0, 1], axis: [0, 1, 0]}
"""
NO_FREEDOM = "it closes a loop without a degree of freedom: the motion of its bodies is prescribed by the guide of"


def guided(*names: str) -> str:
    text = LOOP
    for name in names:
        text = text.replace(f"  {name}: {{kind: revolute,", f"  {name}: {{kind: revolute, guide: t,")
    return text


def test_guides_that_leave_a_loop_no_freedom() -> None:
    assert problems(guided("first", "second")) == [
        f"m.yaml:10:3: joint 'third': {NO_FREEDOM} 'first', 'second'; leave a joint of the loop unguided"
    ]
    (found,) = problems(guided("first", "second", "third"))
    assert NO_FREEDOM in found


def test_a_guide_in_a_rigid_loop_has_no_freedom() -> None:
    rigid = guided("first").replace("second: {kind: revolute", "second: {kind: fixed").replace("[1, 0, 0], axis: [0, 1, 0]}", "[1, 0, 0]}")
    assert problems(rigid) == [f"m.yaml:10:3: joint 'third': {NO_FREEDOM} 'first'; leave a joint of the loop unguided"]


def test_one_guide_in_a_loop_and_rigid_loops_are_fine() -> None:
    assert read_model_text(guided("first"), "m.yaml").joints
    welded = LOOP.replace("revolute", "fixed").replace(", axis: [0, 1, 0]", "")
    assert read_model_text(welded, "m.yaml").joints
