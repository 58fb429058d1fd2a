"""Derivatives of blocks against differences of their values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cutjoint.program.blocks import Block
from cutjoint.program.differentiate import _LINEAR, _RULES, _VARIED, Differentiator, Inputs, Variation
from cutjoint.program.interpret import interpret_blocks
from tests.oracles.joints import Array
from tests.program.test_blocks import INPUTS, OPERATIONS, Desk

STEP = 1e-6


def value(block: Block, column: Array) -> Array:
    return np.asarray(interpret_blocks([block], {"x": column}, {})[block])


def difference(desk: Desk, block: Block, direction: Array) -> Array:
    """The derivative of a block along a direction, by central differences."""
    return (value(block, desk.column + STEP * direction) - value(block, desk.column - STEP * direction)) / (2 * STEP)


@pytest.mark.parametrize("operation", [*_VARIED, *_LINEAR])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_variations_are_differences(operation: str, seed: int) -> None:
    desk = Desk(seed)
    block, _ = OPERATIONS[operation](desk)
    direction = desk.rng.normal(size=INPUTS)
    changes = {desk.symbol: desk.builder.const(direction[:, np.newaxis].tolist())}
    found = Variation(desk.builder, Inputs(), frozenset({"x"}), changes, {}).of(block)
    np.testing.assert_allclose(value(found, desk.column), difference(desk, block, direction), rtol=1e-6, atol=1e-6)


def scalar(d: Desk) -> Block:
    return d.builder.call("mul", d.scalar()[0], d.builder.call("sin", d.scalar()[0]))


def column(d: Desk, n: int) -> Block:
    return d.builder.column([scalar(d) for _ in range(n)])


def choice(d: Desk) -> Block:
    return d.builder.call("where", d.builder.call("lt", d.scalar()[0], d.scalar()[0]), scalar(d), scalar(d))


#: A column or scalar by the operation that is tried.
COLUMNS: dict[str, Callable[[Desk], Block]] = {
    "add": lambda d: d.builder.add(column(d, 3), column(d, 3)), "sub": lambda d: d.builder.sub(column(d, 3), column(d, 3)),
    "neg": lambda d: d.builder.neg(column(d, 4)), "scale": lambda d: d.builder.scale(scalar(d), column(d, 3)),
    "mul": lambda d: d.builder.mul(d.builder.const(d.rng.normal(size=(2, 3)).tolist()), column(d, 3)),
    "skew": lambda d: d.builder.cross(column(d, 3), column(d, 3)),
    "transpose": lambda d: d.builder.mul(d.builder.transpose(column(d, 3)), column(d, 3)),
    "stack": lambda d: d.builder.stack([[column(d, 2)], [column(d, 3)]]),
    "take": lambda d: d.builder.take(column(d, 5), (1, 4), (0, 1)), "call": scalar, "where": choice,
}


@pytest.mark.parametrize("operation", COLUMNS)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_jacobians_are_differences(operation: str, seed: int) -> None:
    desk = Desk(seed)
    block = COLUMNS[operation](desk)
    found = Differentiator(desk.builder, [desk.symbol]).jacobian(block)
    expected = np.hstack([difference(desk, block, unit) for unit in np.eye(INPUTS)])
    given = value(found[desk.symbol], desk.column) if found else np.zeros_like(expected)
    np.testing.assert_allclose(given, expected, rtol=1e-6, atol=1e-6)


def test_every_rule_is_tried() -> None:
    assert _RULES.keys() <= COLUMNS.keys()
    assert {*_VARIED, *_LINEAR} <= OPERATIONS.keys()
