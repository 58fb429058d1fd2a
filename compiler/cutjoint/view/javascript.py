"""Blocks as functions in JavaScript: numbers and operations, and no text of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cutjoint.program.blocks import Block
from cutjoint.program.lower import Lowering
from cutjoint.program.scalars import Graph, Scalar
from cutjoint.view.records import Array

_OPERATORS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "and": "&&", "or": "||"}
_FUNCTIONS = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "abs", "pow")


def print_function(name: str, blocks: Sequence[Block], values: Mapping[str, Array], places: Mapping[str, int]) -> str:
    """A function of an array q that returns the elements of blocks, row by row.

    Symbols are places in q, those of ``places`` from there on, or have ``values``.
    """
    lowering = Lowering()
    lowering.lower(blocks)
    graph = lowering.graph
    results = [scalar for block in blocks for row in lowering.elements[block] for scalar in row]
    lines = [f"  const x{n} = {_expression(graph, graph.nodes[n], values, places)};" for n in graph.reachable(results)]
    return "\n".join([f"function {name}(q) {{", *lines, f"  return [{', '.join(f'x{n}' for n in results)}];", "}", ""])


def _expression(graph: Graph, node: Scalar, values: Mapping[str, Array], places: Mapping[str, int]) -> str:
    arguments = [f"x{a}" for a in node.args]
    if node.op == "const":
        return repr(node.data)
    if node.op == "symbol":
        assert isinstance(node.data, tuple)
        symbol, index = node.data
        return f"q[{places[symbol] + index}]" if symbol in places else repr(float(values[symbol][index]))
    if node.op == "neg":
        return f"-{arguments[0]}"
    if node.op == "not":
        return f"!{arguments[0]}"
    if node.op == "where":
        return f"{arguments[0]} ? {arguments[1]} : {arguments[2]}"
    if node.op in _OPERATORS:
        return f" {_OPERATORS[node.op]} ".join(arguments)
    assert node.op in _FUNCTIONS, node.op
    return f"Math.{node.op}({', '.join(arguments)})"
