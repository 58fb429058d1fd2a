"""The elements of a reduced model that no file has: guards, sensors of rods, columns that stand for others; and the notes of the passes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cutjoint.formulate.forces import is_active
from cutjoint.model.records import Model, RodForce, Scene
from cutjoint.model.reduced import is_reduced
from cutjoint.reduce.records import Note
from cutjoint.report.explain.latex import text
from cutjoint.report.explain.views import Chapter, Entry, Table, code, make_table


def explain_reduction(model: Model, scene: Scene, done: Sequence[Note]) -> tuple[Chapter, ...]:
    """The chapter of a reduced model, none for one as its file has it."""
    if not (is_reduced(model, scene) or done):
        return ()
    return (Chapter(title="Reduced model", notes=(_NOTE,), formulas=(), entries=tuple(_entries(model, scene, done))),)


_NOTE = "Passes made it from the model of the file; its elements are explained above as they are now."


def _entries(model: Model, scene: Scene, done: Sequence[Note]) -> Iterator[Entry]:
    if done:
        rows = make_table(("element", "line", "what was done"), ((code(n.element), n.span.place, n.words) for n in done))
        yield _entry("Passes", "Each element that a pass changed.", rows)
    guards = [g for g in model.guards if is_active(g.force, scene)]
    if guards:
        cells = ((code(g.force.name), g.force.span.place, ", ".join(text(m, model) for m in g.margins)) for g in guards)
        words = "Forces that are taken out, since they do not act while these margins are not negative. A run stops where one is negative."
        yield _entry("Guards", words, make_table(("force", "line", "margins"), cells))
    rods = [r for r in model.reactions if isinstance(r, RodForce)]
    if rods:
        sums = ((code(r.name), r.span.place, " + ".join(f"{text(w, model)} {code(rod)}" for rod, w in r.pushes)) for r in rods)
        words = "Reactions of links that distances stand for: the forces that push the distances' points apart, each times its share."
        yield _entry("Sensors of rods", words, make_table(("sensor", "line", "sum"), sums))
    others = [o for o in scene.outputs if o.stands_for]
    if others:
        read = ((code(o.column), f"{o.factor:g} {code(f'{o.element}.{o.quantity}')}") for o in others)
        yield _entry("Columns", "Columns that are read from others.", make_table(("column", "read from"), read))


def _entry(title: str, note: str, table: Table) -> Entry:
    return Entry(title=title, notes=(note,), formulas=(), table=table)
