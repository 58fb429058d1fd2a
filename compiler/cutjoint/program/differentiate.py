"""Derivatives of both IRs: Jacobians of columns and variations of any blocks in that of blocks, adjoints in that of scalars.

Jacobians are of scalars and columns that follow from given columns, the leaves, by sums, scaling, dot and cross products, constant
matrices and scalar functions.  The result is blocks again, as many columns wide as the leaf is high.  What a
:class:`Differentiator` does for columns and many leaves at once, a :class:`Variation` does for matrices and one direction: it is given how
some blocks change and finds how others do.

Adjoints go through a program's scalars from its results to what these follow from.  They are scalars of the same graph, which are lowered,
shared and printed like others.  Lanes stay: what is spread over lanes is summed over them, and the other way round.

Slopes of many results by many scalars are found by elimination.  Partial derivatives are the edges of a graph, from which one scalar after
the other is taken.  Edges from those before it to those behind it take its place, the one with the fewest of these first (Griewank,
Walther, Evaluating Derivatives, section 9.2).
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce
from itertools import product
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

from cutjoint.package.errors import MissingPartialsError
from cutjoint.program.blocks import FUNCTIONS, SUPPLIED, SURFACE, BindingTime, Block, Builder, SuppliedCall, is_zero, surface_lookup
from cutjoint.program.lower import call_scalar
from cutjoint.program.scalars import Graph

#: By leaf, where it is not zero: the derivative of a column (n, 1) by the leaf (k, 1), (n, k).
Jacobian: TypeAlias = Mapping[Block, Block]

D = TypeVar("D")
#: A rule on its way: it yields blocks, is sent their derivatives, and returns that of its own block.
Steps: TypeAlias = Generator[Block, D, D]


def _follow(block: Block, known: dict[Block, D], rule: Callable[[Block], Steps[D]]) -> D:
    """The derivative of a block, and those that it follows from in ``known``, in the order of a recursion, but on a stack of their own."""
    stack = [] if block in known else [(block, rule(block))]
    sent: Any = None
    while stack:
        of, steps = stack[-1]
        try:
            wanted = steps.send(sent)
        except StopIteration as end:
            sent = known[of] = end.value
            stack.pop()
        else:
            sent = known.get(wanted)
            if sent is None:
                stack.append((wanted, rule(wanted)))
    return known[block]


class Differentiator:
    """Differentiates blocks by leaves, each block once.

    Every way from a block to an input that changes in an iteration must pass a leaf.
    """

    def __init__(self, builder: Builder, leaves: Iterable[Block]) -> None:
        self._b = builder
        self._known: dict[Block, Jacobian] = {leaf: {leaf: builder.identity(leaf.shape[0])} for leaf in leaves}

    def jacobian(self, block: Block) -> Jacobian:
        """The derivatives of a scalar or column by the leaves.

        Raises:
            ValueError: the block uses an operation that has no rule, or an input by another way than a leaf.
        """
        return _follow(block, self._known, self._derived)

    def _derived(self, block: Block) -> Steps[Jacobian]:
        if block.op == "symbol" and block.binding is BindingTime.ITERATION:
            raise ValueError(f"{block!r} ({block.data}) is reached by another way than the leaves")
        if not block.args or block.binding < BindingTime.ITERATION:
            return {}
        rule = _RULES.get(block.op)
        if rule is None or block.shape[1] != 1:
            raise ValueError(f"{block!r} has no derivative")
        found = yield from rule(self, block)
        return {leaf: d for leaf, d in found.items() if not _vanishes(d)}

    def _combined(self, terms: Iterable[tuple[Callable[[Block], Block], Jacobian]]) -> Jacobian:
        """The sum of Jacobians that functions are applied to."""
        result: dict[Block, Block] = {}
        for apply, jacobian in terms:
            for leaf, derivative in jacobian.items():
                term = apply(derivative)
                result[leaf] = self._b.add(result[leaf], term) if leaf in result else term
        return result

    def _sum(self, block: Block) -> Steps[Jacobian]:
        a, c = block.args
        second = self._b.neg if block.op == "sub" else _same
        return self._combined([(_same, (yield a)), (second, (yield c))])

    def _neg(self, block: Block) -> Steps[Jacobian]:
        return self._combined([(self._b.neg, (yield block.args[0]))])

    def _scale(self, block: Block) -> Steps[Jacobian]:
        b, (s, a) = self._b, block.args
        return self._combined([(lambda d: b.scale(s, d), (yield a)), (lambda d: b.mul(a, d), (yield s))])

    def _mul(self, block: Block) -> Steps[Jacobian]:
        b, (a, x) = self._b, block.args
        terms = [(lambda d: b.mul(a, d), (yield x))]
        if a.binding is BindingTime.ITERATION:
            if a.shape == (1, 1):
                terms.append((lambda d: b.mul(x, d), (yield a)))
            elif a.shape[0] == 1:
                terms.append((lambda d: b.mul(b.transpose(x), d), (yield b.transpose(a))))
            elif a.op == "skew":
                terms.append((lambda d: b.neg(b.mul(b.skew(x), d)), (yield a.args[0])))
            else:
                raise ValueError(f"the factor {a!r} has no derivative")
        return self._combined(terms)

    def _stack(self, block: Block) -> Steps[Jacobian]:
        b, jacobians = self._b, list[Jacobian]()
        for a in block.args:
            jacobians.append((yield a))
        leaves = dict.fromkeys(leaf for j in jacobians for leaf in j)
        return {
            leaf: b.stack([
                [j.get(leaf, b.zero(a.shape[0], leaf.shape[0]))] for a, j in zip(block.args, jacobians, strict=True)
            ]) for leaf in leaves
        }  # fmt: skip

    def _take(self, block: Block) -> Steps[Jacobian]:
        rows, (first, last) = _ranges(block)
        whole = yield _column(block.args[0], first) if last == first + 1 else block.args[0]
        return {leaf: self._b.take(d, rows, (0, d.shape[1])) for leaf, d in whole.items()}

    def _transpose(self, block: Block) -> Steps[Jacobian]:
        """Of a row that is taken from a matrix."""
        row = block.args[0]
        if row.op != "take":
            raise ValueError(f"{block!r} has no derivative")
        (i, _), (first, last) = _ranges(row)
        return (yield self._b.column([self._b.element(row.args[0], i, j) for j in range(first, last)]))

    def _call(self, block: Block) -> Steps[Jacobian]:
        data: Any = block.data
        if data[0] == "where":
            return (yield from self._choice(block))
        terms = []
        for slope, a in zip(partial_derivatives(self._b, block), block.args, strict=True):
            terms.append((partial(self._b.scale, slope), (yield a)))
        return self._combined(terms)

    def _choice(self, block: Block) -> Steps[Jacobian]:
        b, (condition, yes, no) = self._b, block.args
        jacobians = (yield yes), (yield no)

        def chosen(leaf: Block) -> Block:
            width = leaf.shape[0]
            parts = [j.get(leaf, b.zero(1, width)) for j in jacobians]
            return b.stack([[b.call("where", condition, *(b.element(p, 0, i) for p in parts)) for i in range(width)]])

        return {leaf: chosen(leaf) for leaf in dict.fromkeys([*jacobians[0], *jacobians[1]])}


def _ranges(block: Block) -> tuple[tuple[int, int], tuple[int, int]]:
    """The rows and columns that a block takes."""
    data: Any = block.data
    rows, columns = data
    return rows, columns


def _column(block: Block, place: int) -> Block:
    """The column at a place of columns that stand beside each other; the block itself where it is none of these."""
    data: Any = block.data
    are_beside = block.op == "stack" and len(data[0]) == 1 and set(data[1]) == {1}
    return block.args[place] if are_beside else block


def _same(block: Block) -> Block:
    return block


def _vanishes(block: Block) -> bool:
    data: Any = block.data
    return block.op == "const" and not any(x for row in data for x in row)


_RULES: Mapping[str, Callable[[Differentiator, Block], Steps[Jacobian]]] = {
    "add": Differentiator._sum, "sub": Differentiator._sum, "neg": Differentiator._neg, "scale": Differentiator._scale,
    "mul": Differentiator._mul, "stack": Differentiator._stack, "take": Differentiator._take, "call": Differentiator._call,
    "transpose": Differentiator._transpose,
}  # fmt: skip


class Inputs:
    """The symbols that blocks are computed from, each block looked through once."""

    def __init__(self) -> None:
        self._known: dict[Block, frozenset[str]] = {}

    def of(self, block: Block) -> frozenset[str]:
        """The names of the symbols known in an iteration that a block depends on."""
        stack = [block]
        while stack:
            top = stack[-1]
            missing = [a for a in top.args if a not in self._known] if top not in self._known else []
            if missing:
                stack.extend(missing)
                continue
            stack.pop()
            if top not in self._known:
                symbols = [str(top.data)] if top.op == "symbol" and top.binding is BindingTime.ITERATION else []
                self._known[top] = frozenset().union(symbols, *(self._known[a] for a in top.args))
        return self._known[block]


class Variation:
    """The change of blocks in one direction.

    ``changes`` has the derivative of blocks that are known; ``turns`` those 3x3 rotations whose derivative is w~ R, by their w (3, 1).  A
    block that depends on none of ``symbols`` does not change.
    """

    def __init__(
        self, builder: Builder, inputs: Inputs, symbols: frozenset[str], changes: Mapping[Block, Block], turns: Mapping[Block, Block]
    ) -> None:
        self._b = builder
        self._inputs = inputs
        self._symbols = symbols
        self._turns = dict(turns)
        self._known = dict(changes)

    def of(self, block: Block) -> Block:
        """The derivative, of the block's shape.

        Raises:
            ValueError: the block uses an operation that has no rule, or depends on a symbol whose change is not given.
        """
        return _follow(block, self._known, self._derived)

    def _derived(self, block: Block) -> Steps[Block]:
        if not self._inputs.of(block) & self._symbols:
            return self._b.zero(*block.shape)
        if block in self._turns:
            return self._b.mul(self._b.skew(self._turns[block]), block)
        if block.op in _LINEAR:
            return _LINEAR[block.op](self._b, (yield block.args[0]))
        rule = _VARIED.get(block.op)
        if rule is None:
            raise ValueError(f"{block!r} ({block.data}) has no derivative")
        return (yield from rule(self, block))

    def _sum(self, block: Block) -> Steps[Block]:
        first, second = (yield block.args[0]), (yield block.args[1])
        return self._b.add(first, second) if block.op == "add" else self._b.sub(first, second)

    def _scale(self, block: Block) -> Steps[Block]:
        b, (s, a) = self._b, block.args
        return b.add(self._scaled(s, (yield a)), self._scaled((yield s), a))

    def _scaled(self, factor: Block, block: Block) -> Block:
        return self._b.zero(*block.shape) if is_zero(factor) else self._b.scale(factor, block)

    def _mul(self, block: Block) -> Steps[Block]:
        b, (a, x) = self._b, block.args
        rest = b.mul(a, (yield x))
        if a in self._turns:
            return b.add(b.mul(b.skew(self._turns[a]), block), rest)
        if a.op == "transpose" and a.args[0] in self._turns:
            return b.mul(a, b.sub((yield x), b.mul(b.skew(self._turns[a.args[0]]), x)))
        return b.add(b.mul((yield a), x), rest)

    def _stack(self, block: Block) -> Steps[Block]:
        data: Any = block.data
        parts, columns = list[Block](), len(data[1])
        for a in block.args:
            parts.append((yield a))
        return self._b.stack([parts[i : i + columns] for i in range(0, len(parts), columns)])

    def _take(self, block: Block) -> Steps[Block]:
        data: Any = block.data
        return self._b.take((yield block.args[0]), *data)

    def _sandwich(self, block: Block) -> Steps[Block]:
        b, (a, m) = self._b, block.args
        half = b.mul((yield a), b.mul(m, b.transpose(a)))
        inner = yield m
        whole = b.symmetrise(half)
        return whole if is_zero(inner) else b.add(whole, b.sandwich(a, b.mirror(inner)))

    def _call(self, block: Block) -> Steps[Block]:
        b, data = self._b, block.data
        assert isinstance(data, tuple)
        if data[0] == "where":
            condition, yes, no = block.args
            first, second = (yield yes), (yield no)
            return first if first is second else b.call("where", condition, first, second)
        terms = []
        for slope, a in zip(partial_derivatives(b, block), block.args, strict=True):
            terms.append((slope, (yield a)))
        return b.total([b.zero(1), *(b.mul(p, d) for p, d in terms)])


_VARIED: Mapping[str, Callable[[Variation, Block], Steps[Block]]] = {
    "add": Variation._sum, "sub": Variation._sum, "scale": Variation._scale, "mul": Variation._mul, "stack": Variation._stack,
    "take": Variation._take, "sandwich": Variation._sandwich, "call": Variation._call,
}  # fmt: skip
#: Operations on one block whose change is that of their argument, treated in the same way.
_LINEAR: Mapping[str, Callable[[Builder, Block], Block]] = {
    "neg": Builder.neg, "transpose": Builder.transpose, "symmetrise": Builder.symmetrise, "skew": Builder.skew, "mirror": Builder.mirror,
}  # fmt: skip


X = TypeVar("X", bound="Operation")


class Operation(Protocol):
    """A scalar of either IR; of a ``call``, ``data`` is the function with the name of its table."""

    @property
    def op(self) -> str:
        """The operation; "const" of a number."""

    @property
    def args(self) -> tuple[Any, ...]:
        """The arguments."""

    @property
    def data(self) -> Any:
        """The function and the name of its table."""


class Algebra(Protocol[X]):
    """Operations on scalars of either IR, as `Builder` has them."""

    def number(self, value: float) -> X:
        """A constant."""

    def zero(self, n: int) -> X:
        """Nought."""

    def add(self, a: X, b: X) -> X:
        """a + b."""

    def sub(self, a: X, b: X) -> X:
        """a - b."""

    def neg(self, a: X) -> X:
        """-a."""

    def mul(self, a: X, b: X) -> X:
        """a b."""

    def call(self, function: str, *args: X, table: str | None = None) -> X:
        """A function's value."""


