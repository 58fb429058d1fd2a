"""Plan of a static factorisation -> C++ files: straight-line code by blocks, or index data and a loop where that would be too long."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cutjoint.emit.factor_blocks import Block, factor_blocks, solve_blocks
from cutjoint.emit.factor_tables import make_tables, pivot_rows
from cutjoint.emit.source import FACTORISATION, Page
from cutjoint.sparse.plan import Plan, Trial
from cutjoint.sparse.tiles import WIDTH

#: Multiply-adds of a factorisation and a solution up to which the code is straight-line.  It is 1.4 to 1.8 times as fast as the loop at any
#: size, but here it takes 10 s to compile and 0.4 MB, and it would not stay in the processor's cache for long.
STRAIGHT_LINE = 30_000

#: Statements of a generated function.
_STATEMENTS = 400

#: The functions that straight-line code is made of: arguments, and the same for a build's precision.
_ARGUMENTS = {
    "factor": ("[[maybe_unused]] const Real* __restrict tangent, Real* __restrict factors", "const Precision*, Precision*"),
    "solve": (
        "const Real* __restrict factors, [[maybe_unused]] Real* __restrict x, Real* __restrict y",
        "const Precision*, Precision*, Precision*",
    ),
}


def emit_factorisation(
    plan: Plan, names: Sequence[str], page: Page, *, straight_line: int = STRAIGHT_LINE, apart: bool = True
) -> dict[str, str]:
    """`factor`, `solve` and the constant `factors` of namespace cutjoint::generated, as files by name with ``factorisation.hpp`` as header.

    Args:
        plan: what to emit.
        names: a name for each row and column of the pattern, for comments.
        page: renders templates, with the banner of all files.
        straight_line: predicted multiply-adds from which on the code is index data and a loop.
        apart: whether they are files of their own, not parts of one in the order in which they are here.
    """
    files = {f"{FACTORISATION}.hpp": page.render("factorisation.hpp.jinja", apart=apart, **_header(plan))}
    symmetric = "true" if plan.pattern.symmetric else "false"
    room = WIDTH * len(plan.tiling)
    if plan.multiply_adds > straight_line:
        tables = make_tables(plan, names)
        view = {"tables": tables, "symmetric": symmetric, "room": room}
        files["factorisation.cpp"] = page.render("factorisation_tables.cpp.jinja", **view, apart=apart)
        return files
    factor_parts = _parts("factor", factor_blocks(plan, names), page, apart)
    solve_parts = _parts("solve", solve_blocks(plan, names), page, apart)
    files["factorisation.cpp"] = page.render(
        "factorisation.cpp.jinja", factor_parts=list(factor_parts), solve_parts=list(solve_parts),
        pivots=pivot_rows(plan, names), symmetric=symmetric, room=room, apart=apart,
    )  # fmt: skip
    return files | {f"{name}.cpp": text for name, text in (factor_parts | solve_parts).items()}


def _header(plan: Plan) -> dict[str, object]:
    pattern, symmetric = plan.pattern, plan.pattern.symmetric
    kind = "L D L^T" if symmetric else "L U"
    size = f"size {pattern.size} with {len(pattern.row)} entries"
    return {
        "summary": f"{kind} of a matrix of {size}, in {len(plan.tiling)} tiles.  Orders tried:",
        "trials": [_describe(trial) for trial in plan.trials],
        "factors": plan.storage.length,
        "kind": kind,
        "usable": "positive" if symmetric else "finite or is zero",
    }


def _describe(trial: Trial) -> str:
    return f"{trial.name}: {trial.multiply_adds} multiply-adds to factor and solve, {trial.operations} operations by tiles"


def _parts(kind: str, blocks: Sequence[Block], page: Page, apart: bool) -> dict[str, str]:
    """The functions that one is split into, each in a file of its own."""
    arguments, instance = _ARGUMENTS[kind]
    parts = list(_split(blocks))
    return {
        f"{kind}_{number}": page.render(
            "factorisation_part.cpp.jinja", function=f"{kind}_{number}", arguments=arguments, instance=instance, blocks=part,
            about=f"Part {number} of {len(parts)} of `{kind}`.", apart=apart,
        )
        for number, part in enumerate(parts, start=1)
    }  # fmt: skip


def _split(blocks: Sequence[Block]) -> Iterable[list[Block]]:
    """Runs of blocks that have at most `_STATEMENTS` statements, unless a single block has more."""
    part: list[Block] = []
    for block in blocks:
        if part and sum(len(b.statements) for b in part) + len(block.statements) > _STATEMENTS:
            yield part
            part = []
        part.append(block)
    yield part
