"""Nodes and their linear combinations for tables."""

from __future__ import annotations

import sympy

from cutjoint.formulate.natural.nodes import Form, Node, NodeKind
from cutjoint.model.records import Model, Scalar, Vector
from cutjoint.report.explain.latex import place, text
from cutjoint.report.explain.views import code

#: The rounding of a zero among coordinates in the design position, in m, and among coefficients.
_ROUNDING = 1e-13

#: A coefficient with more letters is not printed.
_LONG = 100


def form_text(form: Form, model: Model) -> str:
    """A combination as one piece of code: `hinge + 0.97*axis - 0.5*tip`."""
    coefficients = {node: _as_fraction(clean(c)) for node, c in form.items()}
    terms = " ".join(_term(c, node.name, model) for node, c in coefficients.items() if c != 0)
    return code(terms[2:] if terms.startswith("+") else f"-{terms[2:]}") if terms else "0"


def _term(e: Scalar, name: str, model: Model) -> str:
    """A term with its sign."""
    sign = "-" if e.could_extract_minus_sign() else "+"
    factor = text(-e if sign == "-" else e, model).strip("`")
    if factor == "1":
        return f"{sign} {name}"
    if len(factor) > _LONG:
        return f"+ ({sympy.count_ops(e)} operations)*{name}"
    return f"{sign} ({factor})*{name}" if e.is_Add else f"{sign} {factor}*{name}"


def _as_fraction(e: Scalar) -> Scalar:
    """An expression as one fraction, its numerator multiplied out."""
    numerator, denominator = sympy.fraction(sympy.together(e))
    return clean(sympy.expand(numerator)) / denominator


def design_value(node: Node, model: Model) -> str:
    """A node in the design position."""
    return "0" if node.kind is NodeKind.ANGLE else clean_place(node.place, model)


def clean_place(vector: Vector, model: Model) -> str:
    """A vector without what rounding has left of zeros."""
    x, y, z = (clean(component) for component in vector)
    return place((x, y, z), model)


def clean(x: Scalar, size: float = 1.0) -> Scalar:
    """An expression without what rounding has left of a zero, whole numbers in it as such; ``size`` is that of its parts."""
    e = sympy.sympify(x)
    if e.is_number:
        return sympy.Integer(0) if abs(float(e)) < _ROUNDING * size else e
    whole = (f for f in e.atoms(sympy.Float) if abs(f) < _ROUNDING or float(f).is_integer())
    return e.xreplace({f: sympy.Integer(round(f)) for f in whole})
