"""Repeated statements -> loops: the code of a long chain is emitted once instead of for each link.

A function's statements come section by section (a body, a joint, a force). Where sections of the same shape follow each other again and
again, one of them, or a period of several, is the body of a loop. A value from outside is the same in all iterations, or at regular places:
of an input, or of this or another loop's values at a constant offset, in either direction. Other values known before the loop are read from
a table. Values that are read outside their own iteration are stored in arrays; the first iteration's argument in place of a predecessor's
value is copied to the same array, in front. The order of evaluation stays, and with it every rounding.

If no iteration reads results of another, several are computed side by side, if the program may have lanes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, groupby
from typing import NamedTuple, TypeAlias

from cutjoint.ops import CONDITIONS
from cutjoint.program.blocks import BindingTime, Section
from cutjoint.program.records import LoweredFunction, Program, Result
from cutjoint.program.scalars import Graph, Scalar

LEAST, PERIOD = 6, 8  #: a loop has at least so many iterations, and its body at most so many sections
WORTH = 20  #: a loop stands for at least so many statements or results
LANES = 4  #: iterations side by side

#: Statements that an iteration of a loop must have for each table of values that the loop reads; with fewer, it stays unrolled.
COSTLY = 4

_BEYOND = 2  #: elements that an array may have before and after those of its loop
TO = " .. "  #: stands between the first and the last element of a loop's section

#: Array and element of an input or a result, by symbol name and index.
Place: TypeAlias = Callable[[str, int], tuple[str, int]]
#: An argument without its sign in all iterations.
_Column: TypeAlias = tuple[int, ...]


class Step(NamedTuple):
    """Places ``first + stride*k`` of iterations k = 0, 1, ..."""

    first: int
    stride: int

    def at(self, k: int) -> int:
        """The place of iteration k."""
        return self.first + self.stride * k


@dataclass(frozen=True)
class Input:
    """Elements of an input, by the name of its array."""

    array: str
    step: Step


@dataclass(frozen=True)
class Stored:
    """Elements of the array of a value: that of statement ``statement`` in the body of loop ``loop``."""

    loop: int
    statement: int
    step: Step


@dataclass(frozen=True)
class Table:
    """Nodes one by one: numbers, or values that are known before the loop."""

    nodes: tuple[int, ...]


#: The placeholder for a value from outside in the body of a loop.
Argument: TypeAlias = Input | Stored | Table


@dataclass(frozen=True, kw_only=True)
class Store:
    """A result: ``array[step] = node``."""

    array: str
    step: Step
    node: int


@dataclass(frozen=True)
class Copy:
    """A node at a place of a statement's array outside the loop: before the first iteration or after the last. -1 is next to the first."""

    loop: int
    statement: int
    place: int
    node: int


@dataclass(frozen=True, kw_only=True)
class Loop:
    """``body`` are nodes that represent those of each iteration; ``arguments`` are their arguments from outside that change.

    ``iterations`` are the nodes of the function that each iteration computes (none where it only has ``stores``, results).  ``arrays`` are
    the statements whose values arrays keep, with the first and the last place of each; ``copies`` are the nodes that must be in other
    places than those of iterations before the loop begins.  With ``lanes``, so many iterations are computed side by side.
    """

    count: int
    lanes: int
    body: tuple[int, ...]
    arguments: Mapping[int, Argument]
    iterations: tuple[tuple[int, ...], ...]
    arrays: Mapping[int, tuple[int, int]]
    copies: tuple[Copy, ...]
    stores: tuple[Store, ...]


@dataclass(frozen=True, kw_only=True)
class Rolled:
    """A function with loops: its parts in order, statements or the number of a loop; results that no loop stores.
    ``graph`` and ``sections`` are the program's with those of the bodies behind its own."""

    graph: Graph
    sections: tuple[Section, ...]
    parts: tuple[tuple[int, ...] | int, ...]
    loops: tuple[Loop, ...]
    results: tuple[Result, ...]


