"""An expression through the whole chain: read, differentiate, translate, lower, interpret."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import numpy as np
import sympy

from cutjoint.formulate.translate import Translator
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.parse import read_term, variable
from cutjoint.model.records import Scalar
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import Lowering
from tests.oracles.scalars import interpret_scalars

from .expressions import VARIABLES, in_si, steady_value

NAMES = {name: Term(variable(name)) for name in VARIABLES}
#: Seconds of processor time that a text may take through the chain, on a busy machine.
SLOWEST = 4.0
PLACES: tuple[Mapping[str, float], ...] = (
    {"length": 0.37, "rate": -0.81, "t": 1.43},
    {"length": -1.9, "rate": 0.13, "t": 0.29},
    {"length": 1.21, "rate": 2.3, "t": 0.057},
)


def run_chain(text: str) -> str:
    """Empty when the text was accepted and has the right values, else why it was refused; fails where the chain does."""
    begin = time.process_time()
    try:
        expression = read_term(text, NAMES).value
    except ExpressionError as error:
        assert time.process_time() - begin < SLOWEST, f"{time.process_time() - begin:.1f} s to refuse {text!r}"
        return error.message or "no message"
    if (meant := in_si(text)) is not None:
        assert math.isclose(float(expression), meant, rel_tol=2e-15), f"{expression} instead of {meant} for {text!r}"
    try:
        lowering, blocks = _lower(expression)
    except (OverflowError, ZeroDivisionError):
        raise
    except ArithmeticError as error:  # a constant that the compiler refuses
        return str(error)
    assert time.process_time() - begin < SLOWEST, f"{time.process_time() - begin:.1f} s for {text!r}"
    if "kg" not in text:
        check_values(text, lowering, blocks)
    return ""


def _lower(expression: Scalar) -> tuple[Lowering, list]:
    """An expression and the derivatives that the compiler takes, as blocks and lowered: of a law the first, of a guide the first two."""
    guided = not expression.free_symbols - {variable("t")}
    x = variable("t" if guided else "length")
    derivatives = [slope := sympy.diff(expression, x)]
    if guided:
        derivatives.append(sympy.diff(slope, x))
    builder = Builder()
    column = builder.symbol("x", len(VARIABLES), BindingTime.ITERATION)
    translator = Translator(builder, {variable(name): builder.element(column, i) for i, name in enumerate(VARIABLES)})
    blocks = [translator.scalar(e) for e in (expression, *derivatives)]
    lowering = Lowering()
    lowering.lower(blocks)
    return lowering, blocks


def check_values(text: str, lowering: Lowering, blocks: list) -> None:
    """Both interpreters' value against Python's, where that is finite and does not hang on last digits."""
    ((root,),) = lowering.elements[blocks[0]]
    value_at = steady_value(text)
    for place in PLACES:
        wanted = value_at(place)
        if math.isnan(wanted):
            continue
        inputs = {"x": np.array([place[name] for name in VARIABLES])}
        with np.errstate(all="ignore"):
            found = float(interpret_blocks(blocks[:1], inputs, {})[blocks[0]][0, 0])
            again = float(interpret_scalars(lowering.graph, [root], inputs, {})[root])
        for value in (found, again):
            assert abs(value - wanted) <= 1e-3 * abs(wanted) + 1e-6, f"{value!r} instead of {wanted!r} at {place} for {text!r}"
