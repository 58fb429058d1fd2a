"""Counts of bodies, coordinates and equations, and the cost of solving."""

from __future__ import annotations

from cutjoint.report.explain.graph import count_bodies, given_rows, operation_rows
from cutjoint.report.explain.natural.derivation import Derivation
from cutjoint.report.explain.natural.layout import kinds
from cutjoint.report.explain.views import Table, code, make_table
from cutjoint.sparse.pattern import Pattern
from cutjoint.sparse.plan import Plan


def summarise_natural(d: Derivation) -> Table:
    """The counts."""
    model, layout = d.model, d.full.layout
    coordinates = len(d.full.coordinate_names)
    return make_table(("what", "count"), [
        ("bodies", count_bodies(model)),
        ("joints", f"{len(model.joints)}, {sum(1 for j in model.joints if j.guide is not None)} of them guided"),
        *given_rows(d.full),
        ("coordinates", f"{coordinates}, of {kinds(layout.coordinates)}"),
        ("constraint equations", f"{len(d.full.equation_names)}, {d.rank} of them independent{_left_out(d)}"),
        ("degrees of freedom", str(coordinates - d.rank)),
        ("entries of the tangent", tangent_entries(d.plan.pattern)),
        *factorisation_rows(d.plan),
        *operation_rows(d.program),
    ])  # fmt: skip


def _left_out(d: Derivation) -> str:
    n = len(d.full.equation_names) - len(d.equations.equation_names)
    return f", {n} left out" if n else ""


def tangent_entries(pattern: Pattern) -> str:
    """The number of entries of the tangent beside its size, in words."""
    n, size = len(pattern.row), pattern.size
    return f"{n} of {size * (size + 1) // 2} of the lower triangle" if pattern.symmetric else f"{n} of {size**2}"


def factorisation_rows(plan: Plan) -> list[tuple[str, str]]:
    """The cost of solving with the tangent: the order in use and the other tried ones, by their predicted operations in four lanes."""
    used, *others = (f"{code(trial.name)} with {trial.operations}" for trial in plan.trials)
    rejected = f"; {', '.join(others)}" if others else ""
    return [
        ("order of elimination", f"{used} operations in four lanes{rejected}"),
        ("multiply-adds of a factorisation and a solution", str(plan.multiply_adds)),
    ]
