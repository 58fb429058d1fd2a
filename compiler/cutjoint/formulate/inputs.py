"""The inputs of the program: parameters, time, the model's inputs, coordinates and speeds.

The function ``scene_inputs`` evaluates the laws of a scene's inputs into one array, the only one that other functions read. It has value,
rate and acceleration of each input, initial values of controllers, event indicators of the laws, and margins of the laws' domains.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import sympy

from cutjoint.elements.joint import ATTITUDE
from cutjoint.formulate.layout import Chart, Slot
from cutjoint.formulate.records import Function
from cutjoint.formulate.translate import Translator
from cutjoint.methods import CLOSURES
from cutjoint.model.expressions.parse import POSITION
from cutjoint.model.records import Binding, DiscreteState, Gear, Joint, Model, Output, Parameter, Scalar, Scene
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.indicators import Domain, EventIndicator, find_domains, find_indicators
from cutjoint.program.lower import reachable_blocks
from cutjoint.topology.records import Topology

TIME = sympy.Symbol("t", real=True)

INPUTS = "inputs"  #: the program's symbol of the model's inputs: the numbers of these orders for each one
INPUT_ORDERS = ("value", "rate", "acceleration")

DISCRETE_STATES = "discrete_states"  #: the program's symbol of the discrete states
LAW_TIME = "law_time"  #: the time at which laws are evaluated; unlike ``t`` it is not known when a step begins
LAW_VALUES = "law_values"  #: the symbol of the values of laws that a step reads in addition to inputs: indicators, then margins


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """Blocks of the numerical parameters of cut joints and gears; ``penalties`` by their names."""

    penalties: Mapping[str, Block]
    damping_ratio: Block
    frequency: Block


def tunable_parameters(model: Model) -> tuple[Parameter, ...]:
    """The parameters that the binary loads."""
    return tuple(p for p in model.parameters if p.binding is Binding.PARAM)


def input_parameters(model: Model) -> tuple[Parameter, ...]:
    """The parameters that are read at every step."""
    return tuple(p for p in model.parameters if p.binding is Binding.INPUT)


def input_symbols(parameter: Parameter) -> tuple[Scalar, Scalar, Scalar]:
    """The symbols of an input's value, rate and acceleration; dots keep the latter two apart from the names of parameters."""
    return parameter.symbol, *(sympy.Symbol(f"{parameter.name}.{order}", real=True) for order in INPUT_ORDERS[1:])


def make_translator(builder: Builder, model: Model) -> Translator:
    """A translator that knows time, parameters, inputs with their rates, and first-order states."""
    values: dict[Scalar, Block] = {TIME: builder.symbol("t", 1, BindingTime.STEP), **parameter_blocks(builder, model)}
    inputs = input_parameters(model)
    if inputs:
        numbers = builder.symbol(INPUTS, len(INPUT_ORDERS) * len(inputs), BindingTime.STEP)
        symbols = [symbol for p in inputs for symbol in input_symbols(p)]
        values |= {symbol: builder.label(builder.element(numbers, i), _name_of(symbol)) for i, symbol in enumerate(symbols)}
    if model.discrete_states:
        states = builder.symbol(DISCRETE_STATES, len(model.discrete_states), BindingTime.STEP)
        values |= {value.symbol: builder.element(states, i) for i, value in enumerate(model.discrete_states)}
    values |= {s.symbol: builder.symbol(f"v:{s.name}", 1, BindingTime.ITERATION) for s in model.states}
    return Translator(builder, values)


def _name_of(symbol: Scalar) -> str:
    return str(symbol).replace(".", "_")


def parameter_blocks(builder: Builder, model: Model) -> dict[Scalar, Block]:
    """The blocks of the parameters that do not change in a run."""
    column = tunable_parameters(model)
    values: dict[Scalar, Block] = {}
    if column:
        loaded = builder.symbol("parameters", len(column), BindingTime.PARAM)
        for i, parameter in enumerate(column):
            values[parameter.symbol] = builder.label(builder.element(loaded, i), _name_of(parameter.symbol).removeprefix("p_"))
    for parameter in model.parameters:
        if parameter.binding is Binding.CONST:
            values[parameter.symbol] = builder.number(parameter.value)
    return values


