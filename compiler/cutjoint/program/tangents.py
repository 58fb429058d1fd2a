"""Blocks interpreted in NumPy with their exact directional derivatives: forward mode, all seeds at once."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import partialmethod
from typing import Any, cast

import numpy as np

from cutjoint.program.blocks import Block, is_zero
from cutjoint.program.differentiate import partial_derivatives
from cutjoint.program.interpret import Array, RoadTable, call_function, evaluate_block, in_order, skewed, transposed

_TOUCHED = 1e-6  #: powers of contacts grow at least as fast as at this deflection, m
_LINEAR: Mapping[str, Any] = {
    "neg": lambda a: -a, "transpose": transposed, "skew": skewed, "symmetrise": lambda a: a + transposed(a),
    "mirror": lambda a: np.triu(a) + transposed(np.triu(a, 1)),
}  # fmt: skip


@dataclass(frozen=True)
class _Number:
    value: Any
    op: str = "const"
    args: tuple[Any, ...] = ()
    data: Any = None


class _Numbers:
    """The algebra of scalars with values, of which derivatives are made; looks roads up."""

    def __init__(self, roads: Mapping[str, RoadTable]) -> None:
        self._roads = roads

    def number(self, value: float) -> _Number:
        return _Number(value, data=((value,),))

    def zero(self, n: int) -> _Number:
        return self.number(0.0)

    def call(self, function: str, *args: _Number, table: str | None = None) -> _Number:
        return _Number(call_function(function, table, [a.value for a in args], self._roads), "call", args, (function, table))

    add, sub = partialmethod(call, "add"), partialmethod(call, "sub")
    neg, mul = partialmethod(call, "neg"), partialmethod(call, "mul")


def interpret_tangents(
    roots: Iterable[Block], inputs: Mapping[str, Array], seeds: Mapping[str, Array], roads: Mapping[str, RoadTable],
    touching: Collection[Block] = (),
) -> tuple[dict[Block, Array], dict[Block, Array]]:  # fmt: skip
    """The values (rows, columns) of roots and of all that they depend on, and their non-zero changes (directions, rows, columns).
    Inputs (n,) are columns by symbol name, ``seeds`` (directions, n) their changes. Choices between a value and zero whose conditions
    are ``touching`` always have the value, if it is finite: such contacts pull while open."""
    constants, others = in_order(tuple(roots))
    values, changes, numbers = dict(constants), dict[Block, Array](), _Numbers(roads)
    with np.errstate(all="ignore"):
        for block in others:
            args = [values[a] for a in block.args]
            values[block] = evaluate_block(block, args, inputs, roads)
            chosen = _chosen(block, args, touching) if touching and block.op == "call" else None
            if chosen is not None:
                values[block] = args[chosen]
                if block.args[chosen] in changes:
                    changes[block] = changes[block.args[chosen]]
            elif touching and block.op == "call" and _is_root(block, args):
                x, n = args[0], float(args[1].item())
                values[block] = np.sign(x) * np.abs(x) ** n
                if block.args[0] in changes:
                    changes[block] = n * np.maximum(np.abs(x), _TOUCHED) ** (n - 1) * changes[block.args[0]]
            elif block.op == "symbol":
                if (seed := seeds.get(str(block.data))) is not None:
                    changes[block] = seed[..., np.newaxis]
            elif any(a in changes for a in block.args):
                change = _change(block, args, values[block], [changes.get(a) for a in block.args], numbers)
                if change is not None:
                    changes[block] = change
    return values, changes


def _is_root(block: Block, args: list[Array]) -> bool:
    """Return whether a block is a power with a fractional exponent of zero or a negative number."""
    return block.data[0] == "pow" and args[0].item() <= _TOUCHED and not float(args[1].item()).is_integer()  # type: ignore[index]


def gate(block: Block) -> int:
    """The index of the argument of a choice whose other argument is zero; 0 for all other blocks."""
    if block.op != "call" or block.data[0] != "where":  # type: ignore[index]
        return 0
    return next((3 - i for i in (1, 2) if is_zero(block.args[i]) and not is_zero(block.args[3 - i])), 0)


def _chosen(block: Block, args: list[Array], touching: Collection[Block]) -> int | None:
    chosen = gate(block)
    return chosen if chosen and block.args[0] in touching and np.isfinite(args[chosen]).all() else None


def _change(block: Block, args: list[Array], value: Array, d: list[Array | None], numbers: _Numbers) -> Array | None:
    """The change of a block for given changes of its arguments, None if it does not change."""
    op, data = block.op, cast("Any", block.data)
    if op == "call":
        return _of_call(block, args, value, d, numbers)
    if op == "stack":
        return _of_stack(data, args, d)
    first = d[0]
    if op == "sandwich":
        a, m = args
        terms = [None if first is None else first @ m @ a.T, None if first is None else a @ m @ transposed(first)]
        return _sum(*terms, None if d[1] is None else a @ d[1] @ a.T)
    if op == "mul":
        return _sum(None if first is None else first @ args[1], None if d[1] is None else args[0] @ d[1])
    if op == "scale":
        return _sum(None if first is None else first * args[1], None if d[1] is None else args[0] * d[1])
    if op in ("add", "sub"):
        return _sum(first, d[1] if d[1] is None or op == "add" else -d[1])
    assert first is not None
    if op == "take":
        return first[:, slice(*data[0]), slice(*data[1])]
    return np.asarray(_LINEAR[op](first))


def _sum(*terms: Array | None) -> Array | None:
    found = [term for term in terms if term is not None]
    return sum(found[1:], found[0]) if found else None


def _of_stack(data: Any, args: list[Array], d: list[Array | None]) -> Array:
    count = next(len(x) for x in d if x is not None)
    parts = [np.zeros((count, *a.shape)) if x is None else x for a, x in zip(args, d, strict=True)]
    columns = len(data[1])
    return np.concatenate([np.concatenate(parts[i : i + columns], axis=2) for i in range(0, len(parts), columns)], axis=1)


def _of_call(block: Block, args: list[Array], value: Array, d: list[Array | None], numbers: _Numbers) -> Array | None:
    function = block.data[0]  # type: ignore[index]
    if function == "where":
        return d[1] if args[0].item() else d[2]
    known = [numbers.number(a.item()) for a in args]
    partials = partial_derivatives(numbers, _Number(value.item(), "call", tuple(known), block.data))
    terms = [p.value * x for p, x in zip(partials, d, strict=True) if x is not None and p.value != 0]
    return _sum(*terms)
