"""The records that the template of the explanation prints, decided here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Table:
    """Cells of Markdown; ``rule`` is the line below the headings.  A table without rows is not printed."""

    headings: tuple[str, ...]
    rule: str
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Elements that are explained together: ``notes`` are paragraphs, ``formulas`` LaTeX, ``table`` has a row for each."""

    title: str
    notes: tuple[str, ...]
    formulas: tuple[str, ...]
    table: Table


@dataclass(frozen=True, kw_only=True)
class Chapter:
    """One kind of element: the equations that hold for all of them, then the entries."""

    title: str
    notes: tuple[str, ...]
    formulas: tuple[str, ...]
    entries: tuple[Entry, ...]


def make_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """A table whose columns of numbers stand to the right."""
    cells = tuple(tuple(row) for row in rows)
    marks = ("---:" if _is_numeric([row[i] for row in cells]) else "---" for i in range(len(headings)))
    return Table(headings=tuple(headings), rule=" | ".join(marks), rows=cells)


def _is_numeric(cells: Sequence[str]) -> bool:
    return all(not cell.strip("*") or cell.strip("*+-").replace(".", "").isdigit() for cell in cells)


def code(names: Iterable[str] | str) -> str:
    """Names as the model file has them."""
    return ", ".join(f"`{name}`" for name in ([names] if isinstance(names, str) else names))


def with_others(names: Sequence[str]) -> str:
    """The first of several names, and how many more there are."""
    return code(names[0]) + (f" and {len(names) - 1} more" if len(names) > 1 else "")


def plural(count: int, noun: str, many: str = "") -> str:
    """A number and its noun."""
    return f"{count} {noun if count == 1 else many or noun + 's'}"
