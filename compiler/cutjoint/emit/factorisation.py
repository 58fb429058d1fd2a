"""Plan of a static factorisation -> C++: straight-line code by blocks, or index data and a loop where that would be too long."""

from collections.abc import Iterable, Sequence

from cutjoint.emit.factor_blocks import Block, factor_blocks, solve_blocks
from cutjoint.emit.factor_tables import make_tables, pivot_rows
from cutjoint.emit.source import FACTORISATION, Page, Piece
from cutjoint.sparse.plan import Plan
from cutjoint.sparse.tiles import WIDTH

#: Multiply-adds of a factorisation and a solution up to which the code is straight-line.  It is 1.4 to 1.8 times as fast as the loop at any
#: size, but here it takes 10 s to compile and 0.4 MB, and it would not stay in the processor's cache for long.
STRAIGHT_LINE = 30_000

#: The runtime's headers of both forms, and that of the build's precision.
_FORMS, _PRECISION = "cutjoint/core/newton", "cutjoint/precision.hpp"

_STATEMENTS = 400  #: statements of a generated function

#: The functions that straight-line code is made of: arguments, and the same for a build's precision.
_ARGUMENTS = {
    "factor": (
        "[[maybe_unused]] const Real* __restrict tangent, [[maybe_unused]] Real* __restrict factors", "const Precision*, Precision*",
    ),
    "solve": (
        "[[maybe_unused]] const Real* __restrict factors, [[maybe_unused]] Real* __restrict x, [[maybe_unused]] Real* __restrict y",
        "const Precision*, Precision*, Precision*",
    ),
}


def emit_factorisation(plan: Plan, names: Sequence[str], page: Page, *, straight_line: int = STRAIGHT_LINE) -> dict[str, Piece]:
    """`factor`, `solve` and the constant `factors` of namespace cutjoint::generated, by the names of files.
    The header is ``factorisation.hpp``; parts of one file stand in this order.

    Args:
        plan: what to emit.
        names: a name for each row and column of the pattern, for comments.
        page: renders templates, with the banner of all files.
        straight_line: predicted multiply-adds from which on the code is index data and a loop.
    """
    declared = Piece(text=page.render("factorisation.hpp.jinja", **_header(plan)), headers=("cutjoint/core/mechanism/contract.hpp",))
    view = {"symmetric": "true" if plan.pattern.symmetric else "false", "room": WIDTH * len(plan.tiling)}
    if plan.multiply_adds > straight_line:
        text = page.render("factorisation_tables.cpp.jinja", **view, tables=make_tables(plan, names))
        return {f"{FACTORISATION}.hpp": declared, f"{FACTORISATION}.cpp": _whole(text, "static_factor.hpp")}
    factor_parts = _parts("factor", factor_blocks(plan, names), page)
    solve_parts = _parts("solve", solve_blocks(plan, names), page)
    text = page.render(
        "factorisation.cpp.jinja", **view, factor_parts=list(factor_parts), solve_parts=list(solve_parts), pivots=pivot_rows(plan, names)
    )  # fmt: skip
    parts = {f"{name}.cpp": piece for name, piece in (factor_parts | solve_parts).items()}
    return {f"{FACTORISATION}.hpp": declared, f"{FACTORISATION}.cpp": _whole(text, "static_factor_blocks.hpp"), **parts}


def _whole(text: str, header: str) -> Piece:
    instances = (
        "template int factor<Precision>(const Precision*, Precision*);",
        "template void solve<Precision>(const Precision*, Precision*);",
    )
    return Piece(text=text, headers=(f"{FACTORISATION}.hpp", f"{_FORMS}/{header}", _PRECISION), instances=instances)


def _header(plan: Plan) -> dict[str, object]:
    pattern, symmetric = plan.pattern, plan.pattern.symmetric
    kind = "L D L^T" if symmetric else "L U"
    size = f"size {pattern.size} with {len(pattern.row)} entries"
    return {
        "summary": f"{kind} of a matrix of {size}, in {len(plan.tiling)} tiles.  Orders tried:",
        "trials": [
            f"{trial.name}: {trial.multiply_adds} multiply-adds to factor and solve, {trial.operations} operations by tiles"
            for trial in plan.trials
        ],
        "factors": plan.storage.length,
        "kind": kind,
        "usable": "positive" if symmetric else "finite or is zero",
    }


def _parts(kind: str, blocks: Sequence[Block], page: Page) -> dict[str, Piece]:
    arguments, instance = _ARGUMENTS[kind]
    parts = list(_split(blocks))
    return {
        name: Piece(
            text=page.render(
                "factorisation_part.cpp.jinja", function=name, arguments=arguments, blocks=part,
                about=f"Part {number} of {len(parts)} of `{kind}`.",
            ),
            headers=(f"{_FORMS}/static_factor_blocks.hpp", _PRECISION), instances=(f"template void {name}<Precision>({instance});",),
        )
        for number, part in enumerate(parts, start=1)
        for name in [f"{kind}_{number}"]
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
