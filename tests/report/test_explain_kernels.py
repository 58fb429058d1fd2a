"""Rewritten parts of the explanation keep their value: numbers, laws, kernels behind a ball."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from cutjoint.kernels.joints import QUATERNION, derive_joint, rotation_of
from cutjoint.model.records import Joint, JointKind, Span
from cutjoint.report.explain.joints import _matrices
from cutjoint.report.explain.latex import latex, number, variants
from cutjoint.report.explain.laws import differentiate, expand_polynomials

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


def joint(kind: JointKind) -> Joint:
    x, y = (sympy.Float(0.6), sympy.Float(0.8), sympy.Float(0)), (sympy.Float(-0.8), sympy.Float(0.6), sympy.Float(0))
    at, to = (sympy.Integer(i) for i in (1, 2, 3)), (sympy.Float(f) for f in (2.0, 2.5, 4.0))
    return Joint(
        name="j", kind=kind, base="a", follower="b", at=tuple(at), axes=(x, y), to=tuple(to), pitch=sympy.Float(0.01), cut=None, guide=None,
        span=Span(file="m.yaml", line=1, column=1),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "is_reversed"),
    [(JointKind.DISTANCE, False), (JointKind.POINT_ON_LINE, True), (JointKind.FREE, False), (JointKind.PLANAR, True)],
)
def test_what_stands_behind_a_ball_makes_the_kernel_again(kind: JointKind, is_reversed: bool) -> None:
    kernel = derive_joint(joint(kind), is_reversed)
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


def test_laws_that_differ_are_printed_with_their_owners() -> None:
    assert variants(["left", "right"], [("F = 1",), ("F = 1",)]) == ("F = 1",)
    assert variants(["front_left", "right", "rear"], [("F = 1",), ("F = 2",), ("F = 1",)]) == (
        r"\text{front left, rear:}", "F = 1", r"\text{right:}", "F = 2",
    )  # fmt: skip
