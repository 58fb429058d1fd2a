"""Derivatives in the IR of scalars: adjoints, and derivatives of many results by many scalars.

Adjoints propagate from a program's results to their arguments. They are scalars of the same graph, which are shared and printed like
others. Lanes are kept: the adjoint of a broadcast over lanes is a sum over them, and vice versa.

Derivatives of many results by many scalars are found by elimination. Partial derivatives are the edges of a graph, whose vertices are
eliminated one by one. Edges from predecessors to successors replace a vertex; the one with the fewest such edges is next, new ones counted
twice (Griewank, Walther, Evaluating Derivatives, section 9.2).
"""

import heapq
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce
from itertools import product
from typing import TypeAlias

from cutjoint.program.differentiate import partial_derivatives
from cutjoint.program.lower import call_scalar
from cutjoint.program.scalars import Graph

_ALL = -1  #: all lanes of a scalar
#: An edge between two scalars: its coefficients by the lanes of source and target, None for a scalar without lanes.  From all lanes to all,
#: each lane maps to itself; from all to none, lanes are summed.  A target of -1 - n from none is the sum of a coefficient's n lanes, which
#: is formed as late as possible.
_Edge: TypeAlias = dict[tuple[int | None, int | None], int]


@dataclass(frozen=True, eq=False)
class _Scalar:
    """A node of the graph as partial derivatives see it."""

    number: int
    op: str
    args: "tuple[_Scalar, ...]"
    data: tuple[str, object]


class _Scalars:
    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._known: dict[int, _Scalar] = {}
        self._squares: dict[int, int | None] = {}

    def of(self, n: int, depth: int = 1) -> _Scalar:
        """A node, with its arguments where they are asked for."""
        node = self._graph.nodes[n]
        if depth:
            return _Scalar(n, node.op, tuple(self.of(a, 0) for a in node.args), (node.op, node.data))
        if n not in self._known:
            self._known[n] = _Scalar(n, node.op, (), (node.op, node.data))
        return self._known[n]

    def number(self, value: float) -> _Scalar:
        return self.of(self._graph.const(value), 0)

    def zero(self, n: int) -> _Scalar:
        assert n == 1
        return self.number(0.0)

    def add(self, a: _Scalar, b: _Scalar) -> _Scalar:
        return self.of(self._graph.add(a.number, b.number), 0)

    def sub(self, a: _Scalar, b: _Scalar) -> _Scalar:
        return self.of(self._graph.sub(a.number, b.number), 0)

    def neg(self, a: _Scalar) -> _Scalar:
        return self.of(self._graph.neg(a.number), 0)

    def mul(self, a: _Scalar, b: _Scalar) -> _Scalar:
        return self.of(self._graph.mul(a.number, b.number), 0)

    def call(self, function: str, *args: _Scalar, table: str | None = None) -> _Scalar:
        return self.of(call_scalar(self._graph, function, tuple(a.number for a in args), table), 0)

    def squares(self, n: int, depth: int = 99) -> int | None:
        """The squares in a sum, or in a root of one: where they are zero its derivatives are, also times an infinite one.
        Weights that may be zero elsewhere are left out. None if there are other terms."""
        if n not in self._squares:
            self._squares[n] = self._find_squares(n, depth) if depth else None
        return self._squares[n]

    def _find_squares(self, n: int, depth: int) -> int | None:
        graph, node = self._graph, self._graph.nodes[n]
        if node.op not in ("add", "mul", "div", "sqrt", "pow"):
            return None
        for a, b in (node.args, node.args[::-1]) if node.op == "mul" else ():
            if a == b or (graph.nodes[a].op == "mul" and b in graph.nodes[a].args):
                return graph.mul(b, b)
        parts = [self.squares(a, depth - 1) for a in node.args]
        match node.op:
            case "add":
                found = graph.add(parts[0], parts[1]) if parts[0] and parts[1] else None
            case "mul":
                factors = [p or a for a, p in zip(node.args, parts, strict=True) if p or graph.value(a)]
                found = reduce(graph.mul, factors) if any(parts) else None
            case _:
                found = parts[0]
        return found if found and graph.nodes[found].lanes == node.lanes else None


@dataclass
class _Sums:
    """The derivatives accumulated at a node: a sum for all lanes, and one for each lane by itself."""

    all: int | None = None
    lanes: dict[int, int] = field(default_factory=dict)


def adjoint(graph: Graph, weights: Mapping[int, int], targets: Collection[int]) -> dict[int, int]:
    """The derivatives of a sum of nodes, each times the node of its weight, by each of the ``targets`` on which it depends.
    They have as many lanes as the target. Raises ValueError: an operation has no derivative."""
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
        derivative = _joined(graph, sums.pop(n), graph.nodes[n].lanes)
        if n in targets:
            found[n] = derivative
        elif graph.value(derivative) != 0.0:
            for a, share, lane in _shares(graph, scalars, n, derivative):
                if a in depends and graph.value(share) != 0.0:
                    _gather(graph, sums[a], share, lane)
    graph.section = section
    return found


