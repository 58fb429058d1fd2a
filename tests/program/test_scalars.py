"""The scalar graph's algebra keeps values: expressions built through it give what Python gives for the expression as written."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cutjoint.program.blocks import BindingTime
from cutjoint.program.scalars import Graph, OverflowedConstantError
from tests.oracles.scalars import interpret_scalars

SYMBOLS = 4
Expression = tuple[Any, ...]

numbers = st.one_of(st.sampled_from([0.0, 1.0, -1.0, 2.0, -0.5]), st.floats(-1e3, 1e3).filter(lambda x: abs(x) > 1e-3))
values = st.lists(st.floats(-1e2, 1e2).filter(lambda x: abs(x) > 1e-3), min_size=SYMBOLS, max_size=SYMBOLS)
symbols = st.tuples(st.just("symbol"), st.integers(0, SYMBOLS - 1))
leaves = st.one_of(symbols, st.tuples(st.just("const"), numbers))


def grow(children: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    binary = st.tuples(st.sampled_from(["add", "sub", "mul"]), children, children)
    negated = st.tuples(st.just("neg"), children)
    divisor = st.one_of(symbols, st.tuples(st.just("neg"), symbols))
    return st.one_of(binary, negated, st.tuples(st.just("div"), children, divisor))


expressions = st.recursive(leaves, grow, max_leaves=16)

PYTHON: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b, "neg": lambda a: -a,
}  # fmt: skip


def build(graph: Graph, e: Expression) -> int:
    """The expression in the graph."""
    if e[0] == "symbol":
        return graph.symbol("x", e[1], BindingTime.ITERATION)
    if e[0] == "const":
        return graph.const(e[1])
    return getattr(graph, e[0])(*(build(graph, a) for a in e[1:]))


def evaluate(e: Expression, x: list[float]) -> float:
    """The expression as written."""
    if e[0] == "symbol":
        return x[e[1]]
    return e[1] if e[0] == "const" else PYTHON[e[0]](*(evaluate(a, x) for a in e[1:]))


def value_of(graph: Graph, node: int, x: list[float]) -> float:
    return interpret_scalars(graph, [node], {"x": np.array(x)}, {})[node]


@given(expressions, values)
@settings(max_examples=400, deadline=None)
@example(("sub", ("neg", ("symbol", 0)), ("symbol", 0)), [1.5, 1, 1, 1])
@example(("mul", ("neg", ("symbol", 0)), ("const", -0.5)), [1.5, 1, 1, 1])
@example(("sub", ("const", -1.0), ("symbol", 0)), [1.5, 1, 1, 1])
@example(("div", ("const", -2.0), ("neg", ("symbol", 1))), [1.5, -3, 1, 1])
def test_canonical_forms_keep_the_value_to_the_last_bit(e: Expression, x: list[float]) -> None:
    """Signs, zeros, ones and the order of a sum or product of two cost no rounding."""
    graph = Graph()
    assert value_of(graph, build(graph, e), x) == evaluate(e, x)


@given(expressions, values)
@settings(max_examples=200, deadline=None)
def test_no_node_is_left_to_simplify(e: Expression, x: list[float]) -> None:
    """No zeros and ones as operands, no negation inside, no operation on constants alone, no difference twice."""
    graph = Graph()
    root = build(graph, e)
    for n in graph.reachable([root]):
        node = graph.nodes[n]
        operands = [graph.nodes[a] for a in node.args]
        if node.op in ("add", "sub", "mul", "div"):
            assert any(o.op != "const" for o in operands)
            assert all(o.op != "neg" for o in operands)
        if node.op in ("add", "sub", "mul"):
            assert all(o.data not in (0.0, *([1.0] if node.op == "mul" else [])) for o in operands if o.op == "const")
        if node.op in ("add", "mul"):
            assert node.args == tuple(sorted(node.args))
    differences = {node.args for node in graph.nodes if node.op == "sub"}
    assert not any((b, a) in differences for a, b in differences)


@given(leaves, leaves)
def test_a_difference_and_its_negative_share_a_node(a: Expression, b: Expression) -> None:
    graph = Graph()
    one, other = build(graph, a), build(graph, b)
    difference = graph.sub(one, other)
    assert graph.neg(difference) == graph.sub(other, one)
    assert graph.add(one, other) == graph.add(other, one)
    assert graph.mul(one, other) == graph.mul(other, one)


@given(st.integers(0, SYMBOLS - 1), numbers.filter(bool), values)
def test_division_by_a_constant_is_right_to_a_rounding(i: int, c: float, x: list[float]) -> None:
    graph = Graph()
    quotient = value_of(graph, graph.div(graph.symbol("x", i, BindingTime.ITERATION), graph.const(c)), x)
    assert quotient == pytest.approx(x[i] / c, rel=4e-16)


@given(st.integers(0, SYMBOLS - 1), st.integers(-6, 8), values)
def test_power(i: int, exponent: int, x: list[float]) -> None:
    graph = Graph()
    node = graph.power(graph.symbol("x", i, BindingTime.ITERATION), exponent)
    assert value_of(graph, node, x) == pytest.approx(x[i] ** exponent, rel=1e-14)


UNARY: dict[str, tuple[Callable[[float], float], st.SearchStrategy[float]]] = {
    **{name: (getattr(np, name), st.floats(-3, 3)) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp")},
    "asin": (np.arcsin, st.floats(-1, 1)), "acos": (np.arccos, st.floats(-1, 1)), "atan": (np.arctan, st.floats(-9, 9)),
    "sqrt": (np.sqrt, st.floats(0, 9)), "log": (np.log, st.floats(1e-3, 9)), "abs": (np.abs, st.floats(-9, 9)),
}  # fmt: skip


@pytest.mark.parametrize("function", UNARY)
@pytest.mark.parametrize("form", ["plain", "negated", "constant"])
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_function_of_one(function: str, form: str, data: st.DataObject) -> None:
    """A function of x, of -(-x), where odd and even functions drop signs, and folded of a constant."""
    expected, domain = UNARY[function]
    x = data.draw(domain)
    graph = Graph()
    if form == "constant":
        argument, inputs = graph.const(x), [0.0]
    else:
        symbol = graph.symbol("x", 0, BindingTime.ITERATION)
        argument, inputs = (symbol, [x]) if form == "plain" else (graph.neg(symbol), [-x])
    assert value_of(graph, graph.call(function, (argument,)), inputs) == pytest.approx(float(expected(x)), rel=1e-15, abs=1e-300)


BINARY: dict[str, Callable[[float, float], float]] = {
    "atan2": math.atan2, "lt": lambda a, b: float(a < b), "le": lambda a, b: float(a <= b),
    "and": lambda a, b: float(a != 0 and b != 0), "or": lambda a, b: float(a != 0 or b != 0),
    "pow": lambda a, b: abs(a) ** b,
}  # fmt: skip


@pytest.mark.parametrize("folded", [False, True])
@pytest.mark.parametrize("function", BINARY)
@given(a=st.sampled_from([0.0, 1.0, -1.0, 2.5, -0.25]), b=st.sampled_from([0.0, 1.0, -1.0, 2.5, 3.0]))
@settings(deadline=None)
def test_function_of_two(function: str, folded: bool, a: float, b: float) -> None:
    if function == "pow":
        a = abs(a) + 0.5
    graph = Graph()
    x = [graph.const(c) if folded else graph.symbol("x", i, BindingTime.ITERATION) for i, c in enumerate((a, b))]
    assert value_of(graph, graph.call(function, tuple(x)), [a, b]) == pytest.approx(BINARY[function](a, b), rel=1e-15)


@given(st.booleans(), st.booleans(), values)
def test_choice(condition: bool, folded: bool, x: list[float]) -> None:
    graph = Graph()
    when = graph.const(float(condition)) if folded else graph.symbol("x", 2, BindingTime.ITERATION)
    node = graph.call("where", (when, *(graph.symbol("x", i, BindingTime.ITERATION) for i in (0, 1))))
    assert value_of(graph, node, [*x[:2], float(condition)]) == (x[0] if condition else x[1])


def test_choice_between_equals_is_no_choice() -> None:
    graph = Graph()
    x, when = (graph.symbol("x", i, BindingTime.ITERATION) for i in (0, 1))
    assert graph.call("where", (when, x, x)) == x


@pytest.mark.parametrize(("function", "argument"), [("sqrt", -1.0), ("log", -1.0), ("asin", 2.0)])
def test_undefined_constants_are_left_to_the_run(function: str, argument: float) -> None:
    graph = Graph()
    node = graph.call(function, (graph.const(argument),))
    assert not math.isfinite(value_of(graph, node, []))


OVERFLOWS: dict[str, Callable[[Graph, int, int], int]] = {
    "sum": lambda g, big, x: g.add(big, big),
    "difference": lambda g, big, x: g.sub(g.neg(big), big),
    "product": lambda g, big, x: g.mul(big, big),
    "quotient": lambda g, big, x: g.div(big, g.const(1e-10)),
    "power": lambda g, big, x: g.power(big, 2),
    "function": lambda g, big, x: g.call("exp", (big,)),
    "fractional power": lambda g, big, x: g.call("pow", (big, g.const(1.5))),
    "lanes": lambda g, big, x: g.mul(g.lane_const([1.0, 1e308]), big),
    "sum of lanes": lambda g, big, x: g.lane_sum(g.lane_const([1e308, 1.5e308])),
}


@pytest.mark.parametrize("kind", OVERFLOWS)
def test_constants_that_overflow_name_their_section(kind: str) -> None:
    graph = Graph(section=3)
    with pytest.raises(OverflowedConstantError) as caught:
        OVERFLOWS[kind](graph, graph.const(1e308), graph.symbol("x", 0, BindingTime.ITERATION))
    assert caught.value.section == 3


@pytest.mark.parametrize("smallest", [5e-324, 1e-310, -1e-310])
def test_quotients_by_the_smallest_numbers_stay_quotients(smallest: float) -> None:
    """Their inverse overflows, the quotient need not."""
    graph = Graph()
    x = graph.symbol("x", 0, BindingTime.ITERATION)
    assert value_of(graph, graph.div(x, graph.const(smallest)), [2 * smallest]) == 2.0
    lanes = graph.div(x, graph.lane_const([smallest, 1.0]))
    assert value_of(graph, graph.lane(lanes, 0), [2 * smallest]) == 2.0


def test_functions_of_constants_in_lanes_are_folded() -> None:
    graph = Graph()
    angles = graph.lane_const([0.4, -0.5])
    assert [graph.value(graph.lane(graph.call("cos", (angles,)), k)) for k in range(2)] == [math.cos(0.4), math.cos(-0.5)]
    assert graph.value(graph.lane(graph.call("atan2", (angles, graph.const(2.0))), 1)) == math.atan2(-0.5, 2.0)


def test_constants_that_are_not_folded_are_computed_when_parameters_load() -> None:
    graph = Graph()
    nothing, compared = graph.call("log", (graph.const(-1.0),)), graph.call("lt", (graph.lane_const([1.0, 2.0]), graph.const(1.5)))
    assert [graph.nodes[n].binding for n in (nothing, compared)] == [BindingTime.PARAM] * 2


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("x", [0.0, -0.3, 1.0, 7.0, -1e9, 1e200, -math.inf])
def test_cosine_and_double_sine_of_an_arc_tangent_need_neither(sign: float, x: float) -> None:
    """Of either sign, whichever of the factors has the smaller number."""
    for first in (True, False):
        graph = Graph()
        two = graph.const(2.0) if first else 0
        angle = graph.call("atan", (graph.symbol("x", 0, BindingTime.ITERATION),))
        angle = angle if sign > 0 else graph.neg(angle)
        sine = graph.call("sin", (graph.mul(two if first else graph.const(2.0), angle),))
        found = interpret_scalars(graph, [graph.call("cos", (angle,)), sine], {"x": np.array([x])}, {})
        assert found[graph.call("cos", (angle,))] == pytest.approx(math.cos(math.atan(x)), rel=1e-15, abs=1e-16)
        assert found[sine] == pytest.approx(math.sin(2 * sign * math.atan(x)), rel=1e-14, abs=1e-15)
        assert not {"sin", "cos"} & {graph.nodes[n].op for n in graph.reachable([graph.call("cos", (angle,)), sine])}
