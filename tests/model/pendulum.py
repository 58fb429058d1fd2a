"""A small model to vary, and what reading it says."""

from __future__ import annotations

import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model

PENDULUM = """\
cutjoint: 1
name: pendulum
gravity: [0, 0, -9.81]
parameters:
  arm_mass: {value: 2, unit: kg, binding: param}
  arm_length: {value: 1.5, unit: m}
  swing: {value: 0, binding: input}
points:
  tip: [arm_length, 0, 0]
bodies:
  arm: {mass: arm_mass, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.2, 0.2]}
joints:
  hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  drag: {kind: joint_force, joint: hinge, law: "-0.1*rate"}
markers:
  end: {body: arm, at: tip}
outputs: [end.x]
scenes:
  fall: {end: 2}
"""


def varied(old: str, new: str, text: str = PENDULUM) -> str:
    """A model's text, by default the pendulum's, with one passage replaced."""
    assert text.count(old) == 1, f"'{old}' is not unique"
    return text.replace(old, new)


def read(old: str = "pendulum", new: str = "pendulum") -> Model:
    """The varied pendulum."""
    return read_model_text(varied(old, new), "m.yaml")


def problems(text: str) -> list[str]:
    """Problems of reading ``text``, a line a problem."""
    with pytest.raises(ModelError) as caught:
        read_model_text(text, "m.yaml")
    return str(caught.value).splitlines()


def read_with(text: str, *changes: tuple[str, str]) -> Model:
    """The model of a text in which the first places of some passages are changed."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return read_model_text(text, "m.yaml")


def problems_with(text: str, *changes: tuple[str, str]) -> list[str]:
    """The problems of that."""
    with pytest.raises(ModelError) as caught:
        read_with(text, *changes)
    return [str(problem) for problem in caught.value.problems]


def check(old: str, new: str, expected: str | list[str], model: str = PENDULUM) -> None:
    """Check the problems of a varied model.

    A problem at "@" stands where ``new`` has the mark "§"; others give line and column.
    """
    text = varied(old, new, model)
    before = text.split("§")[0]
    here = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
    wanted = [expected] if isinstance(expected, str) else expected
    assert problems(text.replace("§", "")) == [f"m.yaml:{line.replace('@', here, 1)}" for line in wanted]


def problem(old: str, new: str) -> str:
    """The only problem of the varied pendulum."""
    found = problems(varied(old, new))
    assert len(found) == 1, "\n".join(found)
    return found[0]
