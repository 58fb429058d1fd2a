"""The model's inputs in a scene: its laws with their first and second derivatives, as a function of their own.

The function ``scene_inputs`` fills the array that a step reads: three numbers of each input, then the values at whose changes of sign laws
change their formulas, then the margins of the laws' domains.  All other functions read the array alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import cast

import sympy

from cutjoint.formulate.inputs import INPUT_ORDERS, INPUTS, TIME, input_functions, input_parameters, parameter_blocks
from cutjoint.formulate.records import Function, Slot
from cutjoint.formulate.translate import Translator
from cutjoint.model.records import Model, Parameter, Scene
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.lower import reachable_blocks
from cutjoint.program.switches import Domain, Switch, find_domains, find_switches

#: The time at which laws are evaluated; unlike ``t`` it is not known when a step begins.
LAW_TIME = "law_time"

#: The symbol of what a step reads of the laws besides the inputs: values of switches, then margins.
LAW_VALUES = "law_values"


@dataclass(frozen=True, kw_only=True)
class SceneInputs:
    """The function ``scene_inputs`` of a model with ``inputs``, and the switches and domains of its laws.

    ``length`` is that of the array.  Without inputs there is no function.
    """

    inputs: tuple[Parameter, ...] = ()
    functions: tuple[Function, ...] = ()
    switches: tuple[Switch, ...] = ()
    domains: tuple[Domain, ...] = ()
    slots: Mapping[str, Slot] = field(default_factory=dict)
    length: int = 0


def derive_scene_inputs(b: Builder, model: Model, scene: Scene, results: Iterable[Block], *, events: bool = True) -> SceneInputs:
    """The scene's inputs; ``results`` are those of the equations of motion, in which a switch or a domain counts.

    Switches are left out without ``events``.
    """
    inputs = input_parameters(model)
    if not inputs:
        return SceneInputs()
    laws = [block for p in inputs for block in _law(b, model, scene, p)]
    used = [laws[i] for i in _used(results)]
    switches = find_switches(b, used) if events else []
    domains = find_domains(b, used)
    conditions = [*(s.value for s in switches), *(d.margin for d in domains)]
    values = [*laws, *conditions]
    read = _read(b, len(conditions))
    slot_names = [*(f"{p.name} {order}" for p in inputs for order in INPUT_ORDERS), *("law" for _ in conditions)]
    return SceneInputs(
        inputs=inputs,
        functions=(
            Function(name="scene_inputs", arguments=("Real t", "Real* input"), results={f"input:{i}": x for i, x in enumerate(values)}),
        ),
        switches=tuple(replace(s, value=next(read)) for s in switches),
        domains=tuple(replace(d, margin=next(read)) for d in domains),
        slots={
            **{f"input:{i}": Slot(array="input", offset=i, names=(name,)) for i, name in enumerate(slot_names)},
            INPUTS: Slot(array="input", offset=0, names=tuple(slot_names[: len(laws)])),
            LAW_VALUES: Slot(array="input", offset=len(laws), names=tuple(slot_names[len(laws) :])),
        },
        length=len(values),
    )  # fmt: skip


def _law(b: Builder, model: Model, scene: Scene, parameter: Parameter) -> Iterator[Block]:
    """An input's value, rate and acceleration in the scene."""
    law = input_functions(model, scene)[parameter.symbol]
    place = scene.span.place if parameter.name in scene.inputs else parameter.span.place
    with b.section("input", parameter.name, "u(t), du/dt, d2u/dt2", place):
        time = b.symbol(LAW_TIME, 1, BindingTime.ITERATION)
        translator = Translator(b, {TIME: time, **parameter_blocks(b, model)})
        for order in range(len(INPUT_ORDERS)):
            yield translator.scalar(sympy.diff(law, TIME, order) if order else law)


def _used(results: Iterable[Block]) -> list[int]:
    """The numbers among the inputs that results depend on."""
    found: set[int] = set()
    for block in reachable_blocks(results):
        if block.op == "take" and block.args[0].op == "symbol" and block.args[0].data == INPUTS:
            (first, last), _ = cast(tuple[tuple[int, int], tuple[int, int]], block.data)
            found.update(range(first, last))
    return sorted(found)


def _read(b: Builder, count: int) -> Iterator[Block]:
    """The values of the laws besides the inputs that a step reads, element by element."""
    if count:
        column = b.symbol(LAW_VALUES, count, BindingTime.STEP)
        yield from (b.element(column, i) for i in range(count))
