"""Derivatives of functions of the recursive method: transposed functions, and the derivatives of the residual of the equations of motion.

Transposed functions go from how something changes with results to how it changes with arguments.

``by_x`` is an array beside x, the change of an objective with each of its numbers.  Derivatives by values of parameters' time are summed
over a run in ``by_loaded``; ``load_transposed`` goes on from there to the parameters, once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, chain

from cutjoint.formulate.inputs import DISCRETE_STATES, INPUTS
from cutjoint.formulate.layout import Slot
from cutjoint.formulate.records import CLOSE, FORCE_RESIDUAL, SAMPLE, Function, RecursiveEquations
from cutjoint.program.blocks import BindingTime
from cutjoint.program.borders import AlignedParts, align_parts, part
from cutjoint.program.elimination import adjoint, derivatives
from cutjoint.program.records import LoweredFunction, Program, Result
from cutjoint.program.scalars import Graph
from cutjoint.program.schedule import with_functions

#: Of each function its arguments, its results, and the other values on which their derivatives depend.
_ARGUMENTS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "evaluate": (("q", "v", "lambda"), ("vdot", "correction")),
    "constraint_residual": (("q", "v"), ("residual", "rate")),
    "project": (("q", "violation"), ("dz",)),
    "report": (("q", "v", "vdot", "lambda"), ("column",)),
    SAMPLE: (("q", "v", "vdot", "lambda"), ("next_discrete",)),
}

#: Functions that close loops, and the one of accelerations without loops: with these they follow from the residual of forces.
_OF_LOOPS, _OF_CHAINS = frozenset({"constraint_residual", "project"}), frozenset({"evaluate"})

_SUMMED = ("loaded", "input")  #: arrays of values that are summed over a run
_KEPT = ("scene_inputs", CLOSE)  #: functions of the class that are not transposed
#: The places of a value's lanes in ``by_loaded``.
_Places = range


@dataclass(frozen=True, kw_only=True)
class Derived:
    """The equations and the program of derivatives of functions; so many numbers are ``loaded`` by which there are derivatives of them."""

    equations: RecursiveEquations
    program: Program
    loaded: int


def transpose(equations: RecursiveEquations, program: Program) -> Derived:
    """The transposed functions of a program of the equations. Raises ValueError: an operation has no derivative."""
    work = replace(program, graph=program.graph.copy())
    others = _OF_CHAINS if equations.closures else _OF_LOOPS
    functions = [f for f in program.functions if f.name in _ARGUMENTS and f.name not in others]
    loaded = _loaded(work, functions)
    lowered: list[tuple[str, Sequence[Result]]] = [(f.name, f.results) for f in program.functions if f.name.startswith(_KEPT)]
    made: list[Function] = [f for f in equations.functions if f.name.startswith(_KEPT)]
    for function in functions:
        arguments, results = _ARGUMENTS[function.name]
        derivatives = _derivatives(work.graph, equations, function, loaded)
        name, wanted = f"{function.name}_transposed", (*arguments, *_SUMMED)
        lowered.append((name, [r for r in derivatives if _array(equations, r.target) in wanted]))
        pointers = [f"const Real* {a}" for a in (*arguments, *(f"by_{r}" for r in results))]
        made.append(Function(name=name, arguments=(*pointers, *(f"Real* by_{a}" for a in wanted)), results={}))
    lowered.append(("load_transposed", _by_parameters(work.graph, equations, loaded)))
    arrays = ("Real* by_parameters", *(["Real* by_series"] if equations.fits else []))
    made.append(Function(name="load_transposed", arguments=("const Real* by_loaded", *arrays), results={}))
    length = sum(map(len, loaded.values()))
    slots = {f"by_{symbol}": replace(slot, array=f"by_{slot.array}") for symbol, slot in equations.slots.items() if slot.array != "place"}
    slots |= {
        "by_loaded": Slot(array="by_loaded", offset=0, names=("",) * length),
        "by_parameters": Slot(array="by_parameters", offset=0, names=tuple(p.name for p in equations.parameters)),
    }
    return Derived(
        equations=replace(equations, functions=tuple(made), slots={**equations.slots, **slots}),
        program=with_functions(work, lowered), loaded=length,
    )  # fmt: skip


def _loaded(program: Program, functions: Sequence[LoweredFunction]) -> dict[int, _Places]:
    """The values of parameters that functions read, where they change with any, and their places."""
    graph, changing = program.graph, _changing(program.graph)
    read: set[int] = set()
    for n in graph.reachable([r.scalar for f in functions for r in f.results]):
        if graph.nodes[n].binding > BindingTime.PARAM:
            read.update(map(graph.signless, graph.nodes[n].args))
    read.update(graph.signless(r.scalar) for f in functions for r in f.results)
    found: dict[int, _Places] = {}
    first = 0
    for n in sorted(read & changing):
        found[n] = range(first, first := first + max(graph.nodes[n].lanes, 1))
    return found


def _changing(graph: Graph) -> set[int]:
    """The values of parameters' time that change with parameters."""
    changing: set[int] = set()
    for n, node in enumerate(graph.nodes):
        if node.binding is BindingTime.PARAM and (_is_given(_symbol(graph, n)[0]) or not changing.isdisjoint(node.args)):
            changing.add(n)
    return changing


