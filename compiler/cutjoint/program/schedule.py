"""Blocks of named functions -> Program: lower, remove unused nodes, split by binding time."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

from cutjoint.program.blocks import BindingTime, Block, Builder, ConstantError
from cutjoint.program.lower import Lowering
from cutjoint.program.records import LoweredFunction, Program, Result
from cutjoint.program.scalars import Graph, OverflowedConstantError


def schedule(
    builder: Builder, functions: Sequence[tuple[str, Mapping[str, Block]]], *, lanes: bool = False, last: Collection[str] = ()
) -> Program:
    """Lower the functions onto one graph; with ``lanes``, their loops may have some, too.
    Results in ``last`` come after the others, whose code does not change for them. Work that depends on parameters or on time alone
    leaves the functions for the two earlier stages. Raises ConstantError: a constant that is computed in advance overflows."""
    lowering = Lowering()
    rest, checks = ([f for f in functions if (f[0] in last) == is_last] for is_last in (False, True))
    try:
        lowering.lower(block for _, results in rest for block in results.values())
        first = set(lowering.elements)
        lowering.lower(block for _, results in checks for block in results.values())
    except OverflowedConstantError as error:
        raise ConstantError(builder.sections, error.section) from None
    labels = dict(sorted(builder.labels.items(), key=lambda item: (item[0] not in first, item[0].number)))
    program = Program(
        graph=lowering.graph, sections=tuple(builder.sections), elements=lowering.elements, labels=labels, functions=(), loaded=(),
        stepped=(), stored=frozenset(), lanes=lanes,
    )  # fmt: skip
    by_name = [
        (name, [
            Result(target=target, index=i, scalar=row[0])
            for target, block in results.items() for i, row in enumerate(lowering.elements[block])
        ])
        for name, results in functions
    ]  # fmt: skip
    return with_functions(program, by_name)


def with_functions(program: Program, functions: Iterable[tuple[str, Sequence[Result]]]) -> Program:
    """A program with these functions on its graph, in place of its own."""
    graph = program.graph
    lowered = tuple(_function(graph, name, results) for name, results in functions)
    reached = graph.reachable([r.scalar for f in lowered for r in f.results])
    early = [n for n in reached if graph.nodes[n].binding in (BindingTime.PARAM, BindingTime.STEP)]
    stepped = tuple(n for n in early if graph.nodes[n].binding is BindingTime.STEP)
    loaded = tuple(n for n in early if graph.nodes[n].binding is BindingTime.PARAM)
    return replace(program, functions=lowered, loaded=loaded, stepped=stepped, stored=_stored(graph, lowered, loaded, stepped))


def _function(graph: Graph, name: str, results: Sequence[Result]) -> LoweredFunction:
    reached = graph.reachable([r.scalar for r in results])
    late = tuple(n for n in reached if graph.nodes[n].binding is BindingTime.ITERATION)
    return LoweredFunction(name=name, results=tuple(results), statements=late)


def _stored(graph: Graph, functions: Sequence[LoweredFunction], loaded: Sequence[int], stepped: Sequence[int]) -> frozenset[int]:
    """Early nodes that a later stage reads."""
    stored: set[int] = set()
    late = [n for f in functions for n in f.statements]
    for n in (*stepped, *late):
        when = graph.nodes[n].binding
        stored.update(a for a in graph.nodes[n].args if BindingTime.CONST < graph.nodes[a].binding < when)
    results = [r.scalar for f in functions for r in f.results]
    stored.update(n for n in results if BindingTime.CONST < graph.nodes[n].binding < BindingTime.ITERATION)
    return frozenset(graph.signless(n) for n in stored) & (set(loaded) | set(stepped))
