"""Derivatives in the IR of blocks: Jacobians of columns and variations of any blocks.

Jacobians are of scalars and columns that follow from given columns, the leaves, by sums, scaling, dot and cross products, constant matrices
and scalar functions. The result is blocks again, as many columns wide as the leaf is high. What a :class:`Differentiator` does for columns
and many leaves at once, a :class:`Variation` does for matrices and one direction: from the changes of some blocks it derives those of
others. Partial derivatives of functions are for both IRs (`derivatives`).
"""

from collections.abc import Callable, Generator, Iterable, Mapping
from functools import partial, reduce
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

from cutjoint.ops import fact
from cutjoint.package.errors import MissingPartialsError
from cutjoint.program.blocks import FUNCTIONS, SUPPLIED, SURFACE, BindingTime, Block, Builder, SuppliedCall, is_zero, surface_lookup

#: By leaf, where it is not zero: the derivative of a column (n, 1) by the leaf (k, 1), (n, k).
Jacobian: TypeAlias = Mapping[Block, Block]

D = TypeVar("D")
#: A rule as a coroutine: it yields blocks, is sent their derivatives, and returns that of its own block.
Steps: TypeAlias = Generator[Block, D, D]
#: Linear operations on one block: the same operation applies to the change of their argument.
_LINEAR: Mapping[str, Callable[[Builder, Block], Block]] = {
    "neg": Builder.neg, "transpose": Builder.transpose, "symmetrise": Builder.symmetrise, "skew": Builder.skew, "mirror": Builder.mirror,
}  # fmt: skip
X = TypeVar("X", bound="Operation")


def _follow(block: Block, known: dict[Block, D], rule: Callable[[Block], Steps[D]]) -> D:
    """The derivative of a block; ``known`` gets those of its arguments. Recursive in order, but with an explicit stack."""
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
    """Differentiates blocks by leaves, each block once.  Every path from a block to an input of iteration time must pass a leaf."""

    def __init__(self, builder: Builder, leaves: Iterable[Block]) -> None:
        self._b = builder
        self._known: dict[Block, Jacobian] = {leaf: {leaf: builder.identity(leaf.shape[0])} for leaf in leaves}

    def jacobian(self, block: Block) -> Jacobian:
        """The derivatives of a scalar or column by the leaves.
        Raises ValueError: the block uses an operation that has no rule, or reaches an input without passing a leaf."""
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
        return {leaf: d for leaf, d in found.items() if not is_zero(d)}

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
        """Of a row of a matrix."""
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
        for derivative, a in zip(partial_derivatives(self._b, block), block.args, strict=True):
            terms.append((partial(self._b.scale, derivative), (yield a)))
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
    """The column at a place of horizontally stacked columns; the block itself where it is none of these."""
    data: Any = block.data
    are_columns = block.op == "stack" and len(data[0]) == 1 and set(data[1]) == {1}
    return block.args[place] if are_columns else block


def _same(block: Block) -> Block:
    return block


_RULES: Mapping[str, Callable[[Differentiator, Block], Steps[Jacobian]]] = {
    "add": Differentiator._sum, "sub": Differentiator._sum, "neg": Differentiator._neg, "scale": Differentiator._scale,
    "mul": Differentiator._mul, "stack": Differentiator._stack, "take": Differentiator._take, "call": Differentiator._call,
    "transpose": Differentiator._transpose,
}  # fmt: skip


class Inputs:
    """The input symbols that blocks depend on, each block visited once."""

    def __init__(self) -> None:
        self._known: dict[Block, frozenset[str]] = {}

    def of(self, block: Block) -> frozenset[str]:
        """The names of the symbols of iteration time that a block depends on."""
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
    """The directional derivative of blocks. ``changes`` has the derivative of blocks that are known; ``rotations`` 3x3 rotations R with
    derivative w~ R, by their w (3, 1). A block that depends on none of ``symbols`` does not change."""

    def __init__(
        self, builder: Builder, inputs: Inputs, symbols: frozenset[str], changes: Mapping[Block, Block], rotations: Mapping[Block, Block]
    ) -> None:
        self._b = builder
        self._inputs = inputs
        self._symbols = symbols
        self._rotations = dict(rotations)
        self._known = dict(changes)

    def of(self, block: Block) -> Block:
        """The derivative, of the block's shape.
        Raises ValueError: the block uses an operation that has no rule, or depends on a symbol whose change is not given."""
        return _follow(block, self._known, self._derived)

    def _derived(self, block: Block) -> Steps[Block]:
        if not self._inputs.of(block) & self._symbols:
            return self._b.zero(*block.shape)
        if block in self._rotations:
            return self._b.mul(self._b.skew(self._rotations[block]), block)
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
        if a in self._rotations:
            return b.add(b.mul(b.skew(self._rotations[a]), block), rest)
        if a.op == "transpose" and a.args[0] in self._rotations:
            return b.mul(a, b.sub((yield x), b.mul(b.skew(self._rotations[a.args[0]]), x)))
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
        for derivative, a in zip(partial_derivatives(b, block), block.args, strict=True):
            terms.append((derivative, (yield a)))
        return b.total([b.zero(1), *(b.mul(p, d) for p, d in terms)])


_VARIED: Mapping[str, Callable[[Variation, Block], Steps[Block]]] = {
    "add": Variation._sum, "sub": Variation._sum, "scale": Variation._scale, "mul": Variation._mul, "stack": Variation._stack,
    "take": Variation._take, "sandwich": Variation._sandwich, "call": Variation._call,
}  # fmt: skip


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
        """Zero."""

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
    Raises ValueError, LookupError: the function has none."""
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
        count = len(y.args) - call.memory  # a discrete state, which has no derivative
        return [*(b.call(f"{function}.{j}", *y.args) for j in range(count)), *(b.zero(1) for _ in range(call.memory))]
    found: list[X] = fact(function, "partials")(Calculus(b), y, *y.args)
    return found


class Calculus(Generic[X]):
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
