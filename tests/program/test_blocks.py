"""Every block operation against NumPy, interpreted as a block and lowered to scalars.

Matrices are random with zeros, ones and repeated inputs among their elements, so that simplifications act.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cutjoint.program import blocks
from cutjoint.program.blocks import BindingTime, Block, Builder, is_identity, is_zero
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import Lowering
from tests.oracles.joints import Array
from tests.oracles.scalars import interpret_scalars

INPUTS = 12


class Desk:
    """Makes pairs of a random block and its value."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.builder = Builder()
        self.column = self.rng.uniform(-2, 2, INPUTS)
        self.symbol = self.builder.symbol("x", INPUTS, BindingTime.ITERATION)

    def scalar(self) -> tuple[Block, float]:
        """An input, its negative, or a number."""
        pick = self.rng.integers(10)
        if pick < 4:
            number = float(self.rng.choice([0.0, 1.0, -1.0, 2.5]))
            return self.builder.number(number), number
        i = int(self.rng.integers(INPUTS))
        block = self.builder.element(self.symbol, i)
        return (block, self.column[i]) if pick < 8 else (self.builder.neg(block), -self.column[i])

    def matrix(self, n: int, m: int) -> tuple[Block, Array]:
        """A matrix of scalars; now and then zero or the unit matrix."""
        pick = self.rng.integers(8)
        if pick == 0:
            return self.builder.zero(n, m), np.zeros((n, m))
        if pick == 1 and n == m:
            return self.builder.identity(n), np.eye(n)
        grid = [[self.scalar() for _ in range(m)] for _ in range(n)]
        return self.builder.stack([[b for b, _ in row] for row in grid]), np.array([[x for _, x in row] for row in grid])

    def symmetric(self, n: int) -> tuple[Block, Array]:
        """A symmetric matrix."""
        block, value = self.matrix(n, n)
        return self.builder.mirror(block), np.triu(value) + np.triu(value, 1).T

    def definite(self, n: int) -> tuple[Block, Array]:
        """A well-conditioned positive definite matrix."""
        block, value = self.matrix(n, n)
        weights = self.builder.column([self.builder.number(1.0)] * n)
        unit = self.builder.scale(self.builder.number(3.0), self.builder.identity(n))
        return self.builder.add(self.builder.gram(block, weights), unit), value.T @ value + 3 * np.eye(n)

    def size(self) -> int:
        """1 to 6."""
        return int(self.rng.integers(1, 7))


Case = tuple[Block, Array]


def factor(m: Array) -> tuple[Array, Array]:
    """L and 1/D of m = L D L^T."""
    n = len(m)
    L, D = np.eye(n), np.zeros(n)
    for j in range(n):
        D[j] = m[j, j] - (L[j, :j] ** 2) @ D[:j]
        for i in range(j + 1, n):
            L[i, j] = (m[i, j] - (L[i, :j] * L[j, :j]) @ D[:j]) / D[j]
    return L, 1 / D[:, np.newaxis]


def elementwise(d: Desk, operation: str) -> Case:
    n, m = d.size(), d.size()
    kind = d.symmetric if d.rng.random() < 0.3 else None
    (a, x), (b, y) = (kind(n), kind(n)) if kind else (d.matrix(n, m), d.matrix(n, m))
    return (d.builder.add(a, b), x + y) if operation == "add" else (d.builder.sub(a, b), x - y)


def negated(d: Desk) -> Case:
    a, x = d.symmetric(d.size()) if d.rng.random() < 0.3 else d.matrix(d.size(), d.size())
    return d.builder.neg(a), -x


def scaled(d: Desk) -> Case:
    (s, c), (a, x) = d.scalar(), d.matrix(d.size(), d.size())
    return d.builder.scale(s, a), c * x


def product(d: Desk) -> Case:
    n, k, m = d.size(), d.size(), d.size()
    (a, x), (b, y) = d.matrix(n, k), d.matrix(k, m)
    return d.builder.mul(a, b), x @ y


def transposed(d: Desk) -> Case:
    a, x = d.matrix(d.size(), d.size())
    return d.builder.mul(d.builder.transpose(a), a), x.T @ x


def symmetrised(d: Desk) -> Case:
    n = d.size()
    a, x = d.matrix(n, n)
    return d.builder.symmetrise(a), x + x.T


def sandwiched(d: Desk) -> Case:
    n, k = d.size(), d.size()
    (a, x), (m, y) = d.matrix(n, k), d.symmetric(k)
    return d.builder.sandwich(a, m), x @ y @ x.T


