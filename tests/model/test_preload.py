"""Springs that say their force in the design position, or that they are free there."""

from __future__ import annotations

from typing import Any

import pytest

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.tasks.states import find_equilibrium
from tests.conftest import needs_cpp

TEXT = """\
cutjoint: 1
name: hook
gravity: [0, 0, -10]
parameters: {deep: {value: 0.4, binding: param}, high: {value: 0.3, unit: m}}
points: {A: [high, 0, 0], B: [0, 0, -deep]}
bodies: {block: {mass: 6, centre_of_mass: B}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: B, axis: [0, 0, 1]}}
forces: {rope: {kind: FORCE, law: LAW}}
outputs: [block.z]
scenes: {rest: {end: 1}}
"""
ROPE = TEXT.replace("FORCE", "point_spring, bodies: [ground, block], from: A, to: B")
RAIL = TEXT.replace("FORCE", "joint_force, joint: rail")
JOINT = TEXT.replace("forces: {rope: {kind: FORCE, law: LAW}}\n", "").replace("axis: [0, 0, 1]}", "axis: [0, 0, 1], spring: LAW}")


def value(text: str, law: str, **variables: float) -> float:
    """A force at its variables; the parameters have their values where none are given."""
    (force,) = read_model_text(text.replace("LAW", law), "hook.yaml").forces
    given = {"p_deep": 0.4, "p_high": 0.3, "rate": 0.0, **variables}
    found: Any = force.law
    return float(found.subs({symbol: given[symbol.name] for symbol in found.free_symbols}))


def test_a_tension_is_its_preload_at_the_drawn_length() -> None:
    """Of 0.5 m, by Pythagoras; opened points change it."""
    law = "{stiffness: 2 kN/m, damping: 30, preload: 3 kN}"
    assert value(ROPE, law, length=0.5) == pytest.approx(3000, rel=1e-14)
    assert value(ROPE, law, length=0.6, rate=-2.0) == pytest.approx(3000 + 200 - 60, rel=1e-14)
    assert value(ROPE, law, length=1.3, p_deep=1.2, p_high=0.5) == pytest.approx(3000, rel=1e-14)
    nested = "{sum: [{let: {k: 2000}, law: {stiffness: 2000, preload: 3000}}, 5]}"
    assert value(ROPE, nested, length=0.6) == pytest.approx(3205, rel=1e-14)
    assert value(ROPE, "{preload: -4 N}", length=9.0) == -4


def test_a_spring_is_free_as_it_is_drawn() -> None:
    assert value(ROPE, "{stiffness: 10, free_length: drawn}", length=0.5) == pytest.approx(0, abs=1e-14)
    assert value(ROPE, "{stiffness: 10, free_length: drawn}", length=0.7) == pytest.approx(2, rel=1e-14)
    assert value(RAIL, "{stiffness: 10, free_position: drawn}", position=0.3) == -3


def test_a_parameter_of_that_name_stays_one() -> None:
    text = ROPE.replace("parameters: {", "parameters: {drawn: {value: 0.1, binding: param}, ")
    assert value(text, "{stiffness: 10, free_length: drawn}", length=0.5, p_drawn=0.1) == pytest.approx(4, rel=1e-14)


@pytest.mark.parametrize("text", [RAIL, JOINT])
def test_a_force_on_a_coordinate_is_its_preload_at_zero(text: str) -> None:
    law = "{stiffness: 200 N/m, damping: 5, preload: 100 N}"
    assert value(text, law, position=0.0) == 100
    assert value(text, law, position=0.25, rate=2.0) == 100 - 50 - 10


@needs_cpp
@pytest.mark.parametrize("text", [RAIL, JOINT])
def test_a_weight_rests_where_the_preload_has_gone_down_to_it(text: str) -> None:
    """60 N of 100 N at 200 N/m, 0.2 m above the design position."""
    model = read_model_text(text.replace("LAW", "{stiffness: 200, preload: 100}"), "hook.yaml")
    assert find_equilibrium(model)["block.z"] == pytest.approx(-0.4 + 0.2, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "law", "message"),
    [
        (ROPE, "{stiffness: 2, preload: 3, free_length: 0.1}",
         "8:123: force 'rope': preload is the force where the file draws it, and free_length says another; leave free_length away"),
        (ROPE, "{stiffness: 2, preload: 3 m}", "law.preload needs N, got m"),
        (ROPE, "{stiffness: 2}", "a spring of this kind needs free_length; write free_length: drawn for what is drawn, or a preload"),
        (JOINT, "{stiffness: 2, preload: 3, free_position: 0}", "draws it, and free_position says another"),
    ],
)  # fmt: skip
def test_what_is_wrong(text: str, law: str, message: str) -> None:
    with pytest.raises(ModelError) as error:
        read_model_text(text.replace("LAW", law), "hook.yaml")
    assert message in str(error.value)