def _gather(graph: Graph, sums: _Sums, share: int, lane: int | None = None) -> None:
    if lane is None:
        sums.all = share if sums.all is None else _plus(graph, sums.all, share)
    else:
        sums.lanes[lane] = share if lane not in sums.lanes else _plus(graph, sums.lanes[lane], share)


def _plus(graph: Graph, a: int, b: int) -> int:
    """A sum; that of two choices by the same condition is one choice."""
    one, other = graph.nodes[a], graph.nodes[b]
    if one.op == other.op == "where" and one.args[0] == other.args[0] and one.lanes == other.lanes:
        return graph.call("where", (one.args[0], *(_plus(graph, x, y) for x, y in zip(one.args[1:], other.args[1:], strict=True))))
    return graph.add(a, b)


def _joined(graph: Graph, sums: _Sums, lanes: int) -> int:
    """The sum of all derivatives accumulated at a node; with lanes, it may be the same in all of them."""
    if not sums.lanes:
        assert sums.all is not None
        return sums.all
    apart = graph.gather(tuple(sums.lanes.get(k, graph.const(0.0)) for k in range(lanes)))
    return apart if sums.all is None else graph.add(sums.all, apart)


def _shares(graph: Graph, scalars: _Scalars, n: int, derivative: int) -> Iterator[tuple[int, int, int | None]]:
    """The share of each argument in a node's derivative, and its lane, None for all."""
    node = graph.nodes[n]
    match node.op:
        case "gather":
            yield from ((a, graph.lane(derivative, k), None) for k, a in enumerate(node.args))
        case "lane":
            assert isinstance(node.data, int)
            yield node.args[0], derivative, node.data
        case "lane_sum":
            yield node.args[0], derivative, None
        case _:
            for a, share in zip(node.args, _products(graph, scalars, n, derivative), strict=True):
                yield a, share if graph.nodes[a].lanes else _over_lanes(graph, share, node.lanes), None


def _over_lanes(graph: Graph, share: int, lanes: int) -> int:
    """The share of an argument without lanes."""
    if graph.nodes[share].lanes:
        return graph.lane_sum(share)
    return graph.mul(graph.const(float(lanes)), share) if lanes else share


def _products(graph: Graph, scalars: _Scalars, n: int, derivative: int) -> Sequence[int]:
    """A node's derivative times its derivative by each argument."""
    node = graph.nodes[n]
    match node.op:
        case "add":
            return derivative, derivative
        case "sub":
            return derivative, graph.neg(derivative)
        case "neg":
            return (graph.neg(derivative),)
        case "where":
            zero = graph.const(0.0)
            return zero, graph.call("where", (node.args[0], derivative, zero)), graph.call("where", (node.args[0], zero, derivative))
        case "div":
            by_above = _chosen(graph, derivative, lambda x: graph.div(x, node.args[1]), graph.nodes[node.args[1]].lanes)
            by_above = graph.div(derivative, node.args[1]) if by_above is None else by_above
            return by_above, graph.neg(_times(graph, by_above, n))
        case "sqrt" | "pow" if (squares := scalars.squares(node.args[0])) is not None:
            moves = graph.call("lt", (graph.const(0.0), squares))
            if node.op == "sqrt":
                return (_times(graph, derivative, graph.div(graph.const(0.5), graph.call("where", (moves, n, graph.const(1.0))))),)
            shares = (_times(graph, derivative, p.number) for p in partial_derivatives(scalars, scalars.of(n)))
            return [graph.call("where", (moves, share, graph.const(0.0))) for share in shares]
    return [_times(graph, derivative, p.number) for p in partial_derivatives(scalars, scalars.of(n))]


def _times(graph: Graph, a: int, b: int) -> int:
    """A product; a branch that a choice excludes stays excluded, since it may be undefined there."""
    for one, other in ((a, b), (b, a)):
        chosen = _chosen(graph, one, partial(_times, graph, b=other), graph.nodes[other].lanes)
        if chosen is not None:
            return chosen
    return graph.mul(a, b)


def _chosen(graph: Graph, n: int, linear: Callable[[int], int], lanes: int) -> int | None:
    """A linear function of a choice that leaves zero in one case, applied to the other; None of any other node."""
    node = graph.nodes[graph.signless(n)]
    if node.op != "where" or 0.0 not in (graph.value(node.args[1]), graph.value(node.args[2])):
        return None
    condition, yes, no = node.args
    if graph.nodes[condition].lanes != max(graph.nodes[n].lanes, lanes):
        return None
    zero = graph.const(0.0)
    found = graph.call("where", (condition, *(linear(x) if graph.value(x) != 0.0 else zero for x in (yes, no))))
    return found if graph.signless(n) == n else graph.neg(found)


def derivatives(graph: Graph, results: Sequence[int], targets: Collection[int]) -> list[dict[int, int]]:
    """The derivatives of each result, without lanes, by each of the ``targets`` on which it depends, with that one's lanes.
    Raises ValueError: an operation has no derivative."""
    section, elimination = graph.section, _Elimination(graph, set(targets))
    found = elimination.run(results)
    graph.section = section
    return found


