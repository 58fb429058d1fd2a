"""C++ names for the program's scalars: those of the formulation's blocks where there is one."""

import re
from collections.abc import Sequence
from itertools import chain, zip_longest

from cutjoint.program.blocks import Label
from cutjoint.program.records import Program

#: Macros of C and C++ headers that look like the names that are made here.
MACROS = frozenset((
    "F_LOCK", "F_OK", "F_TEST", "F_TLOCK", "F_ULOCK", "L_INCR", "L_SET", "L_XTND", "M_1_PI", "M_2_PI", "M_2_SQRTPI", "M_E", "M_LN10",
    "M_LN2", "M_LOG10E", "M_LOG2E", "M_PI", "M_PI_2", "M_PI_4", "M_SQRT1_2", "M_SQRT2", "R_OK", "W_OK", "X_OK",
))  # fmt: skip

_AXES = {3: ("x", "y", "z"), 6: ("vx", "vy", "vz", "wx", "wy", "wz")}


def name_scalars(program: Program) -> dict[int, str]:
    """A unique identifier for every scalar of a labelled block, such as ``R_front_left_arm_xy`` or ``Dinv_chassis_vx``. A scalar has the
    name of its first block; an element of the same sign takes precedence over a negative one. ``_negated`` marks a quantity of which only
    the negative is computed: ``b - a`` also represents ``a - b``, because sums can subtract it without another operation."""
    names: dict[int, str] = {}
    used_names = set(MACROS)
    for block, label in program.labels.items():
        found = [
            (program.graph.signless(scalar), scalar, label.text + _suffix(label, block.shape, i, j))
            for i, row in enumerate(program.elements.get(block, ())) for j, scalar in enumerate(row)
        ]  # fmt: skip
        for bare, scalar, name in sorted(found, key=lambda x: x[0] != x[1]):
            if bare not in names and program.graph.nodes[bare].op not in ("const", "symbol"):
                names[bare] = unique(name if bare == scalar else f"{name}_negated", used_names)
    return names


def _suffix(label: Label, shape: tuple[int, int], i: int, j: int) -> str:
    rows, columns = shape
    if shape == (1, 1):
        return ""
    row = identifier(label.rows[i]) if label.rows else _axis(rows, i)
    if columns == 1:
        return f"_{row}"
    column = identifier(label.columns[j]) if label.columns else _axis(columns, j)
    separator = "" if len(row) == len(column) == 1 and rows == columns == 3 else "_"
    return f"_{row}{separator}{column}"


def _axis(count: int, i: int) -> str:
    return _AXES[count][i] if count in _AXES else str(i)


def unique(name: str, used_names: set[str]) -> str:
    """The name, or the name with a number, that ``used_names`` does not have; it is added to these."""
    candidate, n = name, 2
    while candidate in used_names:
        candidate, n = f"{name}_{n}", n + 1
    used_names.add(candidate)
    return candidate


def common_name(first: str, last: str) -> str:
    """The common part of the names of the first and the last of several like things. It is without the numbers that differ, and empty if
    more differs. >>> common_name("R_crank_0_bar_xx", "R_crank_19_bar_xx") 'R_crank_bar_xx'"""
    ones, others = (re.split(r"_?(\d+)", name) for name in (first, last))
    if ones[::2] != others[::2]:
        return ""
    numbers = re.findall(r"_?\d+", first)
    kept = [number if one == other else "" for number, one, other in zip(numbers, ones[1::2], others[1::2], strict=True)]
    return "".join(chain.from_iterable(zip_longest(ones[::2], kept, fillvalue="")))


def road_names(roads: Sequence[str]) -> dict[str, str]:
    """An identifier for each tyre's road; instances may make two names alike."""
    used_names: set[str] = set()
    return {road: unique(f"road_{road.replace('.', '_')}", used_names) for road in roads}


def identifier(text: str) -> str:
    """Text as part of a C++ name."""
    return re.sub(r"\W", "_", text)
