"""Expressions of model files, from text by way of SymPy to blocks, against Python's own evaluation of the text."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from cutjoint.formulate.translate import Translator
from cutjoint.model.expressions.operations import Term
from cutjoint.model.expressions.parse import read_term, variable
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import Lowering
from tests.oracles.scalars import interpret_scalars

NAMES = ("length", "rate", "t")
SMOOTH = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "sqrt", "exp", "log")
PYTHON = {
    **{name: getattr(math, name) for name in SMOOTH},
    "min": min, "max": max, "abs": abs, "sign": lambda x: (x > 0) - (x < 0), "where": lambda c, a, b: a if c else b,
    "__builtins__": {},
}  # fmt: skip

numbers = st.sampled_from(["0", "1", "2", "-1", "0.5", "-2.5", "1e-3", "3"])
conditions = ("({a}) < ({b})", "({a}) <= ({b}) and ({b}) > -1", "({a}) > 0.3 or ({b}) >= ({a})")
TEMPLATES = (
    "({a}) + ({b})", "({a}) - ({b})", "({a})*({b})", "-({a})", "({a})/(2 + ({b})**2)", "({a})**2", "({a})**3 - ({a})",
    "(1 + ({a})**2)**-1.5", "sqrt(1 + ({a})**2)", "1/sqrt(3 + ({a})**2)", "exp(-({a})**2)", "log(2 + ({a})**2)", "sin({a})", "cos({a})",
    "tan(({a})/(4 + ({a})**2))", "asin(({a})/(1 + ({a})**2))", "acos(({a})/(1 + ({a})**2))", "atan({a})", "atan2({a}, 2 + ({b})**2)",
    "sinh(tanh({a}))", "cosh(sin({a}))",
    "abs({a})", "sign({a})*({b})", "min({a}, {b})", "max({a}, {b}, 0.7)", *(f"where({c}, {{b}}, {{a}})" for c in conditions),
)  # fmt: skip


def grow(children: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.builds(lambda form, a, b: form.format(a=a, b=b), st.sampled_from(TEMPLATES), children, children)


KINKS = ("min(", "max(", "abs(", "sign(", "where(")


def few_kinks(text: str) -> bool:
    """At most one: SymPy multiplies the cases of kinks within kinks; the examples have some."""
    return sum(text.count(kink) for kink in KINKS) <= 1


texts = st.recursive(st.one_of(st.sampled_from(NAMES), numbers), grow, max_leaves=8).filter(few_kinks)
#: Random places, which do not meet kinks.
places = st.integers(0, 2**32 - 1).map(lambda seed: [float(x) for x in np.random.default_rng(seed).uniform(-2, 2, 3)])


def term(text: str) -> sympy.Expr:
    return read_term(text, {name: Term(variable(name)) for name in NAMES}).value


def evaluate(expression: sympy.Expr, x: list[float]) -> float:
    """Both interpreters' value of an expression, which must be the same to rounding."""
    b = Builder()
    column = b.symbol("x", 3, BindingTime.ITERATION)
    block = Translator(b, {variable(name): b.element(column, i) for i, name in enumerate(NAMES)}).scalar(expression)
    inputs = {"x": np.array(x)}
    value = float(interpret_blocks([block], inputs, {})[block][0, 0])
    lowering = Lowering()
    lowering.lower([block])
    ((root,),) = lowering.elements[block]
    assert interpret_scalars(lowering.graph, [root], inputs, {})[root] == pytest.approx(value, rel=1e-9, abs=1e-9)
    return value


def plain(text: str, x: list[float]) -> float:
    """Python's value of a text that this module has made."""
    return float(eval(text, dict(PYTHON), dict(zip(NAMES, x, strict=True))))


def well_behaved(text: str, x: list[float]) -> float:
    """The value at a place where none of its neighbours jumps."""
    value = plain(text, x)
    around = [plain(text, [c + s * 1e-7 * (i == j) for i, c in enumerate(x)]) for j in range(3) for s in (1, -1)]
    assume(abs(value) < 1e6 and all(abs(near - value) < 1e-3 * (1 + abs(value)) for near in around))
    return value


@given(texts, places)
@settings(max_examples=300, deadline=None)
@example("(length)**2 + 3*(length) - 1", [0.3, 0, 0])
@example("exp(-length)*rate/exp(t)", [0.3, 0.5, 1])
@example("1/(length**2*rate)", [0.3, 0.5, 1])
@example("where(rate < 0, where(rate < -1, 1, 2), 3)", [0, -0.5, 0])
@example("abs(abs(length) - 1) + min(max(length, rate), t)*sign(rate)", [0.3, -0.5, 0.4])
@example("where(max(length, rate) < min(rate, t), max(rate, t), min(length, t))", [0.3, -0.5, 0.4])
def test_value(text: str, x: list[float]) -> None:
    expected = well_behaved(text, x)
    assert evaluate(term(text), x) == pytest.approx(expected, rel=1e-8, abs=1e-8)


@given(texts, places)
@settings(max_examples=150, deadline=None)
def test_derivative(text: str, x: list[float]) -> None:
    """Tangents of laws and rates of guides, where the text has no kink: there differences to both sides agree."""
    well_behaved(text, x)
    before, at, after = (plain(text, [x[0] + h, *x[1:]]) for h in (-1e-5, 0.0, 1e-5))
    assume(abs(after - 2 * at + before) < 1e-8 * (1 + abs(after - before)))
    slope = sympy.diff(term(text), variable("length"))
    assert evaluate(slope, x) == pytest.approx((after - before) / 2e-5, rel=1e-4, abs=1e-4)


def test_what_has_no_counterpart_is_named() -> None:
    b = Builder()
    translator = Translator(b, {})
    with pytest.raises(ValueError, match="gamma has no counterpart"):
        translator.scalar(sympy.gamma(sympy.Symbol("x", real=True)))
    with pytest.raises(KeyError, match="no value for symbol x"):
        translator.scalar(sympy.Symbol("x", real=True))