class _Elimination:
    """The linearised graph of some results: of each scalar the edges that lead to it, and the scalars to which some lead from it.  Results
    have numbers below 0; those that are lanes of one scalar are one with as many lanes."""

    def __init__(self, graph: Graph, targets: set[int]) -> None:
        self._graph = graph
        self._targets = targets
        self._gathered: list[int] = []  # targets side by side, by which derivatives have lanes until the end
        self._before: dict[int, dict[int, _Edge]] = {}
        self._behind: defaultdict[int, set[int]] = defaultdict(set)
        self._results: list[int] = []

    def run(self, results: Sequence[int]) -> list[dict[int, int]]:
        """The derivatives of results by targets."""
        places = [self._place(n) for n in results]
        self._results = list(dict.fromkeys(n for n, _ in places))
        self._linearise(self._results)
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
        number = {n: -1 - i for i, n in enumerate(self._results)}
        return [self._derivatives(self._before[number[n]], lane) for n, lane in places]

    def _place(self, n: int) -> tuple[int, int | None]:
        """The scalar of a result, or the one of which it is a lane."""
        node = self._graph.nodes[n]
        if node.op == "lane" and n not in self._targets and isinstance(node.data, int):
            return node.args[0], node.data
        return n, None

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
            key = (_ALL, _ALL) if graph.nodes[n].lanes else (None, None)
            self._enter(-1 - i, {n: {key: graph.const(1.0)}} if n in depends else {})

    def _enter(self, n: int, edges: dict[int, _Edge]) -> None:
        self._before[n] = edges
        for a in edges:
            self._behind[a].add(n)

    def _cost(self, n: int) -> int:
        """The number of edges that replace a scalar, new ones counted twice."""
        before, behind = self._before[n].keys(), self._behind[n]
        return 2 * len(before) * len(behind) - sum(len(before & self._before[c].keys()) for c in behind)

    def _eliminate(self, n: int) -> set[int]:
        """Eliminate a scalar; returns its neighbours."""
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
        return self._graph.nodes[self._results[-1 - n] if n < 0 else n].lanes

    def _join(self, edge: _Edge, lanes: int, first: _Edge, between: int, last: _Edge, behind: int) -> None:
        """Add the product of two consecutive edges; ``lanes`` are those of the scalars before, between and behind them."""
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
                        self._add(edge, (j, k), _times(graph, graph.lane(c, j), graph.lane(d, k)))
                elif start is not None and end == _ALL and reached is None:
                    for k in range(behind):
                        self._add(edge, (start, k), _times(graph, c, graph.lane(d, k)))
                elif reached == _ALL and start is None and end is None:
                    self._add(edge, (None, -1 - between), _times(graph, c, d))
                else:
                    self._add(edge, (start, end), _times(graph, c, d))
            elif reached == _ALL:
                assert left is not None
                self._add(edge, (left if start == _ALL else start, end), _times(graph, graph.lane(c, left), d))
            elif left == _ALL:
                assert reached is not None
                self._add(edge, (start, reached if end == _ALL else end), _times(graph, c, graph.lane(d, reached)))

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

    def _derivatives(self, edges: dict[int, _Edge], lane: int | None) -> dict[int, int]:
        """The derivatives by targets of a result to which edges lead, or of a lane of it."""
        graph, found = self._graph, {a: derivative for a, edge in edges.items()
            if (derivative := self._derivative(a, edge, lane)) is not None}
        for n in self._gathered:
            if n in found:
                derivative = found.pop(n)
                for k, a in enumerate(graph.nodes[n].args):
                    if a in self._targets:
                        found[a] = graph.add(found[a], graph.lane(derivative, k)) if a in found else graph.lane(derivative, k)
        return found

    def _derivative(self, target: int, edge: _Edge, lane: int | None) -> int | None:
        """The derivative for an edge from a target to a result, or to a lane of it. None if the edge does not lead there."""
        graph, lanes = self._graph, self._lanes(target)
        parts, apart = list[int](), dict[int, int]()
        for (start, end), c in edge.items():
            if end is not None and end < _ALL:
                c = self._sum(c, -1 - end)
            elif lane is not None:
                if end not in (_ALL, lane):
                    continue
                if end == _ALL and (start == _ALL or graph.nodes[c].lanes):
                    c, start = graph.lane(c, lane), lane if start == _ALL else start
            if start is None or start == _ALL:
                parts.append(c)
            else:
                apart[start] = graph.add(apart[start], c) if start in apart else c
        if apart:
            parts.append(graph.gather(tuple(apart.get(k, graph.const(0.0)) for k in range(lanes))))
        return reduce(graph.add, parts) if parts else None


def _edges(graph: Graph, scalars: _Scalars, n: int) -> Iterator[tuple[int, tuple[int | None, int | None], int]]:
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
