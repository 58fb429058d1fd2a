"""Every gear's equation."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.elements.gear import NAMES, TEXT
from cutjoint.model.records import Gear, JointCoordinate, Model
from cutjoint.report.explain.latex import text
from cutjoint.report.explain.views import Entry, code, make_table, with_others


def explain_gears(model: Model) -> tuple[Entry, ...]:
    """One entry for all gears, none where there is no gear."""
    return (_entry(model.gears, model),) if model.gears else ()


def _entry(gears: Sequence[Gear], model: Model) -> Entry:
    rows = [(code(g.name), g.span.place, _coordinate(g.first), _coordinate(g.second), text(g.ratio, model)) for g in gears]
    return Entry(
        title=f"Gears: {with_others([g.name for g in gears])}",
        notes=(f"{TEXT.capitalize()}, with all turns. Equations: {code(NAMES)}.",),
        formulas=(r"\Phi = q_a - r q_b, \quad \dot \Phi = \dot q_a - r \dot q_b, \quad \ddot \Phi = \ddot q_a - r \ddot q_b",),
        table=make_table(("gear", "line", "$q_a$", "$q_b$", "ratio $r$"), rows),
    )


def _coordinate(end: JointCoordinate) -> str:
    return code(f"{end.joint}.{end.name}")
