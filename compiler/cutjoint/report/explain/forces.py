"""Every force's law, its partial derivatives, and how it acts; every gear's equation."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cutjoint.elements.gear import NAMES, TEXT
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.records import Equations
from cutjoint.model.records import Force, Gear, JointCoordinate, Model
from cutjoint.report.explain.force_descriptions import ForceDescription, describe
from cutjoint.report.explain.latex import text, variants
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, make_table, with_others

# Forces


def explain_forces(
    equations: Equations, counterparts: Sequence[Counterparts], description: Callable[[Force, Model], ForceDescription] = describe,
    notes: tuple[str, ...] = (),
) -> Chapter:  # fmt: skip
    """The forces that act in the scene, in the description of a formulation; those that are switched off are named."""
    model, scene = equations.topology.model, equations.scene
    forces = {f.name: f for f in model.forces if is_active(f, scene)}
    descriptions = {name: description(f, model) for name, f in forces.items()}
    groups = group(list(forces), counterparts, lambda name: descriptions[name].kind, lambda name: descriptions[name].laws)
    entries = [_entry([forces[n] for n in names], [descriptions[n] for n in names]) for names in groups]
    off = [f for f in model.forces if f.name not in forces]
    if off:
        rows = make_table(("force", "line"), ((code(f.name), f.span.place) for f in off))
        entries.append(Entry(title="Switched off", notes=("Not in this scene's equations.",), formulas=(), table=rows))
    return Chapter(title="Forces", notes=notes if model.forces else ("None but gravity.",), formulas=(), entries=tuple(entries))


def _entry(forces: Sequence[Force], descriptions: Sequence[ForceDescription]) -> Entry:
    first = descriptions[0]
    shared = [item for item in first.constants if all(item in m.constants for m in descriptions)]
    constants = [[item for item in m.constants if item not in shared] for m in descriptions]
    notes = [f"Constants: {', '.join(f'{name} = {value}' for name, value in shared)}."] if shared else []
    headings = ("force", "line", *(name for name, _ in (*first.places, *constants[0])))
    rows = [
        (code(f.name), f.span.place, *(cell for _, cell in (*m.places, *numbers)))
        for f, m, numbers in zip(forces, descriptions, constants, strict=True)
    ]  # fmt: skip
    names = [f.name for f in forces]
    return Entry(
        title=f"{first.title}: {with_others(names)}", notes=(*first.notes, *notes),
        formulas=(*first.actions, *variants(names, [m.laws for m in descriptions])), table=make_table(headings, rows),
    )  # fmt: skip


# Gears


def explain_gears(model: Model) -> tuple[Entry, ...]:
    """One entry for all gears, none where there is no gear."""
    return (_gear_entry(model.gears, model),) if model.gears else ()


def _gear_entry(gears: Sequence[Gear], model: Model) -> Entry:
    rows = [(code(g.name), g.span.place, _coordinate(g.first), _coordinate(g.second), text(g.ratio, model)) for g in gears]
    return Entry(
        title=f"Gears: {with_others([g.name for g in gears])}",
        notes=(f"{TEXT.capitalize()}, with all turns. Equations: {code(NAMES)}.",),
        formulas=(r"\Phi = q_a - r q_b, \quad \dot \Phi = \dot q_a - r \dot q_b, \quad \ddot \Phi = \ddot q_a - r \ddot q_b",),
        table=make_table(("gear", "line", "$q_a$", "$q_b$", "ratio $r$"), rows),
    )


def _coordinate(end: JointCoordinate) -> str:
    return code(f"{end.joint}.{end.name}")
