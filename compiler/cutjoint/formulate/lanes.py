"""Corresponding blocks of isomorphic parts, which lanes compute side by side, and the program of the recursive method with them."""

from collections.abc import Mapping
from dataclasses import replace

from cutjoint.formulate.records import CHECKS, FORCE_RESIDUAL, POSES, RecursiveEquations
from cutjoint.program.blocks import Block, Quantity
from cutjoint.program.fold import Family, fold
from cutjoint.program.lower import reachable_blocks
from cutjoint.program.records import Program
from cutjoint.program.schedule import schedule
from cutjoint.topology.records import Topology

#: Functions of the recursive equations that are called several times a step, and that lanes are worth while for.
_OFTEN = frozenset({"evaluate", "constraint_residual", "project", "guard", "events", FORCE_RESIDUAL})

#: Functions that compute the multipliers of embedded loops, which is slow without lanes.
_WITH_MULTIPLIERS = frozenset({"report", "aims", "energy"})


def schedule_recursive(equations: RecursiveEquations, *, lanes: bool) -> Program:
    """The program of the recursive method; functions that are called less than once a step have no lanes."""
    families = find_corresponding(equations.builder.quantities, equations.topology) if lanes else []
    often, used = _OFTEN, dict.fromkeys((f.name for f in equations.functions), families)
    if equations.topology.embedded:
        often |= _WITH_MULTIPLIERS
        for f in equations.functions:  # most need no massless bodies of embedded loops
            reached = set(reachable_blocks(f.results.values()))
            used[f.name] = [family for family in families if not reached.isdisjoint(family)]
    folded = {f.name: fold(equations.builder, used[f.name], f.results) for f in equations.functions if f.name in often}
    functions = [(f.name, folded.get(f.name, f.results)) for f in equations.functions]
    return schedule(equations.builder, functions, lanes=lanes, last=(*CHECKS, POSES))


def find_corresponding(quantities: Mapping[Quantity, Block], topology: Topology) -> list[Family]:
    """A family for every quantity of a class's first member that has a counterpart in all others.
    Only classes whose members depend on their common carrier alone have lanes; the members of a chain depend on each other."""
    families = []
    order = {quantity: i for i, quantity in enumerate(quantities)}
    by_part: dict[str, set[Quantity]] = {}
    for quantity in quantities:
        for part in quantity.parts:
            by_part.setdefault(part, set()).add(quantity)
    for members in (group for found in topology.classes for group in found.lanes):
        counterparts = [dict(zip(members[0], member, strict=True)) for member in members]
        for quantity in sorted(set().union(*(by_part.get(part, set()) for part in members[0])), key=order.__getitem__):
            family = _family(quantity, quantities, counterparts)
            if family is not None:
                families.append(family)
    return families


def _family(quantity: Quantity, quantities: Mapping[Quantity, Block], counterparts: list[dict[str, str]]) -> Family | None:
    members: list[Block] = []
    for names in counterparts:
        found = quantities.get(replace(quantity, parts=tuple(names.get(part, part) for part in quantity.parts)))
        if found is None or found.shape != quantities[quantity].shape:
            return None
        members.append(found)
    return tuple(members) if any(m is not members[0] for m in members) else None
