"""Rewritten parts of the explanation keep their value: numbers, laws, kernels behind a ball, the tyre in steps."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from cutjoint.elements.interactions.road_contact import calspan
from cutjoint.kernels.joints import QUATERNION, derive_joint, rotation_of
from cutjoint.model.records import Joint, JointKind, Span
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.report.explain import laws as tyre
from cutjoint.report.explain.joints import _matrices
from cutjoint.report.explain.latex import latex, number, variants
from cutjoint.report.explain.laws import differentiate, expand_polynomials
from cutjoint.topology.records import TreeJoint

LENGTH, RATE = sympy.Symbol("length", real=True), sympy.Symbol("rate", real=True)


@pytest.mark.parametrize(
    ("x", "text"),
    [
        (0.0, "0"), (-0.0, "0"), (1260.0, "1260"), (0.364325, "0.364325"), (-4.64e-05, "-4.64e-5"), (1e9, "1e9"), (52796000.0, "52796000"),
        (1 / 3, "0.3333333"), (0.0001, "0.0001"), (123456789.0, "123456800"), (2.18e-11, "2.18e-11"), (-9.81, "-9.81"), (0.1 + 0.2, "0.3"),
    ],
)  # fmt: skip
def test_numbers_have_seven_digits(x: float, text: str) -> None:
    assert number(x, times="e{}") == text


def test_latex_keeps_clear_of_markdown() -> None:
    spring = sympy.Symbol("p_spring_rate", real=True)
    e = sympy.Piecewise((spring * LENGTH**2, LENGTH < 1), (-2.5e-7, True))
    text = latex(e, {spring: r"\text{ spring rate }", LENGTH: r"\ell"})
    assert text == (
        r"\begin{cases} \ell^{2} \text{ spring rate } & \text{if } \ell \lt 1 \cr -2.5 \cdot 10^{-7} & \text{otherwise} \end{cases}"
    )


LAWS = {
    "horner": LENGTH * (LENGTH * (3.0 * LENGTH - 2.0) + 5.0) - 7.0,
    "pieces": 2 * RATE + sympy.Piecewise((3 * LENGTH, LENGTH < 0.1), (LENGTH * (4 * LENGTH + 1.0), True)),
    "two conditions": sympy.Piecewise((-LENGTH, sympy.And(LENGTH < 0.3, RATE > 0)), (RATE, LENGTH < 0.6), (0, True)),
    "product": RATE * sympy.Piecewise((LENGTH, LENGTH < 0.5), (2, True)),
}


@pytest.mark.parametrize("law", LAWS)
def test_laws_are_rewritten_without_changing_them(law: str) -> None:
    given = LAWS[law]
    shown = expand_polynomials(given)
    for length, rate in ((0.05, 1.0), (0.4, -0.7), (0.9, 0.2)):
        at = {LENGTH: length, RATE: rate}
        assert float(shown.subs(at)) == pytest.approx(float(given.subs(at)))
        for x in (LENGTH, RATE):
            h = 1e-6
            slope = (given.subs({**at, x: at[x] + h}) - given.subs({**at, x: at[x] - h})) / (2 * h)
            assert float(differentiate(shown, x).subs(at)) == pytest.approx(float(slope), abs=1e-6)


def test_polynomials_are_written_out_but_for_shifted_ones() -> None:
    assert expand_polynomials(LAWS["horner"]) == 3.0 * LENGTH**3 - 2.0 * LENGTH**2 + 5.0 * LENGTH - 7.0
    shifted = (LENGTH - 0.3) * (2.0 + (LENGTH - 0.3) * 5.0)
    assert expand_polynomials(shifted) == shifted


def joint(kind: JointKind, is_reversed: bool) -> TreeJoint:
    x, y = (sympy.Float(0.6), sympy.Float(0.8), sympy.Float(0)), (sympy.Float(-0.8), sympy.Float(0.6), sympy.Float(0))
    at, to = (sympy.Integer(i) for i in (1, 2, 3)), (sympy.Float(f) for f in (2.0, 2.5, 4.0))
    record = Joint(
        name="j", kind=kind, base="a", follower="b", at=tuple(at), axes=(x, y), to=tuple(to), pitch=sympy.Float(0.01), cut=None, guide=None,
        span=Span(file="m.yaml", line=1, column=1),
    )  # fmt: skip
    return TreeJoint(joint=record, parent="a", child="b", reversed=is_reversed)


@pytest.mark.parametrize(
    ("kind", "is_reversed"),
    [(JointKind.DISTANCE, False), (JointKind.POINT_ON_LINE, True), (JointKind.FREE, False), (JointKind.PLANAR, True)],
)
def test_what_stands_behind_a_ball_makes_the_kernel_again(kind: JointKind, is_reversed: bool) -> None:
    kernel = derive_joint(joint(kind, is_reversed))
    rng = np.random.default_rng(5)
    e = rng.standard_normal(4)
    point = dict(zip((*kernel.q, *kernel.u), map(float, rng.uniform(-1, 1, 20)), strict=False))
    point |= dict(zip(QUATERNION, map(float, e / np.linalg.norm(e)), strict=True))
    R = rotation_of(QUATERNION).subs(point)
    turned = dict(point)
    if kernel.has_ball:
        turned |= dict(zip(kernel.u[-3:], R.T * sympy.Matrix([point[w] for w in kernel.u[-3:]]), strict=True))
    found = {}
    for name, m in _matrices(kernel):
        before = R if name.startswith("R(e)^T") else sympy.diag(R, R)
        found[name.split(" ")[-1]] = before * m.subs(turned) if "^T" in name else m.subs(point)
    subspace = found["S"] if "S" in found else sympy.Matrix.hstack(found["S_z"], found["S_e"])
    for shown, true in (
        (found["R(q)"], kernel.rotation), (found["p(q)"], kernel.displacement), (subspace, kernel.subspace), (found["c"], kernel.drift),
    ):  # fmt: skip
        assert float((shown - true.subs(point)).norm()) < 1e-12


CONSTANTS = {"A0": 2625, "A1": 14.47, "A2": 12930, "A3": 2.29, "A4": 18175, "B1": -4.64e-5, "B3": 1.216, "B4": 2.18e-11, "SN": 1.0274,
             "AF1": -1.71e-5, "AF2": 1.71e-5}  # fmt: skip
STATES = [(3000.0, 0.02, 0.01), (6000.0, -0.04, 0.03), (15000.0, 0.3, -0.02)]


def compiled(load: float, slip: float, camber: float) -> tuple[float, float]:
    """Lateral force and aligning moment as the compiler computes them."""
    b = Builder()
    column = b.symbol("x", 3, BindingTime.ITERATION)
    results = calspan(b, {n: b.number(c) for n, c in CONSTANTS.items()}, *(b.element(column, i) for i in range(3)))
    values = interpret_blocks(results, {"x": np.array([load, slip, camber])}, {})
    return float(values[results[0]][0, 0]), float(values[results[1]][0, 0])


def in_steps(load: float, slip: float, camber: float) -> dict[sympy.Symbol, float]:
    """Every quantity of the printed steps."""
    known = {sympy.Symbol(n, real=True): c for n, c in CONSTANTS.items()}
    known |= {tyre.Fz: load, tyre.ALPHA: slip, tyre.GAMMA: camber}
    for step in tyre.CALSPAN:
        known[step.symbol] = float(step.value.subs(known))
    return known


@pytest.mark.parametrize("state", STATES)
def test_the_printed_tyre_is_the_compiled_one(state: tuple[float, float, float]) -> None:
    side, moment = compiled(*state)
    known = in_steps(*state)
    assert known[tyre.FY] == pytest.approx(side, rel=1e-12)
    assert float(tyre.MOMENT.subs(known)) == pytest.approx(moment, rel=1e-12)


@pytest.mark.parametrize("state", STATES[:2])
def test_the_printed_derivatives_of_the_tyre(state: tuple[float, float, float]) -> None:
    known, h = in_steps(*state), 1e-7
    load, slip, camber = state
    by_slip = (compiled(load, slip + h, camber)[0] - compiled(load, slip - h, camber)[0]) / (2 * h)
    by_camber = (compiled(load, slip, camber + h)[0] - compiled(load, slip, camber - h)[0]) / (2 * h)
    (plus, minus) = (compiled(load, slip + d, camber) for d in (h, -h))
    by_side = (plus[1] - minus[1]) / (plus[0] - minus[0])
    printed = [float(derivative.subs(known)) for _, _, _, derivative in tyre.partials()]
    assert printed == pytest.approx([by_slip, by_camber, by_side], rel=1e-5)


def test_laws_that_differ_are_printed_with_their_owners() -> None:
    assert variants(["left", "right"], [("F = 1",), ("F = 1",)]) == ("F = 1",)
    assert variants(["front_left", "right", "rear"], [("F = 1",), ("F = 2",), ("F = 1",)]) == (
        r"\text{front left, rear:}", "F = 1", r"\text{right:}", "F = 2",
    )  # fmt: skip
