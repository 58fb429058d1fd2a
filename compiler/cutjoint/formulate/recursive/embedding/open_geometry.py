"""Embedded loops with tunable geometry: their functions are fitted when parameters are loaded.

`core/mechanism/loop_fits.hpp` closes such loops at nodes and fits the series to the poses.  For that the program has a function for each
embedded loop: residual and Jacobian of its cut joints by the place of the block, the coordinates for which `dependent.py` has series::

    place = (q, s)        J = (Phi_q, Phi_s)        s' = -Phi_s^-1 Phi_q

The coefficients are the symbol ``series:independent``, known when parameters are; its last element is a margin, negative where the loops do
not close over the range.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

from cutjoint.formulate.inputs import TIME, make_charts, make_numbers, make_translator, tunable_parameters
from cutjoint.formulate.layout import Chart, Slot
from cutjoint.formulate.records import CLOSE, Function, LoopFit
from cutjoint.formulate.recursive.embedding.dependent import angular_velocity_of, coefficients_of, quaternion_of
from cutjoint.formulate.recursive.kinematics import derive_kinematics
from cutjoint.formulate.recursive.loops import derive_loops
from cutjoint.methods import PLAIN_CLOSURE
from cutjoint.model.records import GROUND, EmbeddedLoop, Joint, LoopFunctions, Model, Series
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.lower import reachable_blocks
from cutjoint.topology.records import Topology


@dataclass(frozen=True, kw_only=True)
class BlockEquations:
    """The residuals of joints that close loops and their rates, with the charts of the tree that leads to them."""

    charts: tuple[Chart, ...]
    residuals: tuple[Block, ...]
    rates: tuple[Block, ...]


def derive_block(b: Builder, topology: Topology, joints: Sequence[Joint], cuts: tuple[Joint, ...]) -> BlockEquations:
    """The equations of ``cuts`` among the ``joints`` of a block, in a topology without embedded loops."""
    model, charts = topology.model, make_charts(topology)
    above = {t.child: t for t in topology.tree}
    needed = {GROUND}
    for body in {end for joint in joints for end in (joint.base, joint.follower)}:
        while body not in needed:
            needed.add(body)
            body = above[body].parent
    part = replace(topology, tree=tuple(t for t in topology.tree if t.child in needed))
    k = derive_kinematics(b, make_translator(b, model), part, {c.joint: c for c in charts})
    loops = derive_loops(k, cuts, make_numbers(b, cuts, PLAIN_CLOSURE))
    return BlockEquations(charts=charts, residuals=tuple(loop.residual for loop in loops), rates=tuple(loop.rate for loop in loops))


def driven_by_time(topology: Topology, drive: str | None) -> Topology:
    """The topology whose drive is at the time, so that numbers for the time move it."""
    tree = (replace(t, joint=replace(t.joint, guide=(TIME,))) if t.joint.name == drive else t for t in topology.tree)
    return topology if drive is None else replace(topology, tree=tuple(tree))


def without_embedded_loops(topology: Topology) -> Topology:
    """The spanning tree, with the cut joints of embedded loops among its cut joints."""
    return replace(topology, model=replace(topology.model, embedded_loops=()), cuts=(*topology.cuts, *topology.embedded), embedded=())


def joints_of(model: Model, embedded_loop: EmbeddedLoop) -> tuple[Joint, ...]:
    """The joints of an embedded loop's block, in the order of the model."""
    names = {embedded_loop.independent, *embedded_loop.functions.series, *embedded_loop.cuts}
    return tuple(joint for joint in model.joints if joint.name in names)


def loop_fits(b: Builder, topology: Topology) -> tuple[LoopFit, ...]:
    """The fits of all embedded loops with tunable geometry."""
    fits: list[LoopFit] = []
    first = 0
    for embedded_loop in topology.model.embedded_loops:
        if embedded_loop.functions.open:
            fits.append(_fit(b, topology, embedded_loop, first, len(fits)))
            first += coefficients_of(embedded_loop.functions) + 1
    return tuple(fits)


def fit_slots(fits: Sequence[LoopFit]) -> dict[str, Slot]:
    """The places of their inputs and results."""
    return {symbol: slot for fit in fits for symbol, slot in fit.slots.items()}


def _closing(topology: Topology, embedded_loop: EmbeddedLoop) -> BlockEquations:
    """The equations of an embedded loop, driven by the time."""
    whole = driven_by_time(without_embedded_loops(topology), embedded_loop.drive)
    cuts = tuple(joint for joint in topology.embedded if joint.name in embedded_loop.cuts)
    return derive_block(Builder(), whole, joints_of(topology.model, embedded_loop), cuts)


def _drive(b: Builder, functions: LoopFunctions) -> Block:
    return b.number(functions.drive_range.middle if functions.drive_range is not None else 0.0)


def loop_residual(b: Builder, topology: Topology, embedded_loop: EmbeddedLoop) -> Block:
    """The residual of an embedded loop by the symbol ``place``, (q, s), with parameters at their default values."""
    functions, equations = embedded_loop.functions, _closing(topology, embedded_loop)
    place = b.symbol("place", 1 + sum(map(len, functions.series.values())), BindingTime.ITERATION)
    known = _places(b, equations.charts, embedded_loop, place) | {"t": _drive(b, functions)}
    if parameters := tunable_parameters(topology.model):
        known["parameters"] = b.column([b.number(p.value) for p in parameters])
    return _substituted(b, equations.residuals, known)


