"""The pattern of a tangent: what the lowered program shows to be no constant zero."""

from __future__ import annotations

from dataclasses import replace

from cutjoint.program.records import Program, Result
from cutjoint.sparse.pattern import Pattern, make_pattern

#: How the results that are entries of a tangent are named: row and column follow.
PREFIX = "tangent:"


def settle_entries(program: Program, size: int, *, symmetric: bool) -> tuple[Program, Pattern]:
    """The pattern of the entries ``tangent:row,column``, and the program without those that are always zero."""
    functions = tuple(replace(f, results=tuple(r for r in f.results if not _is_absent(program, r))) for f in program.functions)
    entries = (_entry(r.target) for f in functions for r in f.results if r.target.startswith(PREFIX))
    pattern = make_pattern(size, entries, symmetric=symmetric)
    return replace(program, functions=functions), pattern


def _entry(target: str) -> tuple[int, int]:
    """Row and column of a result."""
    row, column = target.removeprefix(PREFIX).split(",")
    return int(row), int(column)


def places(pattern: Pattern) -> dict[str, int]:
    """The places of the results that are entries, by their names."""
    return {f"{PREFIX}{i},{j}": k for k, (i, j) in enumerate(pattern.entries())}


def _is_absent(program: Program, result: Result) -> bool:
    return result.target.startswith(PREFIX) and program.graph.value(result.scalar) == 0.0