def partial_derivatives(b: Algebra[X], y: X) -> list[X]:
    """The partial derivatives of a scalar function's value y, a ``call``, by its arguments.

    Raises:
        ValueError: the function has none.
    """
    data: Any = y.data
    function, table = data
    if function in ("road_height", "road_slope"):
        return [b.call(f"{function}_dx", *y.args, table=table), b.zero(1)]
    if function.startswith(SURFACE):
        lookup, by = surface_lookup(function)
        further = [f"{lookup}_{''.join(sorted(by + axis))}" for axis in "xy"]
        if any(name not in FUNCTIONS for name in further):
            raise ValueError(f"{function} has no derivative")
        return [b.call(name, *y.args, table=table) for name in further]
    if function.startswith(SUPPLIED):
        call = SuppliedCall.read(function)
        if call.by is not None:
            raise MissingPartialsError(call.name, second=True)
        count = len(y.args) - call.memory  # which is held: it has no slope
        return [*(b.call(f"{function}.{j}", *y.args) for j in range(count)), *(b.zero(1) for _ in range(call.memory))]
    if function not in _PARTIALS:
        raise ValueError(f"{function} has no derivative")
    found: list[X] = _PARTIALS[function](_Calculus(b), y, *y.args)
    return found


class _Calculus(Generic[X]):
    """Short names for scalar operations."""

    def __init__(self, b: Algebra[X]) -> None:
        self.b = b
        self.one = b.number(1.0)

    def call(self, name: str, *args: X) -> X:
        return self.b.call(name, *args)

    def inverse(self, x: X) -> X:
        return self.b.call("div", self.one, x)

    def product(self, *factors: X) -> X:
        return reduce(lambda x, y: y if x is self.one else self.b.mul(x, y), factors)

    def square(self, x: X) -> X:
        return self.b.mul(x, x)

    def root_of_rest(self, x: X) -> X:
        """sqrt(1 - x^2)."""
        return self.call("sqrt", self.b.sub(self.one, self.square(x)))


