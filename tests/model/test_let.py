"""Names for parts of laws."""

from __future__ import annotations

import pytest
import sympy

from cutjoint.model.expressions.parse import variable
from cutjoint.model.records import BodyLoad

from .pendulum import check, read

RATE, T = variable("rate"), variable("t")
LAW = '"-0.1*rate"'
DRAG = f"drag: {{kind: joint_force, joint: hinge, law: {LAW}}}"
LOAD = "air: {kind: load, body: arm, at: tip, "


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        ("{let: {slow: rate/10, drag: slow**3}, law: -drag - 2*slow}", -((RATE / 10) ** 3) - RATE / 5),
        ("{let: {slow: rate/10}, law: {sum: [slow, {let: {b: slow**2}, law: b + arm_mass}, {polynomial: [1, 2], of: t}]}}",
         RATE / 10 + RATE**2 / 100 + sympy.Symbol("p_arm_mass", real=True) + 1 + 2 * T),
        ("{let: {slow: rate/10}, law: {of: rate, piecewise: [{expression: 3*slow}]}}", 3 * RATE / 10),
    ],
)  # fmt: skip
def test_names_stand_for_what_they_are(law: str, expected: sympy.Expr) -> None:
    assert sympy.expand(read(LAW, law).forces[0].law - expected) == 0


def test_guides_and_inputs_have_them_too() -> None:
    model = read("fall: {end: 2}", "fall: {end: 2, inputs: {swing: {let: {s: 2*t}, law: sin(s)}}}")
    assert model.scenes["fall"].inputs["swing"] == sympy.sin(2 * T)
    guided = read("axis: [0, 1, 0]", "axis: [0, 1, 0], guide: {let: {s: 2*t}, law: s**2}")
    assert guided.joints[0].guide == (4 * T**2,)


def test_a_load_names_parts_of_its_components() -> None:
    load = read(DRAG, LOAD + "let: {v: sqrt(vx**2 + vz**2), c: 3*v}, force: [-c*vx, 0, -c*vz]}").forces[0]
    assert isinstance(load, BodyLoad)
    speed = sympy.sqrt(variable("vx") ** 2 + variable("vz") ** 2)
    assert load.components == (-3 * speed * variable("vx"), 0, -3 * speed * variable("vz"))


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        ("{let: {slow: rate/10}, law: §slo}", "law.law: unknown symbol 'slo'; did you mean 'slow'?"),
        ("{let: {§arm_mass: rate/10}, law: 1}", "law.let: 'arm_mass' is a parameter already; choose another name"),
        ("{let: {a: 1}, law: {let: {§a: 2}, law: a}}", "law.law.let: 'a' is a name above already; choose another name"),
        ("{let: {§rate: 3}, law: 1}", "law.let.rate: the name 'rate' has a meaning of its own in expressions; "
                                      "write for example 'rate_0'"),
        ("{let: {a: §b, b: 2}, law: 1}", "law.let.a: unknown symbol 'b'; symbols here: arm_length, arm_mass, pi, position, rate, swing, t"),
        ("{let: {a: 2 m}, law: §a}", "law.law needs N*m, got m"),
        ("{let: {a: 2}, law: {polynomial: [§a], of: rate}}", "law.law.polynomial: unknown symbol 'a'; symbols here: arm_length, "
                                                            "arm_mass, pi"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_names(law: str, expected: str) -> None:
    check(LAW, law, f"@: force 'drag': {expected}")


def test_a_load_has_no_names_of_motions() -> None:
    message = "let.vx: the name 'vx' has a meaning of its own in expressions; write for example 'vx_0'"
    check(DRAG, LOAD + "let: {§vx: 2}, force: [0, 0, 0]}", f"@: force 'air': {message}")


def test_a_let_without_a_law() -> None:
    check(LAW, "{let: {a: 2}}", "15:43: force 'drag': law: the field 'law' is missing")
