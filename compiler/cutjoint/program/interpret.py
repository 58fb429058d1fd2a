"""Interpreters of both IRs in NumPy: the oracle of every pass and of the generated code.

They share no code with the lowering or the printer: blocks are evaluated with whole-matrix NumPy, scalars one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.program.blocks import Block
from cutjoint.program.lower import reachable_blocks
from cutjoint.program.scalars import Graph

Array: TypeAlias = NDArray[np.float64]


class RoadTable(Protocol):
    """What a road answers: height and slope at a point of the ground plane."""

    def height(self, x: float, y: float) -> float:
        """Height, m."""

    def slope(self, x: float, y: float) -> float:
        """dz/dx."""


FUNCTIONS: dict[str, Callable[..., Any]] = {
    "mul": lambda a, b: a * b, "div": lambda a, b: np.float64(a) / np.float64(b), "sqrt": np.sqrt, "sin": np.sin,
    "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2,
    "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "exp": np.exp, "log": np.log, "abs": abs,
    "pow": lambda a, b: np.power(np.float64(a), b), "lt": lambda a, b: float(a < b), "le": lambda a, b: float(a <= b),
    "and": lambda a, b: float(a != 0 and b != 0), "or": lambda a, b: float(a != 0 or b != 0),
    "not": lambda a: float(a == 0), "where": lambda c, a, b: a if c else b,
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "neg": lambda a: -a,
}  # fmt: skip


def interpret_blocks(
    roots: Iterable[Block], inputs: Mapping[str, Array], roads: Mapping[str, RoadTable]
) -> dict[Block, Array]:
    """Evaluate the roots and all that they depend on; inputs are columns by symbol name."""
    values: dict[Block, Array] = {}
    with np.errstate(all="ignore"):
        for block in reachable_blocks(roots):
            values[block] = _evaluate(block, [values[a] for a in block.args], inputs, roads)
    return values


def _evaluate(block: Block, args: list[Array], inputs: Mapping[str, Array], roads: Mapping[str, RoadTable]) -> Array:
    data: Any = block.data
    if block.op == "const":
        return np.array(data, dtype=float)
    if block.op == "symbol":
        return np.asarray(inputs[str(data)], dtype=float).reshape(block.shape)
    if block.op == "call":
        return _call(data[0], data[1], [float(a[0, 0]) for a in args], roads)
    if block.op == "stack":
        rows, columns = len(data[0]), len(data[1])
        return np.block([args[i * columns : (i + 1) * columns] for i in range(rows)])
    if block.op == "take":
        return args[0][slice(*data[0]), slice(*data[1])]
    return _MATRIX[block.op](*args)


def _call(function: str, table: str | None, args: list[float], roads: Mapping[str, RoadTable]) -> Array:
    if table is not None:
        road = roads[table]
        return np.array([[road.height(*args) if function == "road_height" else road.slope(*args)]])
    return np.array([[float(FUNCTIONS[function](*args))]])


def _skew(p: Array) -> Array:
    x, y, z = p.ravel()
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def _ldl(m: Array) -> tuple[Array, Array]:
    c = np.linalg.cholesky(m)
    diagonal = np.diag(c)
    return c / diagonal, (1.0 / diagonal**2).reshape(-1, 1)


_MATRIX: dict[str, Callable[..., Array]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "neg": lambda a: -a,
    "scale": lambda s, a: s[0, 0] * a,
    "mul": lambda a, b: a @ b,
    "transpose": lambda a: a.T,
    "symmetrise": lambda a: a + a.T,
    "sandwich": lambda a, m: a @ m @ a.T,
    "gram": lambda y, d: y.T @ (d * y),
    "weigh": lambda d, y: d * y,
    "mirror": lambda a: np.triu(a) + np.triu(a, 1).T,
    "skew": _skew,
    "ldl_factor": lambda m: _ldl(m)[0],
    "ldl_pivots": lambda m: _ldl(m)[1],
    "forward": lambda lower, b: np.linalg.solve(lower, b),
    "backward": lambda lower, b: np.linalg.solve(lower.T, b),
}


def interpret_scalars(
    graph: Graph, roots: list[int], inputs: Mapping[str, Array], roads: Mapping[str, RoadTable]
) -> dict[int, float]:
    """Evaluate the roots and all that they depend on."""
    values: dict[int, float] = {}
    with np.errstate(all="ignore"):
        for number in graph.reachable(roots):
            node = graph.nodes[number]
            data: Any = node.data
            if node.op == "const":
                values[number] = data
            elif node.op == "symbol":
                values[number] = float(np.ravel(inputs[data[0]])[data[1]])
            elif node.op in ("road_height", "road_slope"):
                values[number] = float(_call(node.op, data, [values[a] for a in node.args], roads)[0, 0])
            else:
                values[number] = float(FUNCTIONS[node.op](*(values[a] for a in node.args)))
    return values
