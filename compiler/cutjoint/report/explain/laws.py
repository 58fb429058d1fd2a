"""Force laws for reading: polynomials written out, partial derivatives case by case."""

from collections.abc import Mapping, Sequence

import sympy

from cutjoint.formulate.forces import variable
from cutjoint.formulate.inputs import TIME
from cutjoint.model.expressions.operations import choice
from cutjoint.model.records import Model, Scalar
from cutjoint.report.explain.latex import parameter_symbols, sum_lines


def explain_law(name: str, law: Scalar, letters: Mapping[str, str], by: Sequence[str], model: Model) -> tuple[str, ...]:
    """A law over variables, given with their LaTeX, and its partial derivatives ``by`` some of them."""
    symbols = {**parameter_symbols(model), TIME: "t", **{variable(v): letter for v, letter in letters.items()}}
    shown = expand_polynomials(law)
    partials = (
        sum_lines(rf"\partial {name} / \partial {letters[x]}", differentiate(shown, variable(x)), symbols) for x in by
    )
    arguments = ", ".join(letters.values())
    return sum_lines(f"{name}({arguments})" if arguments else name, shown, symbols), *partials


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

