"""Views of an explanation: groups of elements explained together, the records that the template prints, and the printing."""

import re
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from cutjoint.emit.source import environment
from cutjoint.model.text import escaped
from cutjoint.package.locations import __version__
from cutjoint.report.explain.latex import DIGITS
from cutjoint.topology.records import SubtreeClass

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


def group(
    names: Sequence[str], counterparts: Iterable[Counterparts], kind: Callable[[str], Hashable], form: Callable[[str], Hashable]
) -> tuple[tuple[str, ...], ...]:
    """The names in groups of one kind: counterparts together, and groups whose first elements have the same form."""
    first = {name: row[0] for row in counterparts for name in row}
    by_first: dict[Hashable, list[str]] = {}
    for name in names:
        by_first.setdefault((kind(name), first.get(name, name)), []).append(name)
    by_form: dict[Hashable, list[str]] = {}
    for members in by_first.values():
        by_form.setdefault((kind(members[0]), form(members[0])), []).extend(members)
    return tuple(tuple(members) for members in by_form.values())


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


def line_of(element: Any) -> str:
    """The file's name, in which nothing means anything to Markdown, and the line of an element."""
    return re.sub(r"([!-,/;-@[-^`{-~])", r"\\\1", escaped(element.span.place))


def with_others(names: Sequence[str]) -> str:
    """The first of several names, and how many more there are."""
    return code(names[0]) + (f" and {len(names) - 1} more" if len(names) > 1 else "")


def plural(count: int, noun: str, many: str = "") -> str:
    """A number and its noun."""
    return f"{count} {noun if count == 1 else many or noun + 's'}"


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """The head of every explanation."""

    model: str
    scene: str
    method: str
    summary: Table
    version: str = __version__
    digits: int = DIGITS


def render(template: str, explanation: Explanation) -> str:
    """The text of an explanation, without runs of empty lines."""
    text = environment().get_template(template).render(e=explanation)
    return re.sub(r"\n{3,}", "\n\n", text).rstrip("\n") + "\n"