@dataclass(eq=False)
class _Run:
    """Statements, or results, that repeat: by iteration, and the iterations that have been ``placed``.  ``copies`` are those that its
    arguments need, ``of`` the lengths of the runs that these follow from: while all are as they were, so are the arguments."""

    iterations: list[list[int]]
    placed: list[list[int]] = field(default_factory=list)
    arguments: dict[_Column, Argument] = field(default_factory=dict)
    copies: dict[tuple[int, int, int], tuple[int, int]] = field(default_factory=dict)
    of: dict[int, int] = field(default_factory=dict)


def roll(program: Program, function: LoweredFunction, place: Place) -> Rolled:
    """Find repetitions in a function; ``place`` gives the places of inputs and results."""
    return _Rolling(program, function, place).rolled()


class _Rolling:
    """The search in one function.  A result has the number -1 - its index among the results."""

    def __init__(self, program: Program, function: LoweredFunction, place: Place) -> None:
        self._program = program
        self._graph = program.graph
        self._nodes = program.graph.nodes
        self._results = function.results
        self._place = place
        statements = [n for n in function.statements if self._nodes[n].op not in ("symbol", "neg")]
        self._own = frozenset(statements)
        self._classes: dict[int, tuple[int, int]] = {}
        self._keys: dict[object, int] = {}
        groups = [list(g) for _, g in groupby(statements, key=self._part)]
        stores = self._by_array()
        keys = [self._key_of(g) for g in groups] + [self._key_of_result(self._results[i]) for i in stores]
        groups += [[-1 - i] for i in stores]
        self._order = [n for g in groups for n in g]
        runs = (
            _Run([list(chain(*groups[i : i + period])) for i in range(first, first + period * count, period)])
            for first, period, count in _repeats(keys)
        )  # fmt: skip
        self._runs = [run for run in runs if _is_worth(run)]
        self._where: dict[int, tuple[int, int, int]] = {}
        self._copies: dict[tuple[int, int, int], tuple[int, int]] = {}
        self._known: dict[int, list[int]] = {}

    # Likeness

    def _arguments(self, n: int) -> list[int]:
        if n not in self._known:
            self._known[n] = [self._graph.signless(a) for a in self._signed(n)]
        return self._known[n]

    def _signed(self, n: int) -> tuple[int, ...]:
        if n < 0:
            return (self._results[-1 - n].scalar,)
        node = self._nodes[n]
        return tuple(sorted(node.args, key=lambda a: repr(self._kind(a)))) if node.op in ("add", "mul") else node.args

    def _kind(self, a: int) -> tuple[object, ...]:
        """The properties that corresponding arguments of iterations must share."""
        bare = self._graph.signless(a)
        node, negated = self._nodes[bare], bare != a
        if node.op in ("const", "lane_const"):
            return "number", node.lanes, negated
        if self._is_input(bare):
            return "input", self._place_of(bare)[0], negated
        return "value" if bare in self._own else "early", node.lanes, negated

    def _is_input(self, a: int) -> bool:
        return self._nodes[a].op == "symbol" and self._nodes[a].binding is BindingTime.ITERATION

    def _place_of(self, a: int) -> tuple[str, int]:
        data = self._nodes[a].data
        assert isinstance(data, tuple)
        return self._place(*data)

    def _key_of(self, group: Sequence[int]) -> int:
        """The number of a section's shape: sections with statements of the same shape share it."""
        nodes = [self._nodes[n] for n in group]
        kinds = [tuple(self._kind(a) for a in self._signed(n)) for n in group]
        shape = tuple((node.op, node.lanes, node.data, kind) for node, kind in zip(nodes, kinds, strict=True))
        key = self._keys.setdefault((self._program.sections[nodes[0].section].stage, shape), len(self._keys))
        self._classes |= {n: (key, j) for j, n in enumerate(group)}
        return key

    def _part(self, n: int) -> tuple[int, int]:
        """The number of the part to which a statement belongs: an element's statements stay together, all others are parts of their own."""
        section = self._nodes[n].section
        return section, -1 if self._program.sections[section].element else n

    def _by_array(self) -> list[int]:
        """The results without lanes in the order of the arrays that they go to."""
        arrays = [self._place(r.target, r.index)[0] for r in self._results]
        first = {array: i for i, array in reversed(list(enumerate(arrays)))}
        plain = (i for i, r in enumerate(self._results) if not self._nodes[r.scalar].lanes)
        return sorted(plain, key=lambda i: first[arrays[i]])

    def _key_of_result(self, result: Result) -> int:
        bare = self._graph.signless(result.scalar)
        shape = (self._place(result.target, result.index)[0], self._kind(result.scalar), self._classes.get(bare))
        return self._keys.setdefault(shape, len(self._keys))

    # Values in step

    def rolled(self) -> Rolled:
        """The function with loops."""
        while not self._settled():
            kept = [run for run in self._runs if _is_worth(run)]
            if len(kept) < len(self._runs):  # the others have other numbers
                self._where = {}
                for run in kept:
                    run.of, run.placed = {}, []
            self._runs = kept
        return self._written()

    def _settled(self) -> bool:
        """Fit the arguments of the runs; False if one had to be shortened, so that all must be fitted again."""
        for i, run in enumerate(self._runs):
            if run.placed is not run.iterations:
                for n in chain(*run.placed):
                    self._where.pop(n, None)
                self._where |= {n: (i, j, k) for k, nodes in enumerate(run.iterations) for j, n in enumerate(nodes)}
                run.placed = run.iterations
        self._copies, lengths = {}, [len(run.iterations) for run in self._runs]
        fitted = [self._is_known(run) or self._fits(i, run, lengths) for i, run in enumerate(self._runs)]
        return all(fitted)

    def _is_known(self, run: _Run) -> bool:
        """Whether the arguments of a run that was fitted before are still valid; its copies are then noted."""
        if not run.of or any(len(self._runs[j].iterations) != length for j, length in run.of.items()):
            return False
        if any(self._copies.get(place, copy)[1] != copy[1] for place, copy in run.copies.items()):
            return False
        self._copies = run.copies | self._copies
        return True

    def _fits(self, i: int, run: _Run, lengths: Sequence[int]) -> bool:
        """Fit the arguments of one run.  Drop the iterations up to one that does not fit, or from it on, whichever are fewer."""
        run.arguments, run.copies, run.of = {}, {}, {}
        columns = dict.fromkeys(c for row in zip(*run.iterations, strict=True) for c in self._columns(row))
        for column in columns:
            if len(set(column)) == 1 or self._is_inside(i, column):
                continue
            argument = self._fit(i, column)
            if isinstance(argument, int):
                run.iterations = run.iterations[argument + 1 :] if 2 * argument < len(column) else run.iterations[:argument]
                return False
            run.arguments[column] = argument
        listed = [c for c, argument in run.arguments.items() if isinstance(argument, Table) and self._kind(c[0])[0] != "number"]
        in_step = all(_step([p for _, p in self._stored(row)]) for row in zip(*run.iterations, strict=True) if row[0] < 0)
        if not in_step or len(listed) * COSTLY > len(run.iterations[0]):
            run.iterations = []
            return False
        run.of = {j: lengths[j] for j in {i, *(self._where[a][0] for column in columns for a in column if a in self._where)}}
        return True

    def _columns(self, row: Sequence[int]) -> list[_Column]:
        return list(zip(*(self._arguments(n) for n in row), strict=True))

    def _stored(self, row: Sequence[int]) -> list[tuple[str, int]]:
        """The places of a result of the body."""
        return [self._place(r.target, r.index) for r in (self._results[-1 - n] for n in row)]

    def _is_inside(self, i: int, column: _Column) -> bool:
        """Return whether an argument is a value of the same iteration."""
        first = self._where.get(column[0])
        return first is not None and all(self._where.get(a) == (i, first[1], k) for k, a in enumerate(column))

    def _fit(self, i: int, column: _Column) -> Argument | int:
        """The places of a column's values, or an iteration that does not fit."""
        if self._is_input(column[0]):
            return self._fit_input([self._place_of(a) for a in column], column)
        if column[0] not in self._own:
            return Table(column)
        middle = len(column) // 2
        one, other = self._where.get(column[middle - 1]), self._where.get(column[middle])
        if one is None or other is None or one[:2] != other[:2]:
            inside = [k for k, a in enumerate(column) if self._where.get(a, (None,))[0] == i]
            return inside[0] if inside else Table(column)
        stride = other[2] - one[2]
        return self._fit_array(i, Stored(*one[:2], Step(other[2] - stride * middle, stride)), column)

    def _fit_input(self, places: Sequence[tuple[str, int]], column: _Column) -> Argument | int:
        """The elements of an input; if only the first or the last are irregular, these do not fit."""
        indices = [index for _, index in places]
        middle = len(indices) // 2
        stride = indices[middle] - indices[middle - 1]
        step = Step(indices[middle] - stride * middle, stride)
        wrong = [k for k, index in enumerate(indices) if index != step.at(k)]
        if not wrong:
            return Input(places[0][0], step)
        return Table(column) if len(wrong) > _BEYOND else wrong[-1] if wrong[-1] < middle else wrong[0]

    def _fit_array(self, i: int, stored: Stored, column: _Column) -> Argument | int:
        """The array of a value, or the first iteration with something else that cannot be copied to the array's ends."""
        copies = {}
        count = len(self._runs[stored.loop].iterations)
        for k, a in enumerate(column):
            place = (stored.loop, stored.statement, stored.step.at(k))
            if self._where.get(a) != place:
                near = -_BEYOND <= place[2] < 0 or count <= place[2] < count + _BEYOND
                is_known = a not in self._where or self._where[a][0] != i
                if not near or not is_known or self._copies.get(place, (i, a))[1] != a:
                    return k
                copies[place] = (i, a)
        self._runs[i].copies |= copies
        self._copies = copies | self._copies
        return stored

    # The result

    def _written(self) -> Rolled:
        graph, sections = Graph(nodes=list(self._nodes)), list(self._program.sections)
        wanted = self._wanted()
        loops = tuple(self._loop(i, run, wanted, graph, sections) for i, run in enumerate(self._runs))
        parts: list[tuple[int, ...] | int] = []
        for i, group in groupby(self._order, key=lambda n: self._where[n][0] if n in self._where else None):
            nodes = tuple(n for n in group if n >= 0)
            if i is not None or nodes:
                parts.append(nodes if i is None else i)
        results = tuple(r for j, r in enumerate(self._results) if -1 - j not in self._where)
        return Rolled(graph=graph, sections=tuple(sections), parts=tuple(parts), loops=loops, results=results)

    def _wanted(self) -> frozenset[tuple[int, int]]:
        """Statements of loops whose values are read outside their own iteration."""
        arguments = [g for run in self._runs for g in run.arguments.values()]
        stored = {(g.loop, g.statement) for g in arguments if isinstance(g, Stored)}
        read = {a for g in arguments if isinstance(g, Table) for a in g.nodes} | {a for _, a in self._copies.values()}
        read |= {a for n in self._order if n not in self._where for a in self._arguments(n)}
        read |= {c[0] for run in self._runs for row in zip(*run.iterations, strict=True) for c in self._columns(row) if len(set(c)) == 1}
        return frozenset(stored | {self._where[a][:2] for a in read if a in self._where})

    def _loop(self, i: int, run: _Run, wanted: frozenset[tuple[int, int]], graph: Graph, sections: list[Section]) -> Loop:
        body: dict[int, int] = {}
        arguments: dict[_Column, int] = {}
        stores: list[Store] = []
        titles: dict[int, int] = {}
        lanes = self._lanes(i, run, wanted)
        for j, row in enumerate(zip(*run.iterations, strict=True)):
            args = tuple(
                _append(graph, replace(graph.nodes[n], op="neg", args=(n,), data=None)) if self._nodes[signed].op == "neg" else n
                for signed, column in zip(self._signed(row[0]), self._columns(row), strict=True)
                for n in [self._argument(column, run, body, arguments, graph, lanes)]
            )  # fmt: skip
            if row[0] < 0:
                (array, first), (_, second), *_ = self._stored(row)
                stores.append(Store(array=array, step=Step(first, second - first), node=args[0]))
                continue
            like = self._nodes[row[0]]
            if like.section not in titles:
                titles[like.section] = len(sections)
                sections.append(self._joint_section([self._program.sections[self._nodes[n].section] for n in row]))
            body[j] = _append(graph, replace(like, args=args, section=titles[like.section], lanes=lanes or like.lanes))
        count = len(run.iterations)
        arrays = {j: [0, count - 1, *(k for loop, s, k in self._copies if (loop, s) == (i, j))] for loop, j in sorted(wanted) if loop == i}
        return Loop(
            count=count, lanes=lanes, body=tuple(body.values()), arguments={n: run.arguments[column] for column, n in arguments.items()},
            iterations=tuple(tuple(nodes) for nodes in run.iterations) if body else (),
            arrays={j: (min(places), max(places)) for j, places in arrays.items()},
            copies=tuple(Copy(*place, a) for place, (reader, a) in self._copies.items() if reader == i), stores=tuple(stores),
        )  # fmt: skip

    def _lanes(self, i: int, run: _Run, wanted: frozenset[tuple[int, int]]) -> int:
        """The number of iterations of a run that are computed side by side.
        It is 0 if they read each other's values, have lanes of their own, or store conditions or read stored ones."""
        alone = not any(isinstance(g, Stored) and g.loop == i for g in run.arguments.values())
        nodes = [self._nodes[n] for n in run.iterations[0] if n >= 0]
        plain = not any(x.lanes or x.op in ("lane", "lane_sum") or x.op.startswith("road_") for x in nodes)
        shared = [run.iterations[0][j] for loop, j in wanted if loop == i] + [column[0] for column in run.arguments]
        real = not any(self._nodes[n].op in CONDITIONS for n in shared)
        return LANES if self._program.lanes and nodes and alone and plain and real else 0

    def _argument(
        self, column: _Column, run: _Run, body: Mapping[int, int], arguments: dict[_Column, int], graph: Graph, lanes: int
    ) -> int:  # fmt: skip
        """The argument of a body's node."""
        if column in run.arguments:
            if column not in arguments:
                like = self._nodes[column[0]]
                arguments[column] = _append(graph, replace(like, args=(), binding=BindingTime.ITERATION, lanes=lanes or like.lanes))
            return arguments[column]
        return column[0] if len(set(column)) == 1 else body[self._where[column[0]][1]]

    def _joint_section(self, sections: Sequence[Section]) -> Section:
        """The section of a loop's body: that of its iterations, named by the elements of the first and the last."""
        first, last = sections[0], sections[-1]
        return replace(first, element=f"{first.element}{TO}{last.element}") if first.element else first


def _is_worth(run: _Run) -> bool:
    """Return whether a run has enough iterations and statements for a loop."""
    count = len(run.iterations)
    return count >= LEAST and count * len(run.iterations[0]) >= WORTH


def _append(graph: Graph, node: Scalar) -> int:
    graph.nodes.append(node)
    return len(graph.nodes) - 1


def _step(places: Sequence[int]) -> Step | None:
    """The step of places at regular distances."""
    step = Step(places[0], places[1] - places[0])
    return step if all(step.at(k) == p for k, p in enumerate(places)) else None


def _repeats(keys: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """First group, period and number of iterations of each run of at least LEAST."""
    first = 0
    while first < len(keys):
        covered, best = 0, (1, 1)
        for period in range(1, PERIOD + 1):
            last = first + period
            while last < len(keys) and keys[last] == keys[last - period]:
                last += 1
            count = (last - first) // period
            if count >= LEAST and count * period > covered:
                covered, best = count * period, (period, count)
        if covered:
            yield first, *best
        first += covered or 1
