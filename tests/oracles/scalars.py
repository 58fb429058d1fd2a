"""Programs of scalars, evaluated node by node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cutjoint.program.interpret import Array, RoadTable, call_function
from cutjoint.program.scalars import Graph, Scalar


def interpret_scalars(
    graph: Graph, roots: list[int], inputs: Mapping[str, Array], roads: Mapping[str, RoadTable]
) -> dict[int, Any]:
    """Evaluate the roots and all that they depend on: numbers, or arrays of one number a lane."""
    values: dict[int, Any] = {}
    for number in graph.reachable(roots):
        node = graph.nodes[number]
        values[number] = interpret_scalar(node, [values[a] for a in node.args], inputs, roads)
    return values


def interpret_scalar(node: Scalar, args: Sequence[Any], inputs: Mapping[str, Array], roads: Mapping[str, RoadTable]) -> Any:
    """The value of one node, a number or an array of one number a lane."""
    data: Any = node.data
    with np.errstate(all="ignore"):
        if node.op == "const":
            return data
        if node.op == "symbol":
            return float(np.ravel(inputs[data[0]])[data[1]])
        if node.op.startswith("road_"):
            return float(call_function(node.op, data, list(args), roads))
        if node.op == "lane_const":
            return np.array(data)
        if node.op == "gather":
            return np.array(args)
        if node.op == "lane":
            return float(args[0][data])
        if node.op == "lane_sum":
            return float(np.sum(args[0]))
        result = call_function(node.op, None, list(args), roads)
        return result if node.lanes else float(result)