def _is_given(name: str) -> bool:
    """Return whether a symbol is that of parameters or of coefficients that follow from them."""
    return name == "parameters" or name.startswith("series:")


def _symbol(graph: Graph, n: int) -> tuple[str, int]:
    """Name and element of an input of the program; an empty name of anything else."""
    node = graph.nodes[n]
    if node.op != "symbol":
        return "", 0
    assert isinstance(node.data, tuple)
    name, index = node.data
    return str(name), int(index)


def _derivatives(graph: Graph, equations: RecursiveEquations, function: LoweredFunction, loaded: Mapping[int, _Places]) -> list[Result]:
    """The derivatives of a weighed sum of a function's results by its arguments, by inputs and by values of parameters: all elements."""
    weights: dict[int, int] = {}
    for r in function.results:
        weight = graph.symbol(f"by_{r.target}", r.index, BindingTime.ITERATION)
        weights[r.scalar] = graph.add(weights[r.scalar], weight) if r.scalar in weights else weight
    symbols = _arguments(graph, [r.scalar for r in function.results])
    found = adjoint(graph, weights, {*symbols, *loaded})
    by_place = {place: found[n] for n, place in symbols.items() if n in found}
    zero = graph.const(0.0)
    arguments, _ = _ARGUMENTS[function.name]
    results = [
        Result(target=f"by_{symbol}", index=i, scalar=by_place.get((symbol, i), zero))
        for symbol, slot in equations.slots.items() if slot.array in arguments or symbol in (INPUTS, DISCRETE_STATES)
        for i in range(len(slot.names))
    ]  # fmt: skip
    lanes = (Result(target="by_loaded", index=i, scalar=graph.lane(found[n], k) if n in found else zero)
             for n, places in loaded.items() for k, i in enumerate(places))  # fmt: skip
    return [*results, *lanes]


def _arguments(graph: Graph, scalars: Sequence[int]) -> dict[int, tuple[str, int]]:
    """The symbols of iteration time, of inputs and of discrete states that scalars depend on, with name and element."""
    places = {n: _symbol(graph, n) for n in graph.reachable(list(scalars))}
    return {
        n: (name, index) for n, (name, index) in places.items()
        if name and (name in (INPUTS, DISCRETE_STATES) or graph.nodes[n].binding is BindingTime.ITERATION)
    }  # fmt: skip


def _array(equations: RecursiveEquations, target: str) -> str:
    """The array of a derivative, without its mark."""
    symbol = target.removeprefix("by_")
    return equations.slots[symbol].array if symbol in equations.slots else symbol


