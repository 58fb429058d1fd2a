"""The places at which forces, guides and drives change their formulas: shared by the formulations in relative coordinates.

The function ``events`` has values that change their sign at such a place; a description says to what each belongs.
"""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.formulate.records import Function, Slot, SwitchPlace
from cutjoint.program.blocks import Builder
from cutjoint.program.switches import Switch


def events_function(switches: Sequence[Switch]) -> tuple[Function, ...]:
    """The function ``events``: q, v -> the values of the switches; none if there are none."""
    arguments = ("const Real* q", "const Real* v", "Real* value")
    results = {f"value:{i}": switch.value for i, switch in enumerate(switches)}
    return (Function(name="events", arguments=arguments, results=results),) if switches else ()


def value_slots(switches: Sequence[Switch]) -> dict[str, Slot]:
    """The places of the values."""
    return {f"value:{i}": Slot(array="value", offset=i, names=("value",)) for i in range(len(switches))}


def describe_switches(b: Builder, switches: Sequence[Switch]) -> tuple[SwitchPlace, ...]:
    """The element of each switch and its line in the model file."""
    numbers = {switch.value: i for i, switch in enumerate(switches) if not switch.road}
    sections = [b.sections[switch.section] for switch in switches]
    return tuple(
        SwitchPlace(
            element=section.element or section.stage, place=section.source, road=switch.road,
            across=-1 if switch.across is None else numbers.get(switch.across, -1),
        )
        for switch, section in zip(switches, sections, strict=True)
    )  # fmt: skip
