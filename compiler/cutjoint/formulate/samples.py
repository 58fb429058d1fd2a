"""Samples of controllers: the function ``sample`` computes the values that they hold anew."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from cutjoint.formulate.inputs import held_name
from cutjoint.formulate.layout import Slot
from cutjoint.formulate.quantities import reading
from cutjoint.formulate.records import SAMPLE, Function
from cutjoint.formulate.translate import Translator
from cutjoint.model.records import Model, Output
from cutjoint.program.blocks import Block, Builder


def sample_function(b: Builder, translator: Translator, model: Model, quantity: Callable[[Output], Block]) -> tuple[Function, ...]:
    """The function of a model with controllers: the next value of each that they hold, of the state and what is held at that instant.

    ``quantity`` knows accelerations and reactions too, which are those of the forces with the values before.
    """
    if not model.controllers:
        return ()
    at_sample = reading(b, translator, model, quantity)
    results: dict[str, Block] = {}
    for controller in model.controllers:
        for value in controller.held:
            with b.section("controller", controller.name, "", controller.span.place):
                results[f"{SAMPLE}:{len(results)}"] = at_sample.scalar(value.next)
    state = ("const Real* q", "const Real* v", "const Real* vdot", "const Real* lambda")
    return (Function(name=SAMPLE, arguments=(*state, "Real* held"), results=results),)


def sample_slots(model: Model) -> Mapping[str, Slot]:
    """The places of its results."""
    return {f"{SAMPLE}:{i}": Slot(array="held", offset=i, names=(held_name(value),)) for i, value in enumerate(model.held)}
