"""Views of an explanation: its tables and entries, and the cells in them."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy
from sympy.printing.str import StrPrinter

from cutjoint.model.records import Model, Scalar
from cutjoint.model.text import escaped
from cutjoint.topology.records import SubtreeClass

#: Digits of a number in the text.
DIGITS = 7

#: Names of elements that play the same part, one for each member of a class.
Counterparts: TypeAlias = tuple[str, ...]


def find_counterparts(subtree_class: SubtreeClass) -> tuple[Counterparts, ...]:
    """The elements of a class' members side by side: bodies, tree joints, cut joints, gears, forces.

    An element that belongs to two members of the class is named with the first only.
    """
    rows, known = [], set[str]()
    for row in zip(*subtree_class.members, strict=True):
        fresh = tuple(name for name in dict.fromkeys(row) if name not in known)
        known.update(fresh)
        if fresh:
            rows.append(fresh)
    return tuple(rows)


def number(x: float, *, times: str = "e{}") -> str:
    """A number rounded to DIGITS digits; ``times`` is what follows the mantissa of a very large or small one."""
    value = float(f"{x:.{DIGITS}g}")
    if value == 0.0 or 1e-4 <= abs(value) < 1e9:
        return str(int(value)) if value == int(value) else repr(value)
    mantissa, _, exponent = f"{value:.{DIGITS - 1}e}".partition("e")
    return mantissa.rstrip("0").rstrip(".") + times.format(int(exponent))


@dataclass(frozen=True, kw_only=True)
class Table:
    """Cells of Markdown; ``rule`` is the line below the headings.  A table without rows is not printed."""

    headings: tuple[str, ...]
    rule: str
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A heading with its paragraphs ``notes``, a formula in LaTeX, and a table."""

    title: str
    notes: tuple[str, ...] = ()
    formula: str = ""
    table: Table | None = None


def make_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """A table whose columns of numbers stand to the right."""
    cells = tuple(tuple(row) for row in rows)
    plain = [[not cell.strip("*") or cell.strip("*+-").replace(".", "").isdigit() for cell in row] for row in cells]
    marks = ("---:" if all(row[i] for row in plain) else "---" for i in range(len(headings)))
    return Table(headings=tuple(headings), rule=" | ".join(marks), rows=cells)


def code(names: Iterable[str] | str) -> str:
    """Names as the model file has them."""
    return ", ".join(f"`{name}`" for name in ([names] if isinstance(names, str) else names))


def line_of(element: Any) -> str:
    """The file's name, in which nothing means anything to Markdown, and the line of an element."""
    return re.sub(r"([!-,/;-@[-^`{-~])", r"\\\1", escaped(element.span.place))


class _Text(StrPrinter):  # type: ignore[misc]
    def _print_Float(self, e: Any) -> str:
        return number(float(e))


def text(expression: Scalar, model: Model) -> str:
    """An expression for a table."""
    e = sympy.sympify(expression)
    if e.is_number:
        return number(float(e))
    named = e.xreplace({p.symbol: sympy.Symbol(p.name) for p in model.parameters})
    return f"`{_Text().doprint(named)}`"


def place(vector: Sequence[Scalar], model: Model) -> str:
    """A vector for a table."""
    return f"({', '.join(text(x, model) for x in vector)})"