def discrete_state_name(value: DiscreteState) -> str:
    """The name of a discrete state, "controller.value"."""
    return str(value.symbol).removeprefix("@")


def input_functions(model: Model, scene: Scene) -> Mapping[Scalar, Scalar]:
    """Each input's symbol and its function of time in the scene; constant where the scene does not say."""
    return {p.symbol: scene.inputs.get(p.name, sympy.Float(p.value)) for p in input_parameters(model)}


def guide_rates(guide: Scalar, model: Model) -> tuple[Scalar, Scalar, Scalar]:
    """A guide's position, rate and acceleration as expressions of time, parameters, and inputs with their rates."""
    orders = [input_symbols(p) for p in input_parameters(model)]
    rate = _time_derivative(guide, orders)
    return guide, rate, _time_derivative(rate, orders)


def gear_derivatives(gear: Gear, translator: Translator, position: Block) -> tuple[Block, Block, Block]:
    """A gear's law with its first and second derivative by the second coordinate, at a ``position`` of that."""
    derivative = sympy.diff(gear.law, POSITION)
    known = translator.with_values({POSITION: position})
    return known.scalar(gear.law), known.scalar(derivative), known.scalar(sympy.diff(derivative, POSITION))


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
    """The numerical parameters; a closure that determines its penalties has one for each cut joint and gear, and no stabilisation."""
    if CLOSURES[closure].penalty_of_each_cut:
        vector = builder.symbol("penalties", max(len(closing), 1), BindingTime.PARAM)
        penalties = {cut.name: builder.name(builder.element(vector, i), "penalty", cut.name) for i, cut in enumerate(closing)}
        return Numbers(penalties=penalties, damping_ratio=builder.number(0.0), frequency=builder.number(0.0))
    column = builder.symbol("numerics", 3, BindingTime.PARAM)
    names = ("penalty", "damping_ratio", "frequency")
    penalty, ratio, frequency = (builder.label(builder.element(column, i), n) for i, n in enumerate(names))
    return Numbers(penalties={cut.name: penalty for cut in closing}, damping_ratio=ratio, frequency=frequency)


def make_charts(topology: Topology) -> tuple[Chart, ...]:
    """The places of each tree joint's coordinates and speeds in q and v; guided, fixed and dependent joints have none."""
    charts: list[Chart] = []
    q = v = 0
    following = topology.model.dependent_joints
    for t in topology.tree:
        element = t.joint.element
        if t.joint.guide is not None or t.joint.name in following or not element.speeds:
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


def column_slots(outputs: tuple[Output, ...], array: str = "column") -> dict[str, Slot]:
    """The places of the reported columns."""
    return {f"{array}:{o.column}": Slot(array=array, offset=i, names=(o.column,)) for i, o in enumerate(outputs)}


def report_columns(
    builder: Builder, quantity: Callable[[Output], Block], outputs: tuple[Output, ...], array: str = "column"
) -> dict[str, Block]:  # fmt: skip
    """The result of each column."""
    columns = {o: quantity(o) for o in outputs}
    return {f"{array}:{o.column}": x if o.factor == 1 else builder.scale(builder.number(o.factor), x) for o, x in columns.items()}


def reference_point(joint: Joint, is_reversed: bool) -> tuple[Scalar, Scalar, Scalar]:
    """The outer body's point of a tree joint in the design position: the origin of the outer body's frame."""
    return joint.at if joint.to is None or is_reversed else joint.to


