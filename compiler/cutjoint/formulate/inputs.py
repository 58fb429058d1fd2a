"""The inputs of the program: parameters, time, the model's inputs, coordinates and speeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import sympy

from cutjoint.elements.joint import ATTITUDE
from cutjoint.formulate.records import Chart, Slot
from cutjoint.formulate.translate import Translator
from cutjoint.methods import CLOSURES
from cutjoint.model.records import Binding, Gear, Joint, Model, Output, Parameter, Scalar, Scene
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.topology.records import Topology

TIME = sympy.Symbol("t", real=True)

#: The program's symbol of the model's inputs: of each one in turn the numbers of these orders.
INPUTS = "inputs"
INPUT_ORDERS = ("value", "rate", "acceleration")


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """Blocks of the numerical parameters of cut joints and gears; ``penalties`` by their names."""

    penalties: Mapping[str, Block]
    damping_ratio: Block
    frequency: Block


def open_parameters(model: Model) -> tuple[Parameter, ...]:
    """The parameters that the binary loads."""
    return tuple(p for p in model.parameters if p.binding is Binding.PARAM)


def input_parameters(model: Model) -> tuple[Parameter, ...]:
    """The parameters that are read at every step."""
    return tuple(p for p in model.parameters if p.binding is Binding.INPUT)


def input_symbols(parameter: Parameter) -> tuple[Scalar, Scalar, Scalar]:
    """The symbols of an input's value, rate and acceleration; dots keep the latter two apart from the names of parameters."""
    return parameter.symbol, *(sympy.Symbol(f"{parameter.name}.{order}", real=True) for order in INPUT_ORDERS[1:])


def make_translator(builder: Builder, model: Model) -> Translator:
    """A translator that knows time, parameters, and inputs with their rates."""
    values: dict[Scalar, Block] = {TIME: builder.symbol("t", 1, BindingTime.STEP), **parameter_blocks(builder, model)}
    inputs = input_parameters(model)
    if inputs:
        given = builder.symbol(INPUTS, len(INPUT_ORDERS) * len(inputs), BindingTime.STEP)
        symbols = [symbol for p in inputs for symbol in input_symbols(p)]
        values |= {symbol: builder.label(builder.element(given, i), _name_of(symbol)) for i, symbol in enumerate(symbols)}
    return Translator(builder, values)


def _name_of(symbol: Scalar) -> str:
    return str(symbol).replace(".", "_")


def parameter_blocks(builder: Builder, model: Model) -> dict[Scalar, Block]:
    """The blocks of the parameters that do not change in a run."""
    column = open_parameters(model)
    values: dict[Scalar, Block] = {}
    if column:
        loaded = builder.symbol("parameters", len(column), BindingTime.PARAM)
        for i, parameter in enumerate(column):
            values[parameter.symbol] = builder.label(builder.element(loaded, i), _name_of(parameter.symbol).removeprefix("p_"))
    for parameter in model.parameters:
        if parameter.binding is Binding.CONST:
            values[parameter.symbol] = builder.number(parameter.value)
    return values


def input_functions(model: Model, scene: Scene) -> Mapping[Scalar, Scalar]:
    """Each input's symbol and its function of time in the scene; constant where the scene does not say."""
    return {p.symbol: scene.inputs.get(p.name, sympy.Float(p.value)) for p in input_parameters(model)}


def guide_rates(guide: Scalar, model: Model) -> tuple[Scalar, Scalar, Scalar]:
    """A guide's position, rate and acceleration as expressions of time, parameters, and inputs with their rates."""
    orders = [input_symbols(p) for p in input_parameters(model)]
    rate = _time_derivative(guide, orders)
    return guide, rate, _time_derivative(rate, orders)


def guided_by(model: Model, parameter: Parameter) -> Joint | None:
    """A joint whose guide follows an input."""
    guides = ((joint, guide) for joint in model.joints for guide in joint.guide or ())
    return next((joint for joint, guide in guides if guide.has(parameter.symbol)), None)


def _time_derivative(expression: Scalar, inputs: Sequence[tuple[Scalar, Scalar, Scalar]]) -> Scalar:
    """The total derivative: d/dt + u' d/du + u'' d/du'."""
    parts = [sympy.diff(expression, TIME)]
    parts += [sympy.diff(expression, x) * faster for orders in inputs for x, faster in pairwise(orders) if expression.has(x)]
    return sympy.Add(*parts)


def make_numbers(builder: Builder, closing: Sequence[Joint | Gear], closure: str) -> Numbers:
    """The numerical parameters; with a closure that finds its penalties one for each cut joint and gear, and no stabilisation."""
    if CLOSURES[closure].penalty_of_each_cut:
        vector = builder.symbol("penalties", max(len(closing), 1), BindingTime.PARAM)
        penalties = {cut.name: builder.name(builder.element(vector, i), "penalty", cut.name) for i, cut in enumerate(closing)}
        return Numbers(penalties=penalties, damping_ratio=builder.number(0.0), frequency=builder.number(0.0))
    column = builder.symbol("numerics", 3, BindingTime.PARAM)
    names = ("penalty", "damping_ratio", "frequency")
    penalty, ratio, frequency = (builder.label(builder.element(column, i), n) for i, n in enumerate(names))
    return Numbers(penalties={cut.name: penalty for cut in closing}, damping_ratio=ratio, frequency=frequency)


def make_charts(topology: Topology) -> tuple[Chart, ...]:
    """The places of each tree joint's coordinates and speeds in q and v; guided and fixed joints have none."""
    charts: list[Chart] = []
    q = v = 0
    for t in topology.tree:
        element = t.joint.element
        if t.joint.guide is not None or not element.speeds:
            continue
        scalars, ball = len(element.coordinates), element.has_ball
        charts.append(
            Chart(
                joint=t.joint.name, q=q, v=v, scalars=scalars, ball=ball, reversed=t.reversed,
                coordinate_names=element.coordinates + (ATTITUDE if ball else ()), speed_names=element.speeds,
            )
        )  # fmt: skip
        q, v = q + scalars + 4 * ball, v + len(element.speeds)
    return tuple(charts)


def chart_slots(charts: tuple[Chart, ...], prefix: str) -> dict[str, Slot]:
    """The places of coordinates, speeds and accelerations of the joints, in arrays of these names with a prefix."""
    slots = {}
    for chart in charts:
        slots[f"q:{chart.joint}"] = Slot(array=f"{prefix}q", offset=chart.q, names=chart.coordinate_names)
        for array in ("v", "vdot"):
            slots[f"{array}:{chart.joint}"] = Slot(array=f"{prefix}{array}", offset=chart.v, names=chart.speed_names)
    return slots


def column_slots(outputs: tuple[Output, ...]) -> dict[str, Slot]:
    """The places of the reported columns."""
    return {f"column:{o.column}": Slot(array="column", offset=i, names=(o.column,)) for i, o in enumerate(outputs)}


def report_columns(
    builder: Builder, quantity: Callable[[Output], Block], outputs: tuple[Output, ...]
) -> dict[str, Block]:  # fmt: skip
    """The result of each column."""
    columns = {o: quantity(o) for o in outputs}
    return {f"column:{o.column}": x if o.factor == 1 else builder.scale(builder.number(o.factor), x) for o, x in columns.items()}


def reference_point(joint: Joint, is_reversed: bool) -> tuple[Scalar, Scalar, Scalar]:
    """The outer body's point of a tree joint in the design position: the origin of the outer body's frame."""
    return joint.at if joint.to is None or is_reversed else joint.to
