"""Zero regions of laws, from their text."""

from __future__ import annotations

from itertools import product

import pytest
import sympy

from cutjoint.formulate.translate import Translator
from cutjoint.model.expressions.operations import Term
from cutjoint.model.expressions.parse import parameter_symbol, read_term, variable
from cutjoint.model.records import Scalar
from cutjoint.program.blocks import Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.reduce.guards import zero_region

TRAVEL, RATE, K = variable("travel"), variable("rate"), parameter_symbol("k")
NAMES = {"travel": Term(TRAVEL), "rate": Term(RATE), "k": Term(K), "t": Term(variable("t"))}


def law(text: str) -> Scalar:
    return read_term(text, NAMES).value


def test_the_margin_of_a_bumper() -> None:
    assert zero_region(law("where(travel < -0.001, k*(-0.001 - travel), 0)")) == (TRAVEL + 0.001,)


@pytest.mark.parametrize(
    ("text", "margins"),
    [
        ("where(travel > 0.5, 0, k*(0.5 - travel))", 1),
        ("where(travel >= 0.5, 0, 7)", 1),
        ("max(0, k*(0.5 - travel))", 1),
        ("where(travel < -0.5, -1 - 2*travel, where(travel > 0.5, 1 - 2*travel, 0))", 2),
        ("where(travel < -0.5, k*(-0.5 - travel), 0) + where(travel > 0.5, k*(0.5 - travel), 0)", 2),
        ("2*where(travel < 0, travel, 0)**3", 1),
        ("where(travel < 0.5, k*travel, 0)*where(travel > -0.5, 1, 0)", 1),
        ("where(travel < 0 and k*travel + rate < 0, k*travel + rate, 0)", 1),
        ("where(travel < 0 or rate < 0, 3 + k, 0)", 2),
        ("where(-0.5 < travel < 0.5, 0, travel**3 - travel/4)", 2),
        ("where(travel <= -0.5, 0, where(rate > 0.25, 5, 0))", 1),
        ("where(travel <= -0.5, 0, where(rate < 0.25, k, 0))", 1),
    ],
)  # fmt: skip
def test_a_law_is_zero_where_no_margin_is_negative_and_only_there(text: str, margins: int) -> None:
    expression = law(text)
    region = zero_region(expression)
    assert region is not None
    assert len(region) == margins
    for travel, rate in product((-1, -0.6, -0.4, -0.1, 0.1, 0.4, 0.6, 1), repeat=2):
        value, *found = (number(e, travel, rate) for e in (expression, *region))
        assert (value == 0) == (min(found) >= 0), (travel, rate)


@pytest.mark.parametrize("travel", [-0.5, 0.5])
def test_a_law_is_zero_on_the_border_too(travel: float) -> None:
    for text in ("where(travel > 0.5, 0, 0.5 - travel)", "where(-0.5 < travel < 0.5, 0, travel**3 - travel/4)"):
        expression = law(text)
        region = zero_region(expression)
        assert region
        assert number(expression, travel, 0) == 0 or min(number(margin, travel, 0) for margin in region) < 0


def number(expression: Scalar, travel: float, rate: float) -> float:
    b = Builder()
    block = Translator(b, {TRAVEL: b.number(travel), RATE: b.number(rate), K: b.number(3.0)}).scalar(expression)
    return float(interpret_blocks([block], {}, {})[block][0, 0])


@pytest.mark.parametrize(
    "text",
    [
        "k*(0.1 - travel)",
        "where(travel < 0, travel, 1)",
        "where(travel < 0, k*travel, 0) + 1",
        "where(travel <= 0, 100, 0)",  # at zero it acts, though the margin is not negative there
        "where(travel > 0.5, 0, k)",
        "abs(travel)",  # zero at one place is not zero in a region
        "where(rate > 0, k*rate, 2*k*rate)",
        "where(travel < 0.5, 1, 0) + where(travel > 0.4, 1, 0)",
    ],
)
def test_no_region(text: str) -> None:
    assert zero_region(law(text)) is None


def test_a_law_that_is_zero_everywhere_needs_no_margin() -> None:
    assert zero_region(sympy.Integer(0)) == ()
    assert zero_region(law("where(travel < 0, 0, 0*rate)")) == ()