@dataclass(frozen=True, kw_only=True)
class SceneInputs:
    """The function ``scene_inputs`` of a model with ``inputs`` or controllers, and the indicators and domains of its laws.
    ``length`` is that of the array. Models without inputs and controllers have no function."""

    inputs: tuple[Parameter, ...] = ()
    functions: tuple[Function, ...] = ()
    indicators: tuple[EventIndicator, ...] = ()
    domains: tuple[Domain, ...] = ()
    slots: Mapping[str, Slot] = field(default_factory=dict)
    length: int = 0


def derive_scene_inputs(b: Builder, model: Model, scene: Scene, results: Iterable[Block], *, events: bool = True) -> SceneInputs:
    """The scene's inputs, with indicators (only if ``events``) and domains of the inputs that ``results`` depend on.
    ``results`` are those of the equations of motion."""
    inputs = input_parameters(model)
    if not inputs and not model.discrete_states:
        return SceneInputs()
    laws = [block for p in inputs for block in _law(b, model, scene, p)]
    used = [laws[i] for i in sorted(elements_read(results, INPUTS))]
    indicators = find_indicators(b, used) if events else []
    domains = find_domains(b, used)
    conditions = [*(s.value for s in indicators), *(d.margin for d in domains)]
    begun = [*laws, *_starts(b, model)]
    values = [*begun, *conditions]
    read = (b.element(b.symbol(LAW_VALUES, len(conditions), BindingTime.STEP), i) for i in range(len(conditions)))
    discrete_state_names = [discrete_state_name(value) for value in model.discrete_states]
    slot_names = [*(f"{p.name} {order}" for p in inputs for order in INPUT_ORDERS), *discrete_state_names, *("law" for _ in conditions)]
    return SceneInputs(
        inputs=inputs,
        functions=(
            Function(name="scene_inputs", arguments=("Real t", "Real* input"), results={f"input:{i}": x for i, x in enumerate(values)}),
        ),
        indicators=tuple(replace(s, value=next(read)) for s in indicators),
        domains=tuple(replace(d, margin=next(read)) for d in domains),
        slots={
            **{f"input:{i}": Slot(array="input", offset=i, names=(name,)) for i, name in enumerate(slot_names)},
            INPUTS: Slot(array="input", offset=0, names=tuple(slot_names[: len(laws)])),
            **({DISCRETE_STATES: Slot(array="input", offset=len(laws), names=tuple(discrete_state_names))} if discrete_state_names else {}),
            LAW_VALUES: Slot(array="input", offset=len(begun), names=tuple(slot_names[len(begun) :])),
        },
        length=len(values),
    )  # fmt: skip


def _law(b: Builder, model: Model, scene: Scene, parameter: Parameter) -> Iterator[Block]:
    law = input_functions(model, scene)[parameter.symbol]
    place = scene.span.place if parameter.name in scene.inputs else parameter.span.place
    with b.section("input", parameter.name, "u(t), du/dt, d2u/dt2", place):
        time = b.symbol(LAW_TIME, 1, BindingTime.ITERATION)
        translator = Translator(b, {TIME: time, **parameter_blocks(b, model)})
        for order in range(len(INPUT_ORDERS)):
            yield translator.scalar(sympy.diff(law, TIME, order) if order else law)


def _starts(b: Builder, model: Model) -> Iterator[Block]:
    """The discrete states before the first samples."""
    translator = Translator(b, parameter_blocks(b, model))
    for controller in model.controllers:
        with b.section("controller", controller.name, "before the first sample", controller.span.place):
            yield from (translator.scalar(value.start) for value in controller.discrete_states)


def elements_read(results: Iterable[Block], symbol: str) -> set[int]:
    """The elements of an input of the program that results depend on."""
    found = set[int]()
    for block in reachable_blocks(results):
        if block.op == "symbol" and block.data == symbol and block.shape == (1, 1):
            found.add(0)
        for column in (a for a in block.args if a.op == "symbol" and a.data == symbol):
            data: Any = block.data
            found.update(range(*data[0]) if block.op == "take" else range(column.shape[0]))
    return found
