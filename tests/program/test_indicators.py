"""Switches: values whose signs tell the present formula of a program."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.indicators import find_indicators
from cutjoint.program.interpret import interpret_blocks
from tests.oracles.joints import Array


def inputs(b: Builder) -> list[Block]:
    column = b.symbol("x", 3, BindingTime.ITERATION)
    return [b.element(column, i) for i in range(3)]


def values(blocks: Sequence[Block], x: Array) -> Array:
    """(points, blocks) of scalar blocks."""
    found = interpret_blocks(blocks, {"x": x}, {})
    return np.stack([np.broadcast_to(found[block], (len(x), 1, 1))[:, 0, 0] for block in blocks], axis=1)


def compound(b: Builder, x: Sequence[Block]) -> Block:
    """(x0 < x1 and not x2 <= 0.3) or x0 + x1 < x2."""
    low = b.call("and", b.call("lt", x[0], x[1]), b.call("not", b.call("le", x[2], b.number(0.3))))
    return b.call("or", low, b.call("lt", b.add(x[0], x[1]), x[2]))


def test_the_sign_of_a_compound_condition() -> None:
    b = Builder()
    x = inputs(b)
    choice = b.call("where", compound(b, x), b.number(1.0), b.number(-1.0))
    (switch,) = find_indicators(b, [choice])
    points = np.random.default_rng(3).uniform(-1, 1, (500, 3))
    value, chosen = values([switch.value, choice], points).T
    assert {*np.sign(value)} == {1.0, -1.0}
    assert np.sign(value) == pytest.approx(chosen) or np.sign(value) == pytest.approx(-chosen)


def test_each_place_of_change_counts_once() -> None:
    """Sign and order of the requests do not matter; constants and parameters do not change in a run."""
    b = Builder()
    x = inputs(b)
    open_parameter = b.symbol("parameters", 1, BindingTime.PARAM)
    one, zero = b.number(1.0), b.zero(1)
    parts = [
        b.call("where", b.call("lt", x[0], zero), one, zero), b.call("where", b.call("lt", zero, x[0]), one, zero), b.call("abs", x[0]),
        b.call("abs", b.neg(x[0])), b.call("where", b.call("lt", open_parameter, one), one, zero), b.call("sqrt", x[1]),
    ]  # fmt: skip
    (switch,) = find_indicators(b, parts)
    assert switch.value is x[0]


def test_a_lookup_changes_along_and_across_its_road() -> None:
    b = Builder()
    x = inputs(b)
    with b.section("force", "wheel", "", "car.yaml:7"):
        looked_up = b.add(b.call("road_height", x[0], x[1], table="wheel"), b.call("road_slope", x[0], x[1], table="wheel"))
    along, across = find_indicators(b, [looked_up])
    assert (along.value, along.road, along.across) == (x[0], "wheel", x[1])
    assert (across.value, across.road, across.across) == (x[1], "", None)
    assert b.sections[along.section].source == "car.yaml:7"