def _by_parameters(graph: Graph, equations: RecursiveEquations, loaded: Mapping[int, _Places]) -> list[Result]:
    """The derivatives by parameters, and by coefficients of loop embeddings, from those by values that follow from them."""
    symbols = (graph.symbol("by_loaded", i, BindingTime.ITERATION) for places in loaded.values() for i in places)
    weights = {n: graph.gather(tuple(next(symbols) for _ in places)) for n, places in loaded.items()}
    places = {n: place for n in graph.reachable(list(loaded)) if _is_given((place := _symbol(graph, n))[0])}
    found = adjoint(graph, weights, places)
    by_place = {place: found[n] for n, place in places.items() if n in found}
    series = {symbol: len(slot.names) for symbol, slot in equations.slots.items() if slot.array == "series"}
    lengths, zero = {"parameters": len(equations.parameters), **series}, graph.const(0.0)
    return [
        Result(target=f"by_{symbol}", index=i, scalar=by_place.get((symbol, i), zero))
        for symbol, count in lengths.items()
        for i in range(count)
    ]


@dataclass(frozen=True, kw_only=True)
class Linearised(Derived):
    """The derivatives of a force residual, row by row.

    * ``columns``: of each row those of derivatives that are not always zero; ``unknowns``: the first column of accelerations and
      multipliers
    * ``places``: where these derivatives are written; ``sides``: how unknowns separate (`program.borders`), groups first
    """

    columns: Sequence[Sequence[int]]
    unknowns: int
    places: Sequence[int]
    sides: AlignedParts

    @property
    def length(self) -> int:
        """The number of derivatives."""
        return sum(map(len, self.columns))


def linearise_residual(equations: RecursiveEquations, program: Program) -> Linearised:
    """The derivatives of the residual of the equations of motion (`implicit.equations.formulate_residual`), by its program.

    ``residual_jacobian`` has those of the n force residuals, then of the m second rates of loops, row by row. Columns are those of q, v,
    inputs and discrete states, ``loaded``, vdot and lambda; entries that are always zero are left out. ``loaded_values`` has the values of
    parameters' time in ``loaded``; ``residual_by_time`` has the derivatives by explicit time.
    Raises ValueError: an operation has no derivative.
    """
    work = replace(program, graph=program.graph.copy())
    graph, function = work.graph, program.function(FORCE_RESIDUAL)
    loaded, symbols = _loaded(work, [function]), _arguments(graph, [r.scalar for r in function.results])
    forces, loops, length = len(equations.speed_names), len(equations.equation_names), sum(map(len, loaded.values()))
    widths = {
        "q": equations.coordinates, "v": forces, "input": 3 * len(equations.inputs) + equations.discrete_states, "loaded": length,
        "vdot": forces, "lambda": loops,
    }  # fmt: skip
    firsts = dict(zip(widths, accumulate(widths.values(), initial=0), strict=False))
    columns = {n: [firsts[slot.array] + slot.offset + index] for n, (name, index) in symbols.items() if (slot := equations.slots.get(name))}
    columns |= {n: [firsts["loaded"] + place for place in places] for n, places in loaded.items()}
    rows: list[dict[int, int]] = [{} for _ in range(forces + loops)]
    scalars, by_time = [r.scalar for r in function.results], list[Result]()
    times = [n for n in graph.reachable(scalars) if _symbol(graph, n)[0] == "t"]
    for result, by, later in zip(function.results, *(derivatives(graph, scalars, x) for x in (columns, times)), strict=True):
        slot = equations.slots[result.target]
        place = slot.offset + result.index + (forces if slot.array == "curvature" else 0)
        by_time += [Result(target="by_time", index=place, scalar=derivative) for derivative in later.values()]
        for n, derivative in by.items():
            rows[place] |= {column: graph.lane(derivative, k) for k, column in enumerate(columns[n])}
    entries = [[column for column in sorted(row) if graph.value(row[column]) != 0.0] for row in rows]
    places = [(row, column) for row, of_row in enumerate(entries) for column in of_row]
    sides = _aligned_parts(equations, firsts, entries)
    groups = [group for of_parts in sides.groups for group in of_parts]
    order = {place: i for i, place in enumerate(dict.fromkeys([*chain.from_iterable(groups), *places]))}
    combined = {order[group[0]]: _combined(graph, [rows[row][column] for row, column in group]) for group in groups}
    results = [Result(target="entry", index=i, scalar=n) for i, n in combined.items() if n is not None]
    written = {r.index + k for r in results for k in range(graph.nodes[r.scalar].lanes)}
    results += [Result(target="entry", index=i, scalar=rows[row][column]) for (row, column), i in order.items() if i not in written]
    values = [Result(target="loaded", index=i, scalar=graph.lane(n, k)) for n, spread in loaded.items() for k, i in enumerate(spread)]
    kept = [f for f in equations.functions if f.name.startswith(_KEPT)]
    at = equations.function(FORCE_RESIDUAL).arguments[:4]
    added = {"residual_jacobian": (results, (*at, "Real* entry")), "loaded_values": (values, ("Real* loaded",))}
    added |= {"residual_by_time": (by_time, (*at, "Real* by_time"))} if by_time else {}
    made = (*kept, *(Function(name=name, arguments=arguments, results={}) for name, (_, arguments) in added.items()))
    lowered = [*((f.name, program.function(f.name).results) for f in kept), *((name, found) for name, (found, _) in added.items())]
    sizes = {"entry": len(places), "loaded": length, "by_time": forces + loops}
    slots = {name: Slot(array=name, offset=0, names=("",) * size) for name, size in sizes.items()}
    return Linearised(
        equations=replace(equations, functions=made, slots={**equations.slots, **slots}), loaded=length, columns=entries,
        program=with_functions(work, lowered),
        unknowns=firsts["vdot"], places=[order[place] for place in places], sides=sides,
    )  # fmt: skip