def _atan2(c: _Calculus[X], _: X, y: X, x: X) -> list[X]:
    squares = c.b.add(c.square(x), c.square(y))
    return [c.call("div", x, squares), c.b.neg(c.call("div", y, squares))]


def _pow(c: _Calculus[X], value: X, x: X, n: X) -> list[X]:
    by_base = c.product(n, c.call("pow", x, c.b.sub(n, c.one)))
    return [by_base, c.b.zero(1) if n.op == "const" else c.product(value, c.call("log", x))]


def _flat(c: _Calculus[X], _: X, *args: X) -> list[X]:
    return [c.b.zero(1)] * len(args)


_PARTIALS: Mapping[str, Callable[..., list[Any]]] = {
    "mul": lambda c, y, a, x: [x, a],
    "div": lambda c, y, a, x: [c.inverse(x), c.b.neg(c.call("div", y, x))],
    "sqrt": lambda c, y, a: [c.call("div", c.b.number(0.5), y)],
    "sin": lambda c, y, a: [c.call("cos", a)],
    "cos": lambda c, y, a: [c.b.neg(c.call("sin", a))],
    "tan": lambda c, y, a: [c.b.add(c.one, c.square(y))],
    "asin": lambda c, y, a: [c.inverse(c.root_of_rest(a))],
    "acos": lambda c, y, a: [c.b.neg(c.inverse(c.root_of_rest(a)))],
    "atan": lambda c, y, a: [c.inverse(c.b.add(c.one, c.square(a)))],
    "atan2": _atan2,
    "sinh": lambda c, y, a: [c.call("cosh", a)],
    "cosh": lambda c, y, a: [c.call("sinh", a)],
    "tanh": lambda c, y, a: [c.b.sub(c.one, c.square(y))],
    "exp": lambda c, y, a: [y],
    "log": lambda c, y, a: [c.inverse(a)],
    "abs": lambda c, y, a: [c.call("where", c.call("lt", a, c.b.zero(1)), c.b.number(-1.0), c.one)],
    "pow": _pow,
    "lt": _flat, "le": _flat, "and": _flat, "or": _flat, "not": _flat,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Scalar:
    """A node of the graph as partial derivatives see it."""

    number: int
    op: str
    args: tuple[_Scalar, ...]
    data: tuple[str, object]


class _Scalars:
    """The algebra of a graph's nodes."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._known: dict[int, _Scalar] = {}

    def of(self, n: int, depth: int = 1) -> _Scalar:
        """A node, with its arguments where they are asked for."""
        node = self._graph.nodes[n]
        if depth:
            return _Scalar(n, node.op, tuple(self.of(a, 0) for a in node.args), (node.op, node.data))
        if n not in self._known:
            self._known[n] = _Scalar(n, node.op, (), (node.op, node.data))
        return self._known[n]

    def number(self, value: float) -> _Scalar:
        """A constant."""
        return self.of(self._graph.const(value), 0)

    def zero(self, n: int) -> _Scalar:
        """Nought."""
        assert n == 1
        return self.number(0.0)

    def add(self, a: _Scalar, b: _Scalar) -> _Scalar:
        """a + b."""
        return self.of(self._graph.add(a.number, b.number), 0)

    def sub(self, a: _Scalar, b: _Scalar) -> _Scalar:
        """a - b."""
        return self.of(self._graph.sub(a.number, b.number), 0)

    def neg(self, a: _Scalar) -> _Scalar:
        """-a."""
        return self.of(self._graph.neg(a.number), 0)

    def mul(self, a: _Scalar, b: _Scalar) -> _Scalar:
        """a b."""
        return self.of(self._graph.mul(a.number, b.number), 0)

    def call(self, function: str, *args: _Scalar, table: str | None = None) -> _Scalar:
        """A function's value."""
        return self.of(call_scalar(self._graph, function, tuple(a.number for a in args), table), 0)


@dataclass
class _Sums:
    """Slopes that have come together at a node: a sum for all lanes, and one for each lane by itself."""

    all: int | None = None
    lanes: dict[int, int] = field(default_factory=dict)


def adjoint(graph: Graph, weights: Mapping[int, int], targets: Collection[int]) -> dict[int, int]:
    """The slopes of a sum of nodes, each by the node of its weight, by each of the ``targets`` on which it depends, with as many lanes as
    that has.  Ways end at targets.

    Raises:
        ValueError: an operation has no derivative.
    """
    order = graph.reachable(list(weights))
    depends = set(targets)
    for n in order:
        if any(a in depends for a in graph.nodes[n].args):
            depends.add(n)
    sums: defaultdict[int, _Sums] = defaultdict(_Sums)
    scalars, section = _Scalars(graph), graph.section
    for n, weight in weights.items():
        _gather(graph, sums[n], weight)
    found: dict[int, int] = {}
    for n in reversed(order):
        if n not in depends or n not in sums:
            continue
        graph.section = graph.nodes[n].section
        slope = _joined(graph, sums.pop(n), graph.nodes[n].lanes)
        if n in targets:
            found[n] = slope
        elif graph.value(slope) != 0.0:
            for a, share, lane in _shares(graph, scalars, n, slope):
                if a in depends and graph.value(share) != 0.0:
                    _gather(graph, sums[a], share, lane)
    graph.section = section
    return found


def _gather(graph: Graph, sums: _Sums, share: int, lane: int | None = None) -> None:
    if lane is None:
        sums.all = share if sums.all is None else graph.add(sums.all, share)
    else:
        sums.lanes[lane] = share if lane not in sums.lanes else graph.add(sums.lanes[lane], share)


def _joined(graph: Graph, sums: _Sums, lanes: int) -> int:
    """The sum of all that has come to a node; that of one with lanes may be the same in all of them."""
    if not sums.lanes:
        assert sums.all is not None
        return sums.all
    apart = graph.gather(tuple(sums.lanes.get(k, graph.const(0.0)) for k in range(lanes)))
    return apart if sums.all is None else graph.add(sums.all, apart)


def _shares(graph: Graph, scalars: _Scalars, n: int, slope: int) -> Iterator[tuple[int, int, int | None]]:
    """The share of each argument in a node's slope, and its lane, None for all."""
    node = graph.nodes[n]
    match node.op:
        case "gather":
            yield from ((a, graph.lane(slope, k), None) for k, a in enumerate(node.args))
        case "lane":
            assert isinstance(node.data, int)
            yield node.args[0], slope, node.data
        case "lane_sum":
            yield node.args[0], slope, None
        case _:
            for a, share in zip(node.args, _products(graph, scalars, n, slope), strict=True):
                yield a, share if graph.nodes[a].lanes else _over_lanes(graph, share, node.lanes), None


def _over_lanes(graph: Graph, share: int, lanes: int) -> int:
    """The share of an argument without lanes."""
    if graph.nodes[share].lanes:
        return graph.lane_sum(share)
    return graph.mul(graph.const(float(lanes)), share) if lanes else share


def _products(graph: Graph, scalars: _Scalars, n: int, slope: int) -> Sequence[int]:
    """A node's slope times its derivative by each argument."""
    node = graph.nodes[n]
    match node.op:
        case "add":
            return slope, slope
        case "sub":
            return slope, graph.neg(slope)
        case "neg":
            return (graph.neg(slope),)
        case "where":
            zero = graph.const(0.0)
            return zero, graph.call("where", (node.args[0], slope, zero)), graph.call("where", (node.args[0], zero, slope))
        case "div":
            by_above = graph.div(slope, node.args[1])
            return by_above, graph.neg(graph.mul(by_above, n))
    return [graph.mul(slope, p.number) for p in partial_derivatives(scalars, scalars.of(n))]


#: All lanes of a scalar.
_ALL = -1

#: The way of changes from a scalar to another: the coefficients by the lane that they leave and the one that they reach, None of a scalar
#: that has none.  From all lanes to all goes each to its own, from all to none their sum.  From none to -1 - n goes the sum of a
#: coefficient's n lanes, which is taken as late as can be.
_Edge: TypeAlias = dict[tuple[int | None, int | None], int]


def slopes(graph: Graph, results: Sequence[int], targets: Collection[int]) -> list[dict[int, int]]:
    """The slopes of each of the results, none of which has lanes, by each of the ``targets``, with as many lanes as that has, if it depends
    on it.  Ways end at targets.

    Raises:
        ValueError: an operation has no derivative.
    """
    section, elimination = graph.section, _Elimination(graph, set(targets))
    found = elimination.run(results)
    graph.section = section
    return found


class _Elimination:
    """The linearised graph of some results: of each scalar the edges that lead to it, and the scalars to which some lead from it.  Results
    have numbers below 0."""

    def __init__(self, graph: Graph, targets: set[int]) -> None:
        self._graph = graph
        self._targets = targets
        self._gathered: list[int] = []  # targets side by side, by which slopes have lanes until the end
        self._before: dict[int, dict[int, _Edge]] = {}
        self._behind: defaultdict[int, set[int]] = defaultdict(set)

    def run(self, results: Sequence[int]) -> list[dict[int, int]]:
        """The slopes of results by targets."""
        self._linearise(results)
        inner = [n for n in self._before if n >= 0]
        heap = [(self._cost(n), n) for n in inner]
        heapq.heapify(heap)
        left = set(inner)
        while heap:
            cost, n = heapq.heappop(heap)
            if n not in left:
                continue
            if (now := self._cost(n)) > cost:
                heapq.heappush(heap, (now, n))
                continue
            left.remove(n)
            for other in self._eliminate(n):
                if other in left:
                    heapq.heappush(heap, (self._cost(other), other))
        return [self._slopes(self._before[-1 - i]) for i in range(len(results))]

    def _linearise(self, results: Sequence[int]) -> None:
        graph, scalars, depends = self._graph, _Scalars(self._graph), set(self._targets)
        for n in graph.reachable(list(results)):
            node = graph.nodes[n]
            if n in self._targets or depends.isdisjoint(node.args):
                continue
            depends.add(n)
            if node.op == "gather" and all(a in self._targets or graph.value(a) is not None for a in node.args):
                self._gathered.append(n)
                continue
            graph.section = node.section
            edges: dict[int, _Edge] = {}
            for a, key, coefficient in _edges(graph, scalars, n):
                if a in depends and graph.value(coefficient) != 0.0:
                    self._add(edges.setdefault(a, {}), key, coefficient)
            self._enter(n, edges)
        for i, n in enumerate(results):
            self._enter(-1 - i, {n: {(None, None): graph.const(1.0)}} if n in depends else {})

    def _enter(self, n: int, edges: dict[int, _Edge]) -> None:
        self._before[n] = edges
        for a in edges:
            self._behind[a].add(n)

    def _cost(self, n: int) -> int:
        return len(self._before[n]) * len(self._behind[n])

    def _eliminate(self, n: int) -> set[int]:
        """Take a scalar out; returns its neighbours."""
        before, behind = self._before.pop(n), self._behind.pop(n, set())
        self._graph.section = self._graph.nodes[n].section
        for a in before:
            self._behind[a].discard(n)
        for c in sorted(behind, reverse=True):
            last = self._before[c].pop(n)
            for a, first in before.items():
                edge = self._before[c].get(a, {})
                self._join(edge, self._lanes(a), first, self._lanes(n), last, self._lanes(c))
                if edge:
                    self._before[c][a] = edge
                    self._behind[a].add(c)
        return before.keys() | behind

    def _lanes(self, n: int) -> int:
        return 0 if n < 0 else self._graph.nodes[n].lanes

    def _join(self, edge: _Edge, lanes: int, first: _Edge, between: int, last: _Edge, behind: int) -> None:
        """Add the way by two edges; scalars before, between and behind them have so many lanes."""
        graph = self._graph
        for ((start, reached), c), ((left, end), d) in product(first.items(), last.items()):
            if reached is not None and reached < _ALL:
                if end is None:
                    reached, end = None, reached
                else:
                    c = self._sum(c, -1 - reached)
                    reached = None
            if end is not None and end < _ALL and start is not None:
                d = self._sum(d, -1 - end)
                end = None
            if reached == left:
                if start == _ALL and end is not None and reached is None:  # each lane to each
                    ends = range(behind) if end == _ALL else (end,)
                    for j, k in product(range(lanes), ends):
                        self._add(edge, (j, k), self._times(graph.lane(c, j), graph.lane(d, k)))
                elif start is not None and end == _ALL and reached is None:
                    for k in range(behind):
                        self._add(edge, (start, k), self._times(c, graph.lane(d, k)))
                elif reached == _ALL and start is None and end is None:
                    self._add(edge, (None, -1 - between), self._times(c, d))
                else:
                    self._add(edge, (start, end), self._times(c, d))
            elif reached == _ALL:
                assert left is not None
                self._add(edge, (left if start == _ALL else start, end), self._times(graph.lane(c, left), d))
            elif left == _ALL:
                assert reached is not None
                self._add(edge, (start, reached if end == _ALL else end), self._times(c, graph.lane(d, reached)))

    def _sum(self, n: int, lanes: int) -> int:
        graph = self._graph
        return graph.lane_sum(n) if graph.nodes[n].lanes else graph.mul(graph.const(float(lanes)), n)

    def _add(self, edge: _Edge, key: tuple[int | None, int | None], coefficient: int) -> None:
        graph, end = self._graph, key[1]
        total = graph.add(edge.pop(key), coefficient) if key in edge else coefficient
        if end is not None and end < _ALL and not graph.nodes[total].lanes:
            self._add(edge, (None, None), self._sum(total, -1 - end))
        else:
            edge[key] = total

    def _times(self, a: int, b: int) -> int:
        """A product; what a choice leaves out stays out, where it may have no value."""
        graph = self._graph
        for one, other in ((a, b), (b, a)):
            node = graph.nodes[graph.signless(one)]
            if node.op == "where" and 0.0 in (graph.value(node.args[1]), graph.value(node.args[2])):
                condition, yes, no = node.args
                if graph.nodes[condition].lanes == max(graph.nodes[one].lanes, graph.nodes[other].lanes):
                    zero = graph.const(0.0)
                    parts = (self._times(x, other) if graph.value(x) != 0.0 else zero for x in (yes, no))
                    chosen = graph.call("where", (condition, *parts))
                    return chosen if graph.signless(one) == one else graph.neg(chosen)
        return graph.mul(a, b)

    def _slopes(self, edges: dict[int, _Edge]) -> dict[int, int]:
        """The slopes by targets of a result to which edges lead."""
        graph, found = self._graph, {a: self._slope(a, edge) for a, edge in edges.items()}
        for n in self._gathered:
            if n in found:
                slope = found.pop(n)
                for k, a in enumerate(graph.nodes[n].args):
                    if a in self._targets:
                        found[a] = graph.add(found[a], graph.lane(slope, k)) if a in found else graph.lane(slope, k)
        return found

    def _slope(self, target: int, edge: _Edge) -> int:
        """The slope that an edge from a target to a result stands for."""
        graph, lanes = self._graph, self._lanes(target)
        if not lanes:
            parts = [c if end is None else self._sum(c, -1 - end) for (_, end), c in edge.items()]
            return reduce(graph.add, parts)
        zero = graph.const(0.0)
        apart = graph.gather(tuple(edge.get((k, None), zero) for k in range(lanes)))
        return graph.add(edge[_ALL, None], apart) if (_ALL, None) in edge else apart


def _edges(graph: Graph, scalars: _Scalars, n: int) -> Iterator[tuple[int, tuple[int | None, int | None], int]]:
    """The edges to a scalar from its arguments."""
    node, one = graph.nodes[n], graph.const(1.0)
    end = _ALL if node.lanes else None
    match node.op:
        case "gather":
            yield from ((a, (None, k), one) for k, a in enumerate(node.args))
            return
        case "lane":
            assert isinstance(node.data, int)
            yield node.args[0], (node.data, None), one
            return
        case "lane_sum":
            yield node.args[0], (_ALL, None), one
            return
    for a, share in zip(node.args, _products(graph, scalars, n, one), strict=True):
        yield a, (_ALL if graph.nodes[a].lanes else None, end), share
