"""Block IR -> scalar IR: every block becomes the scalars of its elements."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from cutjoint.program.blocks import Block
from cutjoint.program.scalars import Graph

#: Scalars of a block, by rows.
Elements: TypeAlias = list[list[int]]


@dataclass
class Lowering:
    """The scalars of each block lowered so far."""

    graph: Graph = field(default_factory=Graph)
    elements: dict[Block, Elements] = field(default_factory=dict)

    def lower(self, roots: Iterable[Block]) -> None:
        """Lower the blocks that the roots depend on, in the order in which they were made."""
        for block in reachable_blocks(roots):
            if block not in self.elements:
                self.graph.section = block.section
                self.elements[block] = _RULES[block.op](self, block)

    def _of(self, block: Block, i: int = 0) -> Elements:
        return self.elements[block.args[i]]

    def _dot(self, pairs: Iterable[tuple[int, int]]) -> int:
        g = self.graph
        result = zero = g.const(0.0)
        for a, b in pairs:
            if a != zero and b != zero:
                result = g.add(result, g.mul(a, b))
        return result

    def _symmetric(self, n: int, element: Callable[[int, int], int]) -> Elements:
        """A symmetric block from the elements of its upper triangle."""
        upper = {(i, j): element(i, j) for i in range(n) for j in range(i, n)}
        return [[upper[min(i, j), max(i, j)] for j in range(n)] for i in range(n)]

    def _elementwise(self, block: Block, element: Callable[[int, int], int]) -> Elements:
        n, m = block.shape
        if block.symmetric:
            return self._symmetric(n, element)
        return [[element(i, j) for j in range(m)] for i in range(n)]


def reachable_blocks(roots: Iterable[Block]) -> list[Block]:
    """The blocks that the roots depend on, arguments first."""
    wanted = set(roots)
    stack = list(wanted)
    while stack:
        for a in stack.pop().args:
            if a not in wanted:
                wanted.add(a)
                stack.append(a)
    return sorted(wanted, key=lambda b: b.number)


def _const(low: Lowering, block: Block) -> Elements:
    rows: Any = block.data
    return [[low.graph.const(x) for x in row] for row in rows]


def _lane_const(low: Lowering, block: Block) -> Elements:
    lanes: Any = block.data
    n, m = block.shape
    return [[low.graph.lane_const([rows[i][j] for rows in lanes]) for j in range(m)] for i in range(n)]


def _each(element: Callable[..., int]) -> Callable[[Lowering, Block], Elements]:
    """The rule of an operation by the function that makes an element, (lowering, row, column, elements of the arguments)."""

    def rule(low: Lowering, block: Block) -> Elements:
        args = [low.elements[a] for a in block.args]
        return low._elementwise(block, lambda i, j: element(low, i, j, *args))

    return rule


def _lane(low: Lowering, block: Block) -> Elements:
    a, k = low._of(block), int(str(block.data))
    return low._elementwise(block, lambda i, j: low.graph.lane(a[i][j], k))


def _lane_sum(low: Lowering, block: Block) -> Elements:
    a, g = low._of(block), low.graph
    lanes = block.args[0].lanes

    def summed(i: int, j: int) -> int:
        x = a[i][j]
        return g.lane_sum(x) if g.nodes[x].lanes else g.mul(g.const(float(lanes)), x)

    return low._elementwise(block, summed)


def _symbol(low: Lowering, block: Block) -> Elements:
    return [[low.graph.symbol(str(block.data), i, block.binding)] for i in range(block.shape[0])]


def _transpose(low: Lowering, block: Block) -> Elements:
    return [list(row) for row in zip(*low._of(block), strict=True)]


def _sandwich(low: Lowering, block: Block) -> Elements:
    a, m = low._of(block, 0), low._of(block, 1)
    inner = [[low._dot((row[k], m[k][j]) for k in range(len(m))) for j in range(len(m))] for row in a]
    return low._symmetric(block.shape[0], lambda i, j: low._dot(zip(inner[i], a[j], strict=True)))


def _gram(low: Lowering, block: Block) -> Elements:
    y, d = low._of(block, 0), low._of(block, 1)
    scaled = [[low.graph.mul(d[k][0], x) for x in row] for k, row in enumerate(y)]
    return low._symmetric(block.shape[0], lambda i, j: low._dot((y[k][i], scaled[k][j]) for k in range(len(y))))


def _skew(low: Lowering, block: Block) -> Elements:
    (x,), (y,), (z,) = low._of(block)
    g = low.graph
    zero = g.const(0.0)
    return [[zero, g.neg(z), y], [z, zero, g.neg(x)], [g.neg(y), x, zero]]


def _stack(low: Lowering, block: Block) -> Elements:
    data: Any = block.data
    heights, widths = data
    rows: Elements = []
    for i, height in enumerate(heights):
        parts = [low._of(block, i * len(widths) + j) for j in range(len(widths))]
        rows.extend([x for part in parts for x in part[r]] for r in range(height))
    return rows


def _take(low: Lowering, block: Block) -> Elements:
    data: Any = block.data
    (r0, r1), (c0, c1) = data
    return [row[c0:c1] for row in low._of(block)[r0:r1]]


def _call(low: Lowering, block: Block) -> Elements:
    data: Any = block.data
    function, table = data
    return [[call_scalar(low.graph, function, tuple(low.elements[a][0][0] for a in block.args), table)]]


def call_scalar(g: Graph, function: str, args: tuple[int, ...], table: object = None) -> int:
    """A scalar function of `FUNCTIONS`, by the operations that the graph has for it."""
    if function == "mul":
        return g.mul(*args)
    if function == "div":
        return g.div(*args)
    if function == "pow" and (exponent := g.value(args[1])) is not None:
        if exponent == int(exponent):
            return g.power(args[0], int(exponent))
        if exponent == 0.5:
            return g.call("sqrt", args[:1])
    return g.call(function, args, table)


def _ldl(low: Lowering, block: Block) -> tuple[Elements, Elements]:
    """L and 1/D of m = L D L^T, elements in the order of the columns."""
    g, m = low.graph, low._of(block)
    n = len(m)
    lower = [[g.const(float(i == j)) for j in range(n)] for i in range(n)]
    inverse: list[int] = []
    scaled = [[g.const(0.0)] * n for _ in range(n)]  # L D
    for j in range(n):
        pivot = g.sub(m[j][j], low._dot((lower[j][k], scaled[j][k]) for k in range(j)))
        inverse.append(g.div(g.const(1.0), pivot))
        for i in range(j + 1, n):
            scaled[i][j] = g.sub(m[i][j], low._dot((scaled[i][k], lower[j][k]) for k in range(j)))
            lower[i][j] = g.mul(scaled[i][j], inverse[j])
    return lower, [[x] for x in inverse]


def _forward(low: Lowering, block: Block) -> Elements:
    lower, b = low._of(block, 0), low._of(block, 1)
    g, x = low.graph, [list(row) for row in b]
    for i in range(len(x)):
        for j in range(len(x[0])):
            x[i][j] = g.sub(x[i][j], low._dot((lower[i][k], x[k][j]) for k in range(i)))
    return x


def _backward(low: Lowering, block: Block) -> Elements:
    lower, b = low._of(block, 0), low._of(block, 1)
    g, x = low.graph, [list(row) for row in b]
    n = len(x)
    for i in reversed(range(n)):
        for j in range(len(x[0])):
            x[i][j] = g.sub(x[i][j], low._dot((lower[k][i], x[k][j]) for k in range(i + 1, n)))
    return x


_RULES: dict[str, Callable[[Lowering, Block], Elements]] = {
    "gather": _each(lambda low, i, j, *parts: low.graph.gather(tuple(part[i][j] for part in parts))),
    "add": _each(lambda low, i, j, a, b: low.graph.add(a[i][j], b[i][j])),
    "sub": _each(lambda low, i, j, a, b: low.graph.sub(a[i][j], b[i][j])),
    "neg": _each(lambda low, i, j, a: low.graph.neg(a[i][j])),
    "scale": _each(lambda low, i, j, s, a: low.graph.mul(s[0][0], a[i][j])),
    "mul": _each(lambda low, i, j, a, b: low._dot((a[i][k], b[k][j]) for k in range(len(b)))),
    "symmetrise": _each(lambda low, i, j, a: low.graph.add(a[i][j], a[j][i])),
    "weigh": _each(lambda low, i, j, d, y: low.graph.mul(d[i][0], y[i][j])),
    "mirror": lambda low, block: low._symmetric(block.shape[0], lambda i, j: low._of(block)[i][j]),
    "const": _const, "lane_const": _lane_const, "lane": _lane, "lane_sum": _lane_sum, "symbol": _symbol,
    "transpose": _transpose, "sandwich": _sandwich, "gram": _gram, "skew": _skew, "stack": _stack, "take": _take, "call": _call,
    "ldl_factor": lambda low, block: _ldl(low, block)[0], "ldl_pivots": lambda low, block: _ldl(low, block)[1],
    "forward": _forward, "backward": _backward,
}  # fmt: skip
