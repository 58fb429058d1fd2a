"""The program of the recursive method, isomorphic parts side by side."""

from __future__ import annotations

from cutjoint.formulate.correspondence import find_corresponding
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.system import CHECKS
from cutjoint.program.fold import fold
from cutjoint.program.records import Program
from cutjoint.program.schedule import schedule

#: Functions of the recursive equations that are called several times a step, and that lanes are worth while for.
_OFTEN = frozenset({"evaluate", "project", "guard", "events"})


def schedule_recursive(equations: RecursiveEquations, *, lanes: bool) -> Program:
    """The program of the recursive method; what is called less than once a step stays out of the lanes."""
    families = find_corresponding(equations.builder.quantities, equations.topology) if lanes else []
    folded = {f.name: fold(equations.builder, families, f.results) for f in equations.functions if f.name in _OFTEN}
    return schedule(equations.builder, [(f.name, folded.get(f.name, f.results)) for f in equations.functions], lanes=lanes, last=CHECKS)
