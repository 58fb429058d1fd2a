"""Force laws for reading: polynomials written out, partial derivatives case by case.

The tyre's law stands in steps, each with its partial derivatives (Frik, Leister, Schwartz 1993).
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy

from cutjoint.formulate.inputs import TIME
from cutjoint.model.operations import choice
from cutjoint.model.records import Model, Scalar
from cutjoint.report.explain.latex import latex, lines, parameter_symbols, sum_lines

# Laws

RATE = sympy.Symbol("rate", real=True)


def explain_law(name: str, law: Scalar, variable: str, symbol: str, model: Model) -> tuple[str, ...]:
    """A law over a variable and its rate, and its partial derivatives; ``symbol`` is the LaTeX of the variable."""
    position = sympy.Symbol(variable, real=True)
    symbols = law_symbols(model) | {position: symbol, RATE: rf"\dot {symbol}"}
    shown = expand_polynomials(law)
    partials = (sum_lines(rf"\partial {name} / \partial {symbols[x]}", differentiate(shown, x), symbols) for x in (position, RATE))
    return sum_lines(rf"{name}({symbol}, \dot {symbol})", shown, symbols), *partials


def law_symbols(model: Model) -> dict[Scalar, str]:
    """The LaTeX of what every law may use."""
    return {**parameter_symbols(model), TIME: "t"}


def expand_polynomials(law: Scalar) -> Scalar:
    """A law with its polynomials in Horner's form written out; those in a shifted variable stay."""
    if _is_horner(law):
        return sympy.expand(law)
    return law.func(*[expand_polynomials(a) for a in law.args]) if law.args else law


def differentiate(law: Scalar, x: Scalar) -> Scalar:
    """The partial derivative of a law, case by case under the law's own conditions."""
    if isinstance(law, sympy.Add):
        return sympy.Add(*[differentiate(a, x) for a in law.args])
    if not isinstance(law, sympy.Piecewise):
        return sympy.diff(law, x)
    cases = [(differentiate(value, x), when) for value, when in law.args]
    return cases[0][0] if len({value for value, _ in cases}) == 1 else choice(*cases)


def _is_horner(e: Scalar) -> bool:
    """Return whether e is a polynomial in one symbol whose products have one sum at most: a + x (b + x (c + ...))."""
    if not isinstance(e, sympy.Add | sympy.Mul) or len(e.free_symbols) != 1:
        return False
    products = [p for p in sympy.preorder_traversal(e) if not isinstance(p, sympy.Add | sympy.Symbol | sympy.Number)]
    return all(isinstance(p, sympy.Mul) and sum(isinstance(a, sympy.Add) for a in p.args) < 2 for p in products)


# The tyre


def _real(names: str) -> list[Scalar]:
    return list(sympy.symbols(names, real=True))


Fz, ALPHA, GAMMA, A, FY = _real("Fz alpha gamma a Fy")
A0, A1, A2, A3, A4, B1, B3, B4, SN, AF1, AF2 = _real("A0:5 B1 B3 B4 SN AF1:3")
CAPPED, CORNERING, CAMBER, LIMIT = _real("capped cornering camber limit")


@dataclass(frozen=True, kw_only=True)
class Step:
    """One intermediate quantity of the model, over earlier ones."""

    symbol: Scalar
    value: Scalar


#: Lateral force and aligning moment, as `calspan` of `elements.interactions.road_contact` has them for a load Fz > 0 with a limit > 0.
CALSPAN = (
    Step(symbol=CAPPED, value=sympy.Min(Fz, A2)),
    Step(symbol=CORNERING, value=A0 + A1 * CAPPED * (A2 - CAPPED) / A2),
    Step(symbol=CAMBER, value=A3 * (A4 - CAPPED) * CAPPED / A4),
    Step(symbol=LIMIT, value=(B1 * Fz + B3 + B4 * Fz**2) * SN * Fz),
    Step(symbol=A, value=-(CORNERING * ALPHA + CAMBER * GAMMA) / LIMIT),
    Step(symbol=FY, value=LIMIT * sympy.Piecewise((A - A * sympy.Abs(A) / 3 + A**3 / 27, sympy.Abs(A) < 3), (sympy.sign(A), True))),
)
MOMENT = (AF1 * Fz + AF2 * sympy.Abs(FY)) * FY

_SYMBOLS = {
    Fz: "F_z", ALPHA: r"\alpha", GAMMA: r"\gamma", A: "a", FY: "F_y", CAPPED: "F_c", CORNERING: r"C_\alpha", CAMBER: r"C_\gamma",
    LIMIT: r"F_{lim}", **{s: f"{s.name.rstrip('0123456789')}_{{{s.name[-1]}}}" for s in (A0, A1, A2, A3, A4, B1, B3, B4)},
    SN: r"\text{ SN }", AF1: r"\text{ AF1 }", AF2: r"\text{ AF2 }",
}  # fmt: skip


def partials() -> tuple[tuple[str, Scalar, Scalar, Scalar], ...]:
    """Name, quantity, variable and derivative of what matters to the motion, below the limit."""
    inside = A - A * sympy.Abs(A) / 3 + A**3 / 27
    slope = LIMIT * sympy.diff(inside, A).subs(A * sympy.sign(A), sympy.Abs(A))
    (demand,) = (step.value for step in CALSPAN if step.symbol == A)
    moment = sympy.diff(MOMENT, FY).subs(FY * sympy.sign(FY), sympy.Abs(FY))
    return (
        (r"\partial F_y / \partial \alpha", FY, ALPHA, slope * sympy.diff(demand, ALPHA)),
        (r"\partial F_y / \partial \gamma", FY, GAMMA, slope * sympy.diff(demand, GAMMA)),
        (r"\partial M_z / \partial F_y", MOMENT, FY, moment),
    )


def explain_calspan() -> tuple[str, ...]:
    """The steps, and the derivatives."""
    steps = lines(f"{_SYMBOLS[step.symbol]} &= {latex(step.value, _SYMBOLS)}" for step in CALSPAN)
    derivatives = (f"{name} = {latex(derivative, _SYMBOLS)}" for name, _, _, derivative in partials())
    return steps, f"M_z = {latex(MOMENT, _SYMBOLS)}", r"\partial F_z / \partial \delta = k n_z", *derivatives
