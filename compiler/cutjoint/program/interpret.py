"""The interpreter of blocks, with whole-matrix NumPy, independent of the lowering and the printer."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.ops import fact
from cutjoint.package.errors import EquationsError
from cutjoint.program.blocks import SUPPLIED, SURFACE, Block, SuppliedCall, surface_lookup
from cutjoint.program.lower import reachable_blocks

Array: TypeAlias = NDArray[np.float64]


class RoadTable(Protocol):
    """The values of a road at a point of the ground plane: height and slope, and their derivatives by x."""

    def height(self, x: float, y: float) -> float:
        """Height, m."""

    def slope(self, x: float, y: float) -> float:
        """dz/dx as the wheel feels it."""

    def height_dx(self, x: float, y: float) -> float:
        """The derivative of the height by x."""

    def slope_dx(self, x: float, y: float) -> float:
        """The derivative of the slope by x."""

    # One that has a surface has `surface` and `friction` too, which take x, y and the orders of the derivative by them.


def interpret_blocks(roots: Iterable[Block], inputs: Mapping[str, Array], roads: Mapping[str, RoadTable]) -> dict[Block, Array]:
    """Evaluate the roots and all that they depend on; inputs are columns by symbol name. Inputs (..., n) may carry batch axes, which the
    values (..., rows, columns) of all that depends on them have too. The lanes of a block are the axis before its rows."""
    constants, others = in_order(tuple(roots))
    values = dict(constants)
    with np.errstate(all="ignore"):
        for block in others:
            values[block] = evaluate_block(block, [values[a] for a in block.args], inputs, roads)
    return values


@lru_cache(maxsize=16)
def in_order(roots: tuple[Block, ...]) -> tuple[dict[Block, Array], list[Block]]:
    """The values of blocks that read no input and no road, and the other blocks, arguments first."""
    constants: dict[Block, Array] = {}
    others = []
    with np.errstate(all="ignore"):
        for block in reachable_blocks(roots):
            data: Any = block.data
            if block.op == "symbol" or (block.op == "call" and data[1] is not None) or not all(a in constants for a in block.args):
                others.append(block)
            else:
                constants[block] = evaluate_block(block, [constants[a] for a in block.args], {}, {})
    return constants, others


def evaluate_block(block: Block, args: list[Array], inputs: Mapping[str, Array], roads: Mapping[str, RoadTable]) -> Array:
    if (matrix := _MATRIX.get(block.op)) is not None:
        return matrix(*args)
    data: Any = block.data
    if block.op in ("const", "lane_const"):
        return np.array(data, dtype=float)
    if block.op == "symbol":
        column = np.asarray(inputs[str(data)], dtype=float)
        return column.reshape(*column.shape[:-1], *block.shape)
    if block.op == "call":
        return call_function(data[0], data[1], args, roads)
    if block.op == "stack":
        return _stack(data, args)
    if block.op == "take":
        return args[0][..., slice(*data[0]), slice(*data[1])]
    if block.op == "gather":
        return np.stack(_over_one_batch(args), axis=-3)
    if block.op == "lane":
        return args[0][..., data, :, :]
    assert block.op == "lane_sum"
    return np.asarray(args[0].sum(axis=-3))


def call_function(function: str, table: str | None, args: list[Any], roads: Mapping[str, RoadTable]) -> Array:
    """The value of a function, or of a road's table, for numbers.  Raises EquationsError for a function that a user supplies."""
    if table is not None:
        lookup, by = surface_lookup(function) if function.startswith(SURFACE) else (function, None)
        answer, orders = getattr(roads[table], lookup.removeprefix("road_")), () if by is None else (by.count("x"), by.count("y"))
        places = np.broadcast_arrays(*args)  # a road has a value for one place, not for a batch
        return np.asarray(np.vectorize(lambda x, y: answer(float(x), float(y), *orders), otypes=[float])(*places))
    if function.startswith(SUPPLIED):
        name = SuppliedCall.read(function).name
        raise EquationsError(f"function '{name}': its code is C++, and here a program is interpreted; only compiled runs have it")
    return np.asarray(fact(function, "numpy")(*args), dtype=float)


def _stack(data: Any, args: list[Array]) -> Array:
    rows, columns, parts = len(data[0]), len(data[1]), _over_one_batch(args)
    return np.concatenate([np.concatenate(parts[i * columns : (i + 1) * columns], axis=-1) for i in range(rows)], axis=-2)


def _over_one_batch(args: Sequence[Array]) -> list[Array]:
    """The matrices with equal batch axes; otherwise NumPy would take a matrix for a row of vectors in a solution."""
    batches = {a.shape[:-2] for a in args}
    if len(batches) == 1:
        return list(args)
    batch = np.broadcast_shapes(*batches)
    return [np.broadcast_to(a, (*batch, *a.shape[-2:])) for a in args] if batch else list(args)


def transposed(a: Array) -> Array:
    return np.swapaxes(a, -1, -2)


def skewed(p: Array) -> Array:
    found = np.zeros((*p.shape[:-2], 3, 3))
    for row, column, part in ((2, 1, 0), (0, 2, 1), (1, 0, 2)):
        found[..., row, column], found[..., column, row] = p[..., part, 0], -p[..., part, 0]
    return found


def _ldl(m: Array) -> tuple[Array, Array]:
    c = np.linalg.cholesky(m)
    diagonal = np.diagonal(c, axis1=-2, axis2=-1)
    return c / diagonal[..., None, :], (1.0 / diagonal**2)[..., None]


def _substitute(lower: Array, b: Array) -> Array:
    """The solution of L x = b by substitution, whose rounding does not depend on units of rows; that of LU with pivots does."""
    lower, x = _over_one_batch([lower, b])
    x = x.copy()
    for k in range(1, x.shape[-2]):
        x[..., k : k + 1, :] -= lower[..., k : k + 1, :k] @ x[..., :k, :]
    return x


_MATRIX: dict[str, Callable[..., Array]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "neg": lambda a: -a,
    "scale": lambda s, a: s * a,
    "mul": lambda a, b: a @ b,
    "transpose": transposed,
    "symmetrise": lambda a: a + transposed(a),
    "sandwich": lambda a, m: a @ m @ transposed(a),
    "gram": lambda y, d: transposed(y) @ (d * y),
    "weigh": lambda d, y: d * y,
    "mirror": lambda a: np.triu(a) + transposed(np.triu(a, 1)),
    "skew": skewed,
    "ldl_factor": lambda m: _ldl(m)[0],
    "ldl_pivots": lambda m: _ldl(m)[1],
    "forward": _substitute,
    "backward": lambda lower, b: _substitute(transposed(lower)[..., ::-1, ::-1], b[..., ::-1, :])[..., ::-1, :],
}
