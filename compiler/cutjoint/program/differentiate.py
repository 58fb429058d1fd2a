"""Jacobians of columns: forward differentiation of the block IR.

Differentiated are scalars and columns that follow from given columns, the leaves, by sums, scaling, dot and cross products, constant
matrices and scalar functions.  The result is blocks again, as many columns wide as the leaf is high.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial, reduce
from typing import Any, TypeAlias

from cutjoint.package.errors import MissingPartialsError
from cutjoint.program.blocks import FUNCTIONS, SUPPLIED, SURFACE, BindingTime, Block, Builder, SuppliedCall, surface_lookup

#: By leaf, where it is not zero: the derivative of a column (n, 1) by the leaf (k, 1), (n, k).
Jacobian: TypeAlias = Mapping[Block, Block]


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
        if block not in self._known:
            self._known[block] = {leaf: d for leaf, d in self._derived(block).items() if not _vanishes(d)}
        return self._known[block]

    def _derived(self, block: Block) -> Jacobian:
        if block.op == "symbol" and block.binding is BindingTime.ITERATION:
            raise ValueError(f"{block!r} ({block.data}) is reached by another way than the leaves")
        if not block.args or block.binding < BindingTime.ITERATION:
            return {}
        rule = _RULES.get(block.op)
        if rule is None or block.shape[1] != 1:
            raise ValueError(f"{block!r} has no derivative")
        return rule(self, block)

    def _combined(self, terms: Iterable[tuple[Callable[[Block], Block], Jacobian]]) -> Jacobian:
        """The sum of Jacobians that functions are applied to."""
        result: dict[Block, Block] = {}
        for apply, jacobian in terms:
            for leaf, derivative in jacobian.items():
                term = apply(derivative)
                result[leaf] = self._b.add(result[leaf], term) if leaf in result else term
        return result

    def _sum(self, block: Block) -> Jacobian:
        a, c = block.args
        second = self._b.neg if block.op == "sub" else _same
        return self._combined([(_same, self.jacobian(a)), (second, self.jacobian(c))])

    def _neg(self, block: Block) -> Jacobian:
        return self._combined([(self._b.neg, self.jacobian(block.args[0]))])

    def _scale(self, block: Block) -> Jacobian:
        b, (s, a) = self._b, block.args
        return self._combined([(lambda d: b.scale(s, d), self.jacobian(a)), (lambda d: b.mul(a, d), self.jacobian(s))])

    def _mul(self, block: Block) -> Jacobian:
        b, (a, x) = self._b, block.args
        terms = [(lambda d: b.mul(a, d), self.jacobian(x))]
        if a.binding is BindingTime.ITERATION:
            if a.shape == (1, 1):
                terms.append((lambda d: b.mul(x, d), self.jacobian(a)))
            elif a.shape[0] == 1:
                terms.append((lambda d: b.mul(b.transpose(x), d), self.jacobian(b.transpose(a))))
            elif a.op == "skew":
                terms.append((lambda d: b.neg(b.mul(b.skew(x), d)), self.jacobian(a.args[0])))
            else:
                raise ValueError(f"the factor {a!r} has no derivative")
        return self._combined(terms)

    def _stack(self, block: Block) -> Jacobian:
        b = self._b
        jacobians = [self.jacobian(a) for a in block.args]
        leaves = dict.fromkeys(leaf for j in jacobians for leaf in j)
        return {
            leaf: b.stack([
                [j.get(leaf, b.zero(a.shape[0], leaf.shape[0]))] for a, j in zip(block.args, jacobians, strict=True)
            ]) for leaf in leaves
        }  # fmt: skip

    def _take(self, block: Block) -> Jacobian:
        rows, (first, last) = _ranges(block)
        column = _column(block.args[0], first) if last == first + 1 else block.args[0]
        return {leaf: self._b.take(d, rows, (0, d.shape[1])) for leaf, d in self.jacobian(column).items()}

    def _transpose(self, block: Block) -> Jacobian:
        """Of a row that is taken from a matrix."""
        row = block.args[0]
        if row.op != "take":
            raise ValueError(f"{block!r} has no derivative")
        (i, _), (first, last) = _ranges(row)
        return self.jacobian(self._b.column([self._b.element(row.args[0], i, j) for j in range(first, last)]))

    def _call(self, block: Block) -> Jacobian:
        data: Any = block.data
        if data[0] == "where":
            return self._choice(block)
        slopes = partial_derivatives(self._b, block)
        return self._combined([(partial(self._b.scale, p), self.jacobian(a)) for p, a in zip(slopes, block.args, strict=True)])

    def _choice(self, block: Block) -> Jacobian:
        b, (condition, yes, no) = self._b, block.args
        jacobians = self.jacobian(yes), self.jacobian(no)

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


_RULES: Mapping[str, Callable[[Differentiator, Block], Jacobian]] = {
    "add": Differentiator._sum, "sub": Differentiator._sum, "neg": Differentiator._neg, "scale": Differentiator._scale,
    "mul": Differentiator._mul, "stack": Differentiator._stack, "take": Differentiator._take, "call": Differentiator._call,
    "transpose": Differentiator._transpose,
}  # fmt: skip


def partial_derivatives(b: Builder, y: Block) -> list[Block]:
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
    return _PARTIALS[function](_Calculus(b), y, *y.args)


class _Calculus:
    """Short names for scalar operations."""

    def __init__(self, b: Builder) -> None:
        self.b = b
        self.one = b.number(1.0)

    def call(self, name: str, *args: Block) -> Block:
        return self.b.call(name, *args)

    def inverse(self, x: Block) -> Block:
        return self.b.call("div", self.one, x)

    def product(self, *factors: Block) -> Block:
        return reduce(lambda x, y: y if x is self.one else self.b.mul(x, y), factors)

    def square(self, x: Block) -> Block:
        return self.b.mul(x, x)

    def root_of_rest(self, x: Block) -> Block:
        """sqrt(1 - x^2)."""
        return self.call("sqrt", self.b.sub(self.one, self.square(x)))


def _atan2(c: _Calculus, _: Block, y: Block, x: Block) -> list[Block]:
    squares = c.b.add(c.square(x), c.square(y))
    return [c.call("div", x, squares), c.b.neg(c.call("div", y, squares))]


def _pow(c: _Calculus, value: Block, x: Block, n: Block) -> list[Block]:
    by_base = c.product(n, c.call("pow", x, c.b.sub(n, c.one)))
    return [by_base, c.b.zero(1) if n.op == "const" else c.product(value, c.call("log", x))]


def _flat(c: _Calculus, _: Block, *args: Block) -> list[Block]:
    return [c.b.zero(1)] * len(args)


_PARTIALS: Mapping[str, Callable[..., list[Block]]] = {
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