def gram(d: Desk) -> Case:
    n, k = d.size(), d.size()
    (y, x), (w, c) = d.matrix(k, n), d.matrix(k, 1)
    return d.builder.gram(y, w), x.T @ (c * x)


def weighed(d: Desk) -> Case:
    n, k = d.size(), d.size()
    (y, x), (w, c) = d.matrix(k, n), d.matrix(k, 1)
    return d.builder.weigh(w, y), c * x


def mirrored(d: Desk) -> Case:
    return d.symmetric(d.size())


def skewed(d: Desk) -> Case:
    (p, x), (q, y) = d.matrix(3, 1), d.matrix(3, 1)
    return d.builder.cross(p, q), np.cross(x[:, 0], y[:, 0])[:, np.newaxis]


def stacked(d: Desk) -> Case:
    heights, widths = [d.size() for _ in range(d.size())], [d.size() for _ in range(d.size())]
    grid = [[d.matrix(n, m) for m in widths] for n in heights]
    return d.builder.stack([[a for a, _ in row] for row in grid]), np.block([[x for _, x in row] for row in grid])


def taken(d: Desk) -> Case:
    n, m = d.size(), d.size()
    a, x = d.symmetric(n) if d.rng.random() < 0.3 else d.matrix(n, m)
    rows, columns = (sorted(int(i) for i in d.rng.choice(size + 1, 2, replace=False)) for size in x.shape)
    return d.builder.take(a, tuple(rows), tuple(columns)), x[slice(*rows), slice(*columns)]


def called(d: Desk) -> Case:
    (a, x), (b, y), (c, z) = d.scalar(), d.scalar(), d.scalar()
    call = d.builder.call
    smaller = call("where", call("lt", a, b), call("mul", a, c), call("div", call("sin", c), call("exp", b)))
    return smaller, np.array([[x * z if x < y else np.sin(z) / np.exp(y)]])


def factored(d: Desk, part: int) -> Case:
    m, x = d.definite(d.size())
    return d.builder.ldl(m)[part], factor(x)[part]


def substituted(d: Desk, direction: str) -> Case:
    n = d.size()
    (m, x), (b, y) = d.definite(n), d.matrix(n, d.size())
    L = factor(x)[0]
    if direction == "forward":
        return d.builder.forward(d.builder.ldl(m)[0], b), np.linalg.solve(L, y)
    return d.builder.backward(d.builder.ldl(m)[0], b), np.linalg.solve(L.T, y)


def in_lanes(d: Desk, how: str) -> Case:
    """A product in four lanes, of uniform and gathered factors and numbers of each lane's own, then one lane or all of them."""
    n, lanes = d.size(), 4
    (a, x), parts = d.matrix(n, n), [d.matrix(n, 2) for _ in range(lanes)]
    own = d.rng.normal(size=(lanes, n, 1)) if d.rng.random() < 0.7 else np.ones((lanes, n, 1))
    b = d.builder
    wide = b.mul(a, b.weigh(b.lane_const([b.const(rows.tolist()) for rows in own]), b.gather([p for p, _ in parts])))
    expected = [x @ (rows * y) for rows, (_, y) in zip(own, parts, strict=True)]
    return (b.lane_sum(wide), sum(expected)) if how == "sum" else (b.lane(wide, 2), expected[2])


OPERATIONS: dict[str, Callable[[Desk], Case]] = {
    "const": lambda d: d.matrix(1, 1), "symbol": lambda d: (d.symbol, d.column[:, np.newaxis]),
    "add": lambda d: elementwise(d, "add"), "sub": lambda d: elementwise(d, "sub"), "neg": negated, "scale": scaled,
    "mul": product, "transpose": transposed, "symmetrise": symmetrised, "sandwich": sandwiched, "gram": gram, "weigh": weighed,
    "mirror": mirrored, "skew": skewed, "stack": stacked, "take": taken, "call": called,
    "ldl_factor": lambda d: factored(d, 0), "ldl_pivots": lambda d: factored(d, 1),
    "lane_const": lambda d: in_lanes(d, "lane"), "gather": lambda d: in_lanes(d, "lane"), "lane": lambda d: in_lanes(d, "lane"),
    "lane_sum": lambda d: in_lanes(d, "sum"),
    "forward": lambda d: substituted(d, "forward"), "backward": lambda d: substituted(d, "backward"),
}  # fmt: skip


