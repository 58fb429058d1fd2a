"""Parameters that follow from others."""

from __future__ import annotations

import pytest

from cutjoint.formulate.inputs import tunable_parameters
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import make_run_file

from .pendulum import check, problems

#: Half of a bar, whose mass and inertia follow from its length, which is open, in an order that is not theirs.
BAR = """\
cutjoint: 1
name: bar
gravity: [0, 0, -9.81]
parameters:
  inertia: {value: mass*reach**2/12, unit: kg*m^2}
  mass: density*section*reach
  reach: 2*half
  half: {value: 0.5, unit: m, binding: param}
  section: {value: 1, unit: cm^2}
  density: {value: 8000, unit: kg/m^3}
  lift: {value: 0.1, unit: m, binding: input}
  far: lift + half
bodies:
  bar: {mass: mass, centre_of_mass: [half, 0, 0], inertia: [0, inertia, inertia]}
joints:
  hinge: {kind: revolute, bodies: [ground, bar], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  pull: {kind: point_spring, bodies: [ground, bar], from: [0, 0, 1], to: [reach, 0, 0], law: "100*(length - far)"}
scenes:
  fall: {end: 1, positions: {hinge.angle: reach/1 m}}
"""


def bar() -> Model:
    return read_model_text(BAR.replace("reach/1 m", "0.1*half/section**0.5"), "bar.yaml")


def test_expressions_are_of_the_numbers_alone() -> None:
    model = bar()
    assert [p.name for p in model.parameters] == ["half", "section", "density", "lift"]
    assert [p.name for p in model.derived] == ["inertia", "mass", "reach", "far"]
    assert [p.name for p in tunable_parameters(model)] == ["half"]
    values = {p.symbol: p.value for p in model.parameters}
    assert evaluate(model.bodies[0].mass, values) == pytest.approx(0.8, rel=1e-15)
    assert evaluate(model.bodies[0].inertia[1], values) == pytest.approx(0.8 / 12, rel=1e-15)


def test_they_change_with_what_they_follow_from() -> None:
    model = bar()
    values = {p.symbol: 1.0 if p.name == "half" else p.value for p in model.parameters}
    assert evaluate(model.bodies[0].mass, values) == pytest.approx(1.6, rel=1e-15)
    found = make_run_file(model, model.scenes["fall"], {"half": 1.0}, task="simulate")
    assert found.parameters == {"half": 1.0}
    assert found.positions["hinge.angle"] == pytest.approx(10.0, rel=1e-15)


def test_they_are_not_set_themselves() -> None:
    model = bar()
    with pytest.raises(RunError) as error:
        make_run_file(model, model.scenes["fall"], {"mass": 1.0}, task="simulate")
    assert str(error.value) == "bar.yaml:6:3: parameter 'mass' follows from other parameters; set half"
    closed = read_model_text(BAR.replace("reach/1 m", "0").replace(", binding: param", ""), "bar.yaml")
    with pytest.raises(RunError, match="parameter 'mass' follows from other parameters; give one of them binding: param and set that"):
        make_run_file(closed, closed.scenes["fall"], {"mass": 1.0}, task="simulate")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("mass: density", "mass: §mass + half*density", "@: parameter 'mass': value: it follows from itself; give it a number"),
        ("reach: 2*half", "reach: §2*halb", "@: parameter 'reach': value: unknown symbol 'halb'; did you mean 'half'?"),
        ("reach: 2*half", "reach: {value: §half, unit: kg}", "@: parameter 'reach': value needs kg, got m"),
        ("reach: 2*half", "reach: {value: 2*half, unit: §mm}", "@: parameter 'reach': unit: an expression of parameters is in SI units, "
                                                              "not in mm; write unit: m"),
        ("reach: 2*half", "reach: {value: 2*half, binding: §param}", "@: parameter 'reach': binding: it changes with the parameters that "
                                                                   "it follows from; remove binding"),
        ("reach: 2*half", "reach: §half + density", "@: parameter 'reach': value: m and kg/m^3 cannot be added or compared"),
        ("reach: 2*half", "reach: §density*half/(half - 0.5)", "@: parameter 'reach': value has no finite value"),
        ("mass: mass", "mass: §far", "@: body 'bar': mass: the input 'far' cannot be used here, it may change with time; "
                                     "use binding: param"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_them(old: str, new: str, expected: str) -> None:
    check(old, new, expected, BAR.replace("reach/1 m", "0"))


def test_each_circle_is_named_once() -> None:
    text = BAR.replace("reach/1 m", "0").replace("{value: 1, unit: cm^2}", "mass/reach")
    text = text.replace("half: {value: 0.5,", "half: {value: reach,")
    assert problems(text) == [
        "m.yaml:6:9: parameter 'mass': value: it follows from 'section', 'mass' in a circle; give one of them a number",
        "m.yaml:7:10: parameter 'reach': value: it follows from 'half', 'reach' in a circle; give one of them a number",
    ]


def test_a_long_chain_in_reversed_order() -> None:
    length = 400
    lines = "\n".join(f"  p{i}: p{i + 1} + 1" for i in range(length))
    model = read_model_text(BAR.replace("reach/1 m", "0").replace("parameters:\n", f"parameters:\n{lines}\n  p{length}: 5\n"), "bar.yaml")
    first = next(p for p in model.derived if p.name == "p0")
    assert evaluate(first.value, {p.symbol: p.value for p in model.parameters}) == length + 5
