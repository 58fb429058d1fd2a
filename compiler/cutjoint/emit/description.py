"""The description of a mechanism or system: names with units, places in the model's file, layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cutjoint.emit.source import Page, Piece, nominals_of, quotable, switches_of
from cutjoint.formulate.forces import guards_in
from cutjoint.formulate.records import LeftOut, RecursiveEquations, SystemEquations
from cutjoint.formulate.switches import guides_jump
from cutjoint.model.records import Assembly, Guard, Parameter


def describe(equations: RecursiveEquations | SystemEquations) -> dict[str, object]:
    """The view of a description, for templates and for the interpreter.  Natural coordinates have no names of speeds."""
    model, scene = equations.topology.model, equations.scene
    return {
        "model": model.name,
        "charts": equations.charts,
        "name_lists": {
            "coordinates": equations.coordinate_names, "speeds": _named_speeds(equations),
            "equations": equations.equation_names,
        },
        "parameters": _named(equations.parameters),
        "inputs": _named(equations.inputs),
        "roads": equations.roads,
        "cuts": [c.first for c in equations.closures] if isinstance(equations, RecursiveEquations) else [],
        "driven": any(joint.guide is not None for joint in model.joints),
        "guides_jump": guides_jump(model, scene),
        "guards": [
            {"name": guard.name, "place": quotable(guard.span.place), **_kind(guard)} for guard in guards_in(equations)
        ],
        "columns": equations.columns,
        "domains": [
            {
                "function": d.function, "element": d.element, "place": quotable(d.place), "strict": d.strict,
                **({} if d.cure is None else {"cure": d.cure}),
            }
            for d in equations.domains
        ],
        "switches": switches_of(equations),
        "states": len(equations.state.states),
        "nominals": nominals_of(equations),
        "controllers": [
            {"name": c.name, "place": quotable(c.span.place), "every": c.every, "offset": c.offset, "held": len(c.held)}
            for c in model.controllers
        ],
    }  # fmt: skip


def _kind(guard: Guard | Assembly | LeftOut) -> dict[str, int]:
    """The flags of a guard that is not a force's."""
    if isinstance(guard, LeftOut):
        return {"ends": 0, "left_out": 1}
    return {"ends": 1} if isinstance(guard, Assembly) else {}


def _named_speeds(equations: RecursiveEquations | SystemEquations) -> tuple[str, ...]:
    """The names of speeds, or of unknowns that are no natural coordinates."""
    if equations.charts:
        return equations.speed_names
    return equations.unknown_names if isinstance(equations, SystemEquations) and equations.state.states else ()


def emit_description(page: Page, view: Mapping[str, object], function: str, *, system: Mapping[str, object] | None = None) -> Piece:
    """A function that returns the description; of a ``system``, its method, pattern and length of factors too."""
    text = page.render("description.cpp.jinja", **view, system=system, function=function)
    return Piece(text=text, headers=("cutjoint/constants.hpp",))


def _named(parameters: Sequence[Parameter]) -> list[dict[str, str]]:
    return [{"name": p.name, "unit": p.unit, "value": repr(p.value)} for p in parameters]