@pytest.mark.parametrize("operation", OPERATIONS)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_operation(operation: str, seed: int) -> None:
    desk = Desk(seed)
    block, expected = OPERATIONS[operation](desk)
    assert block.shape == expected.shape
    inputs = {"x": desk.column}
    np.testing.assert_allclose(interpret_blocks([block], inputs, {})[block], expected, rtol=1e-11, atol=1e-11)
    lowering = Lowering()
    lowering.lower([block])
    elements = lowering.elements[block]
    values = interpret_scalars(lowering.graph, [n for row in elements for n in row], inputs, {})
    np.testing.assert_allclose([[values[n] for n in row] for row in elements], expected, rtol=1e-11, atol=1e-11)
    if block.symmetric:
        np.testing.assert_allclose(expected, expected.T, rtol=1e-11, atol=1e-11)
        assert elements == [list(column) for column in zip(*elements, strict=True)]


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_units_of_rows_change_no_digit_of_a_substitution(direction: str) -> None:
    """Rows in other units, by powers of two, have the same solution to the last bit; pivots that compare rows would not."""
    rng, b = np.random.default_rng(2), Builder()
    L, y, units = np.eye(7) + np.tril(rng.normal(size=(7, 7)), -1), rng.normal(size=(7, 2)), 2.0 ** rng.integers(-12, 12, size=(7, 1))
    if direction == "backward":
        units = 1 / units
    found = []
    for each in (np.ones((7, 1)), units):
        of = each * L / each.T if direction == "forward" else L * each.T / each  # its transpose has the rows
        block = getattr(b, direction)(b.const(of.tolist()), b.const((each * y).tolist()))
        found.append(interpret_blocks([block], {}, {})[block] / each)
    assert (found[0] == found[1]).all()


def test_every_operation_is_tried() -> None:
    """The operations of the grammar, as the module's docstring has it."""
    grammar = blocks.__doc__.split("Equal expressions")[0]
    named = set(re.findall(r"(?:[:=|]=?|\|)\s*([a-z_]+)\(", grammar)) | {"add", "sub", "neg", "ldl_pivots", "backward"}
    assert named == set(OPERATIONS)


def test_equal_expressions_are_one_object() -> None:
    b = Builder()
    x, y = b.symbol("x", 3, BindingTime.ITERATION), b.symbol("y", 3, BindingTime.STEP)
    assert b.add(b.cross(x, y), x) is b.add(b.cross(x, y), x)
    assert b.cross(x, y) is not b.cross(y, x)


def test_zero_and_unit_matrices_vanish() -> None:
    b = Builder()
    A = b.stack([[b.symbol("x", 3, BindingTime.ITERATION), b.symbol("y", 3, BindingTime.ITERATION)]])
    assert b.add(A, b.zero(3, 2)) is A
    assert b.mul(b.identity(3), A) is A
    assert is_zero(b.mul(b.zero(2, 3), A))
    assert b.neg(b.neg(A)) is A
    assert b.transpose(b.transpose(A)) is A
    assert is_identity(b.mul(b.identity(3), b.identity(3)))


def test_binding_time_is_the_latest_of_the_arguments() -> None:
    b = Builder()
    early, late = b.symbol("p", 3, BindingTime.PARAM), b.symbol("t", 3, BindingTime.STEP)
    assert b.add(early, late).binding is BindingTime.STEP
    assert b.scale(b.number(2.0), early).binding is BindingTime.PARAM
    assert b.identity(3).binding is BindingTime.CONST


@pytest.mark.parametrize(
    "wrong",
    [
        lambda b: b.add(b.zero(3), b.zero(2)),
        lambda b: b.mul(b.zero(3), b.zero(2)),
        lambda b: b.scale(b.zero(3), b.zero(3)),
        lambda b: b.sandwich(b.zero(3, 2), b.const([[1, 2], [3, 4]])),
        lambda b: b.ldl(b.const([[1, 2], [3, 4]])),
        lambda b: b.gram(b.zero(3, 2), b.zero(2)),
        lambda b: b.weigh(b.zero(2), b.zero(3)),
        lambda b: b.call("sin", b.zero(2)),
        lambda b: b.call("gamma", b.zero(1)),
    ],
)
def test_shapes_that_do_not_fit_are_refused(wrong: Callable[[Builder], Block]) -> None:
    with pytest.raises(ValueError, match=r"shapes differ|mul of|needs|sandwich of|ldl of|gram of|weigh of|does not take"):
        wrong(Builder())