def _fit(b: Builder, topology: Topology, embedded_loop: EmbeddedLoop, first: int, number: int) -> LoopFit:
    equations, functions, independent = _closing(topology, embedded_loop), embedded_loop.functions, embedded_loop.independent
    count = 1 + sum(map(len, functions.series.values()))
    place = b.symbol(f"place:{independent}", count, BindingTime.ITERATION)
    equation = "residual and Jacobian of the joints that functions close, by the place"
    with b.section("functions", independent, equation, embedded_loop.span.place):
        known = _places(b, equations.charts, embedded_loop, place)
        parameters = tunable_parameters(topology.model)
        known["parameters"] = b.symbol(f"fitted:{independent}", len(parameters), BindingTime.ITERATION)
        known["t"] = _drive(b, functions)
        residual = _substituted(b, equations.residuals, known)
        columns = [_substituted(b, equations.rates, known | moved) for moved in _moved(b, equations.charts, embedded_loop, place)]
    rows = residual.shape[0]
    slots = {
        f"fitted:{independent}": Slot(array="parameters", offset=0, names=tuple(p.name for p in parameters)),
        f"place:{independent}": Slot(array="place", offset=0, names=("q", *_named(functions.series))),
        f"opening:{independent}": Slot(array="opening", offset=0, names=("",) * rows),
        f"by_place:{independent}": Slot(array="by_place", offset=0, names=("",) * (rows * count)),
        f"series:{independent}": Slot(array="series", offset=first, names=tuple(map(str, range(coefficients_of(functions) + 1)))),
    }
    function = Function(
        name=f"{CLOSE}{number}", arguments=("const Real* parameters", "const Real* place", "Real* opening", "Real* by_place"),
        results={f"opening:{independent}": residual, f"by_place:{independent}": b.stack([[column] for column in columns])},
    )  # fmt: skip
    return LoopFit(embedded_loop=embedded_loop, function=function, slots=slots, rows=rows, first=first)


def _named(series: Mapping[str, Sequence[Series]]) -> tuple[str, ...]:
    return tuple(f"{joint}_{i}" if len(found) > 1 else joint for joint, found in series.items() for i in range(len(found)))


def _places(b: Builder, charts: Sequence[Chart], embedded_loop: EmbeddedLoop, place: Block) -> dict[str, Block]:
    """The coordinates of all joints of a tree by the place; those outside of the block are in the design position."""
    known, first = {}, 1
    for chart in charts:
        series = embedded_loop.functions.series.get(chart.joint)
        if chart.joint == embedded_loop.independent:
            known[f"q:{chart.joint}"] = b.element(place, 0)
        elif series is None:
            ball = [b.number(float(i == 0)) for i in range(4)] if chart.ball else []
            known[f"q:{chart.joint}"] = b.column([*[b.number(0.0)] * chart.scalars, *ball])
    for joint, series in embedded_loop.functions.series.items():
        chart = next(chart for chart in charts if chart.joint == joint)
        scalars = [b.element(place, first + i) for i in range(chart.scalars)]
        turned = quaternion_of(b, b.take(place, (first + chart.scalars, first + len(series)))) if chart.ball else ()
        known[f"q:{joint}"] = b.column([*scalars, *turned])
        first += len(series)
    return known


def _moved(b: Builder, charts: Sequence[Chart], embedded_loop: EmbeddedLoop, place: Block) -> Iterator[dict[str, Block]]:
    """The speeds of all joints of a tree at a unit rate of each element of the place in turn."""
    still = {f"v:{c.joint}": b.zero(len(c.speed_names)) for c in charts}
    yield still | {f"v:{embedded_loop.independent}": b.number(1.0)}
    first = 1
    for joint, series in embedded_loop.functions.series.items():
        chart = next(chart for chart in charts if chart.joint == joint)
        for i in range(len(series)):
            unit = b.identity(len(series))
            column = b.take(unit, (0, len(series)), (i, i + 1))
            if i >= chart.scalars:
                g = b.take(place, (first + chart.scalars, first + len(series)))
                turned = angular_velocity_of(b, g, b.take(column, (chart.scalars, len(series))))
                column = b.stack([[b.zero(chart.scalars)], [turned]]) if chart.scalars else turned
            yield still | {f"v:{joint}": column}
        first += len(series)


def _substituted(b: Builder, blocks: Sequence[Block], known: Mapping[str, Block]) -> Block:
    """Blocks of another builder beneath each other, made again with other inputs; inputs that are not ``known`` are zero."""
    made: dict[Block, Block] = {}
    for block in reachable_blocks(blocks):
        if block.op == "symbol":
            made[block] = known.get(str(block.data), b.zero(*block.shape))
        elif block.op == "const":
            made[block] = b.const(cast(Sequence[Sequence[float]], block.data))
        else:
            made[block] = b.again(block, [made[a] for a in block.args])
    return b.stack([[made[block]] for block in blocks])