def _combined(graph: Graph, scalars: Sequence[int]) -> int | None:
    """The scalar whose lanes these are; None where there is none."""
    nodes = [graph.nodes[n] for n in scalars]
    if len(set(scalars)) == 1:
        return None
    if all((node.op, node.args, node.data) == ("lane", nodes[0].args, k) for k, node in enumerate(nodes)):
        return nodes[0].args[0] if graph.nodes[nodes[0].args[0]].lanes == len(scalars) else None
    if nodes[0].op not in ("add", "sub", "mul", "neg") or any(node.op != nodes[0].op for node in nodes):
        return None
    sides = [[node.args[i] for node in nodes] for i in range(len(nodes[0].args))]
    found = [side[0] if len(set(side)) == 1 else _combined(graph, side) for side in sides]
    arguments = [n for n in found if n is not None]
    operation = getattr(graph, nodes[0].op)
    return int(operation(*arguments)) if len(arguments) == len(sides) else None


def _aligned_parts(equations: RecursiveEquations, firsts: Mapping[str, int], entries: Sequence[Sequence[int]]) -> AlignedParts:
    """The parts of accelerations and multipliers, those of a joint together."""
    of_column = {firsts["vdot"] + i: i for i in range(len(entries))}
    of_column |= {firsts["v"] + i: i for i in range(len(equations.speed_names))}
    joints = [range(chart.v, chart.v + len(chart.speed_names)) for chart in equations.charts]
    for chart in equations.charts:
        for i in range(len(chart.coordinate_names)):
            of_column[firsts["q"] + chart.q + i] = chart.v + min(i, len(chart.speed_names) - 1)
    places = [(row, column) for row, of_row in enumerate(entries) for column in of_row]
    together = [*joints, *([i] for i in range(sum(map(len, joints)), len(entries)))]
    parts = part(len(entries), [(row, of_column[column]) for row, column in places if column in of_column], together)
    return align_parts(parts, places, of_column)
