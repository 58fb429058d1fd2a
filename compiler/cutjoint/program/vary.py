"""Derivatives of blocks of any shape in one direction: forward differentiation of the block IR.

What a :class:`Differentiator` does for columns and many leaves at once, a :class:`Variation` does for matrices and one direction: it is
given how some blocks change and finds how others do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from cutjoint.program.blocks import BindingTime, Block, Builder, is_zero
from cutjoint.program.differentiate import partial_derivatives


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
        if block not in self._known:
            self._known[block] = self._derived(block) if self._inputs.of(block) & self._symbols else self._b.zero(*block.shape)
        return self._known[block]

    def _derived(self, block: Block) -> Block:
        if block in self._turns:
            return self._b.mul(self._b.skew(self._turns[block]), block)
        rule = _RULES.get(block.op)
        if rule is None:
            raise ValueError(f"{block!r} ({block.data}) has no derivative")
        return rule(self, block)

    def _sum(self, block: Block) -> Block:
        first, second = (self.of(a) for a in block.args)
        return self._b.add(first, second) if block.op == "add" else self._b.sub(first, second)

    def _scale(self, block: Block) -> Block:
        b, (s, a) = self._b, block.args
        return b.add(self._scaled(s, self.of(a)), self._scaled(self.of(s), a))

    def _scaled(self, factor: Block, block: Block) -> Block:
        return self._b.zero(*block.shape) if is_zero(factor) else self._b.scale(factor, block)

    def _mul(self, block: Block) -> Block:
        b, (a, x) = self._b, block.args
        rest = b.mul(a, self.of(x))
        if a in self._turns:
            return b.add(b.mul(b.skew(self._turns[a]), block), rest)
        if a.op == "transpose" and a.args[0] in self._turns:
            return b.mul(a, b.sub(self.of(x), b.mul(b.skew(self._turns[a.args[0]]), x)))
        return b.add(b.mul(self.of(a), x), rest)

    def _stack(self, block: Block) -> Block:
        data: Any = block.data
        parts, columns = [self.of(a) for a in block.args], len(data[1])
        return self._b.stack([parts[i : i + columns] for i in range(0, len(parts), columns)])

    def _take(self, block: Block) -> Block:
        data: Any = block.data
        return self._b.take(self.of(block.args[0]), *data)

    def _mirror(self, block: Block) -> Block:
        return self._b.mirror(self.of(block.args[0]))

    def _sandwich(self, block: Block) -> Block:
        b, (a, m) = self._b, block.args
        half = b.mul(self.of(a), b.mul(m, b.transpose(a)))
        inner = self.of(m)
        whole = b.symmetrise(half)
        return whole if is_zero(inner) else b.add(whole, b.sandwich(a, b.mirror(inner)))

    def _call(self, block: Block) -> Block:
        b, data = self._b, block.data
        assert isinstance(data, tuple)
        if data[0] == "where":
            condition, yes, no = block.args
            first, second = self.of(yes), self.of(no)
            return first if first is second else b.call("where", condition, first, second)
        terms = [(p, self.of(a)) for p, a in zip(partial_derivatives(b, block), block.args, strict=True)]
        return b.total([b.zero(1), *(b.mul(p, d) for p, d in terms)])


_RULES: Mapping[str, Callable[[Variation, Block], Block]] = {
    "add": Variation._sum, "sub": Variation._sum, "scale": Variation._scale, "mul": Variation._mul, "stack": Variation._stack,
    "take": Variation._take, "mirror": Variation._mirror, "sandwich": Variation._sandwich, "call": Variation._call,
    "neg": lambda v, block: v._b.neg(v.of(block.args[0])),
    "transpose": lambda v, block: v._b.transpose(v.of(block.args[0])),
    "symmetrise": lambda v, block: v._b.symmetrise(v.of(block.args[0])),
    "skew": lambda v, block: v._b.skew(v.of(block.args[0])),
}  # fmt: skip
