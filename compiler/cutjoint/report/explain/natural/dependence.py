"""The equations that follow from the others."""

from __future__ import annotations

from cutjoint.report.explain.natural.derivation import Derivation
from cutjoint.report.explain.views import Chapter, Entry, code, make_table, plural

_FATE = {
    "augmented": "They are held like all others: the penalty makes the tangent regular whatever their rank.",
    "classical": "They are left out: with them the tangent would be singular.",
}


def explain_dependence(d: Derivation) -> Chapter:
    """The equations that others imply in every pose; the last of those that depend on each other."""
    spans = d.model.constraint_spans
    owners = {f"{c.element}.{name}": c.element for c in d.full.constraints for name in c.names}
    rows = [(code(name), spans[owners[name]].place) for name in d.dependent]
    if not rows:
        return Chapter(title="Dependent equations", notes=("None.",), formulas=(), entries=())
    notes = ("In every pose that the compiler tries these follow from the equations before them.", _FATE[d.full.method])
    entry = Entry(title=plural(len(rows), "equation"), notes=(), formulas=(), table=make_table(("equation", "line"), rows))
    return Chapter(title="Dependent equations", notes=notes, formulas=(), entries=(entry,))
