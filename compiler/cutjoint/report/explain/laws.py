"""Force laws for reading: polynomials written out, partial derivatives case by case."""

from __future__ import annotations

import sympy

from cutjoint.formulate.inputs import TIME
from cutjoint.model.operations import choice
from cutjoint.model.records import Model, Scalar
from cutjoint.report.explain.latex import parameter_symbols, sum_lines

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
